"""What surfaces look like close by: procedural patterns, images and colours."""
