"""Tests of `cspr_jax.families.free`."""
