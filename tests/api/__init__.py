"""Tests of `cspr_jax.api`."""
