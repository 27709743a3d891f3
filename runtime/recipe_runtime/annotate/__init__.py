"""Labels of every object, and writers of the annotation formats."""
