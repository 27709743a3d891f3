"""Frames as pure functions of plan, Trace and number: engines, sources, single shots."""
