"""From light to pixels: rain, exposure, tone curve, noise, lens effects, motion blur."""
