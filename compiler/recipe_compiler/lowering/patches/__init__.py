"""Lowers patches to plans and finds their texture files."""
