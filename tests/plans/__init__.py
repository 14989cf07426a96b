"""Tests of `cspr_jax.plans`."""
