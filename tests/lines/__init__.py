"""Tests of `cspr_jax.lines`."""
