"""What a vehicle can do: its kind, its steering, and how it stands on the ground."""
