"""Flags and options with which XLA compiles in less time, for code that is slower: plans move a few robots, once."""

import os

# Half of the time.
QUICK = (
    "--xla_backend_optimization_level=1",
    "--xla_cpu_use_fusion_emitters=false",
    "--xla_cpu_parallel_codegen_split_count=1",
)


def proof_options() -> dict[str, int] | None:
    """Options of jax.jit for kernels of proofs, a third of that time: a motion takes few blocks."""
    return {"xla_backend_optimization_level": 0} if QUICK[0] in os.environ.get("XLA_FLAGS", "") else None
