"""Bodies of actors: skeletons, joints and the poses of their parts."""
