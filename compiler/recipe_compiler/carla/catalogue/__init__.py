"""CARLA's towns and blueprints, and those of the library that are most like them."""
