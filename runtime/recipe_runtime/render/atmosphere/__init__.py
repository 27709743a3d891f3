"""The state of the air: fog, sky and the light of sun and weather."""
