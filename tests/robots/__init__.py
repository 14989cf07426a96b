"""Tests of `cspr_jax.robots`."""
