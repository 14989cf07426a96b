"""Tests of `cspr_jax.families.lines`."""
