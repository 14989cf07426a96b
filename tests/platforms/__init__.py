"""Tests of `cspr_jax.platforms`."""
