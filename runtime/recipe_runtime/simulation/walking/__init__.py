"""Decisions of pedestrians: routes and pauses, crossing of roads, avoidance and detours."""
