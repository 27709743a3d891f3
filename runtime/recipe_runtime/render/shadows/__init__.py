"""Shadow maps of the sun: how they are drawn and sampled."""
