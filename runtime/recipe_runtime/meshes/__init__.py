"""Geometry: the triangles of towns, vehicles and pedestrians."""
