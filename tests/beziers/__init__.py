"""Tests of `cspr_jax.families.beziers`."""
