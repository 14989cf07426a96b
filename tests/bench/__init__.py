"""Tests of `cspr_jax.bench`."""
