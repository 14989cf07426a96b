"""Tests of `cspr_jax.beziers`."""
