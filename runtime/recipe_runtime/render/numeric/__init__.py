"""Scalars, vectors and noise in kernels, with a fixed order of operations, and the seeds of all noise."""
