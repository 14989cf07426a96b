"""Tests of `cspr_jax.maps`."""
