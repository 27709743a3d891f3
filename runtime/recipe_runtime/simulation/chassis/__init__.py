"""Vehicle dynamics: limits by kind of vehicle, steering, and the pose on the ground."""
