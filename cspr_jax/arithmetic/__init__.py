"""Elementary functions, bounds, rotations, frames, and batches of one shape."""
