"""Three goals of attacks: hiding a person, hiding a car, and misleading a tracker."""
