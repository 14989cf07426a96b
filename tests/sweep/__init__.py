"""Tests of `cspr_jax.sweep`."""
