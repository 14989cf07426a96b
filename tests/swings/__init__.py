"""Tests of `cspr_jax.families.swings`."""
