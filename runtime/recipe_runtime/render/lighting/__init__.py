"""From weather and sun to the light of every sample: sky, lamps, shadows, materials, reflections."""
