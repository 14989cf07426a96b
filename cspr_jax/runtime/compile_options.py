"""Flags and options with which XLA compiles faster, but to slower code: for plans, which compute little."""

import os

# With these flags compiling takes half the time.
QUICK = (
    "--xla_backend_optimization_level=1",
    "--xla_cpu_use_fusion_emitters=false",
    "--xla_cpu_parallel_codegen_split_count=1",
)


def proof_options() -> dict[str, int] | None:
    """Options of jax.jit for kernels of proofs, which then compile in a third of the time; a motion has few blocks."""
    return {"xla_backend_optimization_level": 0} if QUICK[0] in os.environ.get("XLA_FLAGS", "") else None
