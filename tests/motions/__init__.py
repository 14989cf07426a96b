"""Tests of `cspr_jax.motions`."""
