"""The two forms of configurations, read into one description of what is spawned."""
