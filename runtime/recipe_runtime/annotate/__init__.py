"""Per-object truth, and writers for each format."""
