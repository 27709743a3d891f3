"""What happens to finished datasets: statements about them."""
