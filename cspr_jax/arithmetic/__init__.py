"""Elementary functions, bounds, lanes, rotations, frames, minima, and batches of one shape."""
