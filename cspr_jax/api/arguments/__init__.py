"""Arguments of public functions: their checks, and how kernels take them."""
