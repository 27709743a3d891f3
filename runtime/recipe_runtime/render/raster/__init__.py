"""Which triangle every pixel sees, and all labels that follow."""
