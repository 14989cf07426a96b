"""Tests of `cspr_jax.families.platforms`."""
