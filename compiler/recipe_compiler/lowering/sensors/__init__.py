"""Lowers sensors to plans: poses, routes, arms and intervals."""
