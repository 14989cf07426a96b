"""Published tables from Python, recomputed as by `cspr table`, and speed, measured as by `cspr bench`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cspr_jax.api.arguments.checks import MaxArcs, checked
from cspr_jax.errors import ConfigError, demand, shown
from cspr_jax.errors.arguments import TEXT, AnyInteger, Count, or_none
from cspr_jax.errors.suggestions import one_of
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.runtime.processes import LARGEST, check_count, usual_count

if TYPE_CHECKING:
    from cspr_jax.outputs.table_layout import Cell

# Tables and rates need different large parts of the package: import each where it is used.


def list_tables() -> dict[str, str]:
    """The published tables that can be recomputed.

    Returns:
        the title of each table, with its source, by name.
    """
    from cspr_jax.published.tables import TABLES

    return {name: source.title for name, source in TABLES.items()}


@checked()
def table(
    name: Annotated[str, or_none(TEXT)],
    *,
    definition: str | None = None,
    amplitude: str | None = None,
    fine: bool = False,
    max_arcs: MaxArcs | None = None,
    values: Count | None = None,
    workers: AnyInteger | None = 1,
    again: bool = True,
) -> list[Cell]:
    """Recompute a published table.

    Args:
        name: a name of `list_tables`.
        definition: tables 3.3, 3.4: definition of accessible orientations, "grid", "scan", "equal-volume" or "all";
            None: the usual one.
        amplitude: tables 3.3, 3.4: "quintic", "effective", "effective-c3" or "all"; None: the usual one.
        fine: tables 3.3, 3.4: whether the step is pi/64 instead of pi/32.
        max_arcs: tables 3.3, 3.4: largest number of arcs tried; None: 20.
        values: tables 3.3, 3.4: number of values of beta-hat tried at each orientation; None: 20.
        workers: tables 3.3, 3.4: number of processes on this machine; above 1, a script must call this function under
            `if __name__ == "__main__":`. None: the usual number.
        again: whether to compute even if an earlier run of the same version has stored the cells beside compiled code,
            as `cspr table` does (`keep_compiled_code`).

    Returns:
        the cells of the table, each with `row`, `column`, `computed`, `published`, `variant` and `differs`.

    Raises:
        ConfigError: there is no such table, or it has no such option.
        ResourceError: a worker process died.
    """
    from cspr_jax.published.tables import TABLES, chosen, table_cells

    if name not in TABLES:
        raise ConfigError("table", f"{shown(name)}: {demand(one_of(name, TABLES))}")
    check_count(workers)
    options: dict[str, Any] = {"--definition": definition, "--amplitude": amplitude, "--fine": fine or None}
    options |= {"--max-arcs": max_arcs, "--values": values}
    choice = chosen(name, options | {"--workers": None if workers == 1 else workers})
    if workers is None:
        workers = usual_count(LARGEST) if TABLES[name].by_processes else 1
    with double_precision():
        return table_cells(name, choice, workers, again=again)


@checked()
def benchmark(kernels: str | Path | None = None) -> dict[str, Any]:
    """Measure feasibility checks per second, beside a NumPy version of the same check; this takes a minute.

    Args:
        kernels: folder of C++ kernels to measure as well, such as `benchmarks` of a checkout; None: no kernels.

    Returns:
        what `cspr bench --json` prints.

    Raises:
        ConfigError: there is no compiler, it rejects a kernel, or a kernel gives other numbers.
    """
    from cspr_jax.bench import bench

    with double_precision():
        return bench(None if kernels is None else Path(kernels))
