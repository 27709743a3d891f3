"""The cache folder: its store of Traces and records, and pruning."""
