"""Published tables from Python, computed again as by `cspr table`."""

from typing import Any

from cspr_jax.api.argument_checks import checked
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.errors import ConfigError, shown
from cspr_jax.outputs.table_layout import Cell
from cspr_jax.published import tables
from cspr_jax.runtime.processes import LARGEST, check_count, usual_count


def table_names() -> dict[str, str]:
    """The published tables that can be computed again.

    Returns:
        title, with its source, by name.
    """
    return {name: source.title for name, source in tables.TABLES.items()}


@checked
def table(
    name: str,
    *,
    definition: str | None = None,
    amplitude: str | None = None,
    fine: bool = False,
    max_arcs: int | None = None,
    values: int | None = None,
    workers: int | None = 1,
) -> list[Cell]:
    """Compute a published table again.

    Args:
        name: of `table_names`.
        definition: of accessible orientations in tables 3.3 and 3.4: "grid", "scan", "equal-volume" or "all"; None: the
            usual one.
        amplitude: in these: "quintic", "effective", "effective-c3" or "all"; None: the usual one.
        fine: in these: whether the step is pi/64 instead of pi/32.
        max_arcs: in these: largest number of arcs tried; None: 20.
        values: in these: values of beta-hat tried at each orientation; None: 20.
        workers: in these: processes on this machine; above 1, a script calls it under `if __name__ == "__main__":`.
            None: as many as are usual.

    Returns:
        its cells, each with `row`, `column`, `computed`, `published`, `variant` and `differs`.

    Raises:
        ConfigError: no such table, or a choice that it does not have.
        ResourceError: a worker died.
    """
    if name not in tables.TABLES:
        raise ConfigError("table", f"{shown(name)}: must be one of {', '.join(tables.TABLES)}")
    check_count(workers)
    options: dict[str, Any] = {"--definition": definition, "--amplitude": amplitude, "--fine": fine or None}
    options |= {"--max-arcs": max_arcs, "--values": values}
    choice = tables.chosen(name, options | {"--workers": None if workers == 1 else workers})
    if workers is None:
        workers = usual_count(LARGEST) if tables.TABLES[name].by_processes else 1
    with double_precision():
        return tables.table_cells(name, choice, workers)
