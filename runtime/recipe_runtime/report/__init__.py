"""Pictures of a dataset: contact sheets."""
