"""Every mistake of a recipe, found in one run."""
