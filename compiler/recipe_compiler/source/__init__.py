"""Recipe text to values with positions: YAML, `extends` and deltas."""
