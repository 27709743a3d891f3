"""What recipes may name: towns, blueprints, weather presets."""
