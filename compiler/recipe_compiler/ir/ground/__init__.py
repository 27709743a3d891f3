"""The ground of a scene as a plan describes it: where solid things stand."""
