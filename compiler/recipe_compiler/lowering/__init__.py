"""A variant to its ScenarioPlan: placement, camera motion, props, sun, assets; and warnings."""
