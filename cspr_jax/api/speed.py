"""Raw speed from Python, measured as by `cspr bench`."""

from pathlib import Path
from typing import Any

from cspr_jax import bench
from cspr_jax.api.argument_checks import checked
from cspr_jax.arithmetic.elementary import double_precision


@checked
def benchmark(kernels: str | Path | None = None) -> dict[str, Any]:
    """Measure checks per second, beside a NumPy version of the same check; it takes a minute.

    Args:
        kernels: folder of C++ kernels to measure beside, such as `benchmarks` of a checkout; None: without them.

    Returns:
        what `cspr bench --json` prints.

    Raises:
        ConfigError: there is no compiler, or it refuses a kernel, or that computes something else.
    """
    with double_precision():
        return bench.bench(None if kernels is None else Path(kernels))
