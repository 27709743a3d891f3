"""The recipe language: its models, its messages and its JSON Schema."""
