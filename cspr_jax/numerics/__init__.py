"""Numerics: functions that XLA compiles well, batches of one shape, bounds, searches, polynomials, tolerances."""
