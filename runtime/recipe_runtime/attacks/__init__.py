"""Ground truth for attacks: where patches are in a picture."""
