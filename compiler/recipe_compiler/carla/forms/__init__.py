"""Readers of the two forms of configurations; both return the entries to spawn as `specs.Spec`."""
