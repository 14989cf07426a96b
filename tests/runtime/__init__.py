"""Tests of `cspr_jax.runtime`."""
