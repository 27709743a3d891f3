"""Benchmarks: frames per second compared with a plain script of the same scene, and other measurements."""
