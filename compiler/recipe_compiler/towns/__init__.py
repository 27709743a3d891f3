"""Procedural town layouts, as numbers."""
