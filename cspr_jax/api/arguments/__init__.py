"""Arguments of public functions: their checks, and their conversion for kernels."""
