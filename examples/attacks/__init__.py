"""Attacks on detectors through the renderer."""
