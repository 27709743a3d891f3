"""What happens to finished datasets: checks of their files, their history, statements about them."""
