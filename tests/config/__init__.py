"""Tests of `cspr_jax.config`."""
