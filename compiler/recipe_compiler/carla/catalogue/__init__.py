"""CARLA's towns and blueprints, and the most similar ones of the library."""
