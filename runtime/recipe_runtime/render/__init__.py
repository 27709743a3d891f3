"""The renderer: Warp kernels, in pipeline order. The only folder that imports warp."""
