"""Tests of `cspr_jax.numerics`."""
