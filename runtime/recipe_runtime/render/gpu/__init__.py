"""Many frames of one camera on a GPU: recorded kernels and the stream of frames."""
