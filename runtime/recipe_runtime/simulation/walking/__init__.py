"""How pedestrians decide: their routes and pauses, crossings of roads, and avoidance of others."""
