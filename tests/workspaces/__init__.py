"""Tests of `cspr_jax.workspaces`."""
