"""Decisions of pedestrians: routes and pauses, crossing of roads, avoidance, making way and detours."""
