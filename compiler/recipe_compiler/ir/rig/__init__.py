"""Sensors: their plans, and the poses of those that follow an actor."""
