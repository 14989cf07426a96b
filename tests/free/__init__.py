"""Tests of `cspr_jax.free`."""
