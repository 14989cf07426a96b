"""Published tables beside the same cells computed. The published numbers are compared with, never computed with."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cspr_jax import orientation_tables, pose_tables, transition_tables
from cspr_jax.orientation_tables import Choice
from cspr_jax.planning import plan
from cspr_jax.stages import within
from cspr_jax.transition_tables import Key

SCHEMA = 1


@dataclasses.dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Fields:
        row: as printed.
        column: as printed, or its name.
        computed: by this program; None where nothing was found.
        published: in the source; None where the project does not know it.
        variant: the reading of the source, where there are several.
    """

    row: str
    column: str
    computed: float | None
    published: float | None
    variant: str = ""


@dataclasses.dataclass(frozen=True)
class Source:
    """A table that can be recomputed.

    Fields:
        title: of the table, with its source.
        published: known cells, by row, column and variant.
        compute: () -> computed cells, by row, column and variant; of a `Choice`, where there is one.
        with_choice: whether there is one, of definitions, amplitude functions and step.
    """

    title: str
    published: dict[Key, float]
    compute: Callable[..., dict[Key, float | None]]
    with_choice: bool = False


def _table_2_1() -> dict[Key, float | None]:
    answers = plan(Path(__file__).parent / "published" / "table_2_1.toml").answers
    columns = {"feasible_at_infinity": answers.feasible_at_infinity, "p": answers.arcs, "T": answers.duration}
    found: dict[Key, float | None] = {}
    for i, arcs in enumerate(answers.arcs):
        for name, values in columns.items():
            found[str(i + 1), name, ""] = float(values[i]) if name == "feasible_at_infinity" or arcs > 0 else None
    return found


_PUBLISHED_2_1 = {
    "1": {"feasible_at_infinity": -0.1557, "p": 5, "T": 6.54},
    "2": {"feasible_at_infinity": -0.1416, "p": 2, "T": 2.61},
    "3": {"feasible_at_infinity": 0.2057, "p": 5, "T": 6.54},
}

TABLES = {
    "1.1": Source(
        "Dion-Gauvin thesis, Table 1.1: oscillations needed at a distance of four radii, horizontal, A1",
        transition_tables.PUBLISHED["1.1"],
        transition_tables.table_1_1,
    ),
    "1.2": Source(
        "Dion-Gauvin thesis, Table 1.2: oscillations needed at various inclinations, sigma R = 1, xi = 1",
        transition_tables.PUBLISHED["1.2"],
        transition_tables.table_1_2,
    ),
    "1.3": Source(
        "Dion-Gauvin thesis, Table 1.3: oscillations needed with various amplitude functions, horizontal",
        transition_tables.PUBLISHED["1.3"],
        transition_tables.table_1_3,
    ),
    "2.1": Source(
        "Dion-Gauvin thesis, Table 2.1: feasibility at infinity, smallest number of arcs, duration (s)",
        {(row, column, ""): value for row, cells in _PUBLISHED_2_1.items() for column, value in cells.items()},
        _table_2_1,
    ),
    "3.2": Source(
        "Dion-Gauvin thesis, Table 3.2: smallest number of arcs and duration (s) with the printed beta-hat",
        pose_tables.PUBLISHED,
        pose_tables.table_3_2,
    ),
    "3.3": Source(
        "Dion-Gauvin thesis, Table 3.3: accessible and attainable orientations at four places, z0 = z = 1.7 m",
        orientation_tables.PUBLISHED["3.3"],
        orientation_tables.table_3_3,
        with_choice=True,
    ),
    "3.4": Source(
        "Dion-Gauvin thesis, Table 3.4: smallest proportion (%) of attainable orientations from 1.5b to 3b, z0 = z",
        orientation_tables.PUBLISHED["3.4"],
        orientation_tables.table_3_4,
        with_choice=True,
    ),
}


def table_cells(name: str, choice: Choice | None = None) -> list[Cell]:
    """Compute a table.

    Args:
        name: one of `TABLES`.
        choice: for those that have one; None: the usual one.

    Returns:
        its cells, row by row.
    """
    source = TABLES[name]
    with within(f"table {name}"):
        computed = source.compute(choice or Choice()) if source.with_choice else source.compute()
    return [
        Cell(row, column, value, source.published.get((row, column, variant)), variant)
        for (row, column, variant), value in computed.items()
    ]


def table_object(name: str, cells: list[Cell]) -> dict[str, Any]:
    """The object that `cspr table --json` prints.

    Args:
        name: of the table.
        cells: its cells.

    Returns:
        plain values.
    """
    return {"schema": SCHEMA, "table": name, "cells": [_plain(cell) for cell in cells]}


def _plain(cell: Cell) -> dict[str, Any]:
    found = dataclasses.asdict(cell)
    variant = found.pop("variant")
    return found | ({"variant": _variant(variant)} if variant else {})


def _variant(text: str) -> dict[str, str]:
    # "key = value; key = value", or a reading in words.
    if "; " not in text:
        return {"reading": text}
    return dict(part.split(" = ", 1) for part in text.split("; "))


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
    several = any(cell.variant for cell in cells)
    for head in ("row", "column", *(["reading"] if several else []), "published", "computed", "difference"):
        table.add_column(head, justify="left" if head in ("column", "reading") else "right")
    for cell in cells:
        known = cell.published is not None and cell.computed is not None
        difference = f"{(cell.computed or 0.0) - (cell.published or 0.0):+.4f}" if known else "-"
        numbers = _number(cell.published), _number(cell.computed), difference
        table.add_row(cell.row, cell.column, *([cell.variant] if several else []), *numbers)
    return table


def _number(value: float | None) -> str:
    if value is None:
        return "-"
    return str(int(value)) if float(value).is_integer() else f"{value:.4f}"
