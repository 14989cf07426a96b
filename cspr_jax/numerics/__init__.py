"""Numerics: elementary functions that XLA compiles well, batches of one shape, cores, polynomials."""
