"""Tests of `cspr_jax.outputs`."""
