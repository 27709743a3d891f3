"""Imports configurations of CARLA's data collector (pull request 4992) and of OSCAR's as recipes.

`import_configurations` converts the text of configurations to the text of recipes, each with a report of the outcome of
every key; `Options` are values that a configuration leaves to other programs. Nothing in a configuration is executed,
and no file is read.
"""

from recipe_compiler.carla.importing import File, Imported, import_configurations
from recipe_compiler.carla.options import Options
from recipe_compiler.carla.report import Default, Outcome, Report, Row

__all__ = ["Default", "File", "Imported", "Options", "Outcome", "Report", "Row", "import_configurations"]
