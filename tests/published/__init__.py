"""Tests of `cspr_jax.published`."""
