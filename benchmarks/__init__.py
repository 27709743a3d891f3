"""How fast it is, measured beside a plain script of the same scene."""
