"""Imports configurations of CARLA's data collector (pull request 4992) and of OSCAR's as recipes.

`imported` turns the text of configurations into the text of recipes, each with a report of what became of every key.
Nothing of a configuration is executed, and no file is read.
"""

from recipe_compiler.carla.importing import MAX_FILES, File, Imported, imported
from recipe_compiler.carla.report import Default, Outcome, Report, Row

__all__ = ["MAX_FILES", "Default", "File", "Imported", "Outcome", "Report", "Row", "imported"]
