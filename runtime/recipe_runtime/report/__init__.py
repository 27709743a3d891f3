"""Pictures for people: contact sheets, town maps, differences and the catalogue of blueprints."""
