"""Warp, set up so that every machine computes the same bytes; arrays, structs and launches."""
