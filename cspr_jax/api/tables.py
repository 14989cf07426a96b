"""Published tables and raw speed from Python, as `cspr table` and `cspr bench` have them."""

from pathlib import Path
from typing import Any

from cspr_jax import bench
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.errors import ConfigError, shown
from cspr_jax.outputs.table_layout import Cell
from cspr_jax.published import tables


def table_names() -> dict[str, str]:
    """The published tables that can be computed again.

    Returns:
        title, with its source, by name.
    """
    return {name: source.title for name, source in tables.TABLES.items()}


def table(name: str, *, definition: str | None = None, amplitude: str | None = None, fine: bool = False) -> list[Cell]:
    """Compute a published table again.

    Args:
        name: of `table_names`.
        definition: of accessible orientations in tables 3.3 and 3.4: "grid", "scan", "equal-volume" or "all"; None: the
            usual one.
        amplitude: in these: "quintic", "effective", "effective-c3" or "all"; None: the usual one.
        fine: in these: whether the step is pi/64 instead of pi/32.

    Returns:
        its cells, each with `row`, `column`, `computed`, `published`, `variant` and `differs`.

    Raises:
        ConfigError: no such table, or a choice that it does not have.
    """
    if name not in tables.TABLES:
        raise ConfigError("table", f"{shown(name)}: must be one of {', '.join(tables.TABLES)}")
    choice = tables.chosen(name, {"--definition": definition, "--amplitude": amplitude, "--fine": fine or None})
    with double_precision():
        return tables.table_cells(name, choice)


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
