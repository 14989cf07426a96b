"""Tests of `cspr_jax.swings`."""
