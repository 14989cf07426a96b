"""Tests of `cspr_jax.motion`, `cspr_jax.verification` and `cspr_jax.launch`."""
