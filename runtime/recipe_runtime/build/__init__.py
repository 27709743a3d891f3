"""A plan to a dataset in a folder: worker processes, reuse, repair, journals and publication."""
