"""The cache folder: its store of Traces and records, leases of running processes, and pruning."""
