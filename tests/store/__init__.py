"""Tests of `cspr_jax.store`."""
