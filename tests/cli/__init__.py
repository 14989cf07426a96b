"""Tests of `cspr_jax.cli`."""
