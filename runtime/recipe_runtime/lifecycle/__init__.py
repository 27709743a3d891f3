"""What happens to finished datasets: checks of their files, statements about them."""
