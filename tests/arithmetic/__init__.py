"""Tests of `cspr_jax.arithmetic`."""
