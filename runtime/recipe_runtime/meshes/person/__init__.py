"""Meshes of people: one continuous surface in the rest pose, with the weights of the skeleton's parts."""
