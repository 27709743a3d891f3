"""How pedestrians decide: their routes and pauses, crossings of roads, avoidance of others, and detours."""
