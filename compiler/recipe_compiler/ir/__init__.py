"""What the runtime may import of the compiler: plans, lockfiles, errors, exact arithmetic, streams, assets."""
