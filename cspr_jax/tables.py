"""Published tables beside the same cells computed. The published numbers are compared with, never computed with."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cspr_jax.planning import plan

SCHEMA = 1


@dataclasses.dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Fields:
        row: as printed.
        column: as printed, or its name.
        computed: by this program; None where nothing was found.
        published: in the source; None where the project does not know it.
    """

    row: str
    column: str
    computed: float | None
    published: float | None


@dataclasses.dataclass(frozen=True)
class Source:
    """A table that can be recomputed.

    Fields:
        title: of the table, with its source.
        published: known cells, by row and column.
        compute: () -> computed cells, by row and column.
    """

    title: str
    published: dict[tuple[str, str], float]
    compute: Callable[[], dict[tuple[str, str], float | None]]


def _table_2_1() -> dict[tuple[str, str], float | None]:
    answers = plan(Path(__file__).parent / "published" / "table_2_1.toml").answers
    columns = {"feasible_at_infinity": answers.feasible_at_infinity, "p": answers.arcs, "T": answers.duration}
    found: dict[tuple[str, str], float | None] = {}
    for i, arcs in enumerate(answers.arcs):
        for name, values in columns.items():
            found[str(i + 1), name] = float(values[i]) if name == "feasible_at_infinity" or arcs > 0 else None
    return found


_PUBLISHED_2_1 = {
    "1": {"feasible_at_infinity": -0.1557, "p": 5, "T": 6.54},
    "2": {"feasible_at_infinity": -0.1416, "p": 2, "T": 2.61},
    "3": {"feasible_at_infinity": 0.2057, "p": 5, "T": 6.54},
}

TABLES = {
    "2.1": Source(
        "Dion-Gauvin thesis, Table 2.1: feasibility at infinity, smallest number of arcs, duration (s)",
        {(row, column): value for row, cells in _PUBLISHED_2_1.items() for column, value in cells.items()},
        _table_2_1,
    ),
}


def table_cells(name: str) -> list[Cell]:
    """Compute a table.

    Args:
        name: one of `TABLES`.

    Returns:
        its cells, row by row.
    """
    source = TABLES[name]
    return [Cell(*place, value, source.published.get(place)) for place, value in source.compute().items()]


def table_object(name: str, cells: list[Cell]) -> dict[str, Any]:
    """The object that `cspr table --json` prints.

    Args:
        name: of the table.
        cells: its cells.

    Returns:
        plain values.
    """
    return {"schema": SCHEMA, "table": name, "cells": [dataclasses.asdict(cell) for cell in cells]}


def table_for_people(name: str, cells: list[Cell]):
    """The table for a terminal: published, computed, difference.

    Args:
        name: of the table.
        cells: its cells.

    Returns:
        a rich table.
    """
    from rich.table import Table  # only a terminal needs it

    note = "- : the project does not know the published value"
    table = Table(title=TABLES[name].title, title_justify="left", caption=note, caption_justify="left")
    for head in ("row", "column", "published", "computed", "difference"):
        table.add_column(head, justify="left" if head == "column" else "right")
    for cell in cells:
        known = cell.published is not None and cell.computed is not None
        difference = f"{cell.computed - cell.published:+.4f}" if known else "-"  # type: ignore[operator]
        table.add_row(cell.row, cell.column, _number(cell.published), _number(cell.computed), difference)
    return table


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return str(int(value)) if float(value).is_integer() else f"{value:.4f}"
