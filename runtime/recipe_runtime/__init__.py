"""The runtime: plans to data. PyBullet moves the bodies, Warp kernels draw them."""
