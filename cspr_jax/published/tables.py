"""Published tables beside computed cells. Published numbers are only compared with, never computed with."""

import contextlib
import dataclasses
import hashlib
import json
import os
import sys
import zlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import jax
import jaxlib.version
import numpy as np

from cspr_jax.errors import ConfigError, demand, shown
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs.table_layout import Cell, grid
from cspr_jax.plans.planning import plan
from cspr_jax.published import batotp, boralugoda, chapter_1, chapter_3, peers, ray_hulls, table_3_2, table_3_4
from cspr_jax.published.chapter_1 import Key
from cspr_jax.published.chapter_3 import TableSettings
from cspr_jax.published.reasons import READINGS, reason_of
from cspr_jax.runtime.compile_cache import PROGRAMS, plain_bytes
from cspr_jax.runtime.packed import inflated
from cspr_jax.runtime.persistent_jit import checksum_of_sources
from cspr_jax.runtime.stages import within

SCHEMA = 1
# As for keys of plans and sweeps.
LARGEST_ARCS, LARGEST_VALUES = 1000, 100
# Endings of the package's files that decide what it computes.
_SOURCES = (".py", ".toml", ".csv")
LARGEST_RESULT = 1 << 24  # bytes, before compression


@dataclasses.dataclass(frozen=True)
class TableSource:
    """A table that can be recomputed.

    Fields:
        title: title of the table, with its source.
        published: printed cells, by row, column and variant.
        compute: () -> computed cells, by row, column and variant; if `with_choice`, its arguments are
            a `TableSettings` and a number of processes.
        with_choice: whether definitions, amplitude functions and step can be chosen.
        by_processes: whether it uses several processes unless the user says how many.
        transposed: whether the source prints these rows as columns.
        heads: names of rows and columns that mean something else in this source than in other sources.
        measures: whether it measures times, so that results of earlier runs are of no use.
    """

    title: str
    published: dict[Key, str]
    compute: Callable[..., dict[Key, float | None]]
    with_choice: bool = False
    by_processes: bool = False
    transposed: bool = False
    heads: Mapping[str, str] = dataclasses.field(default_factory=dict)
    measures: bool = False


def _table_2_1() -> dict[Key, float | None]:
    answers = plan(Path(__file__).with_name("table_2_1.toml")).answers
    columns = {"feasible_at_infinity": answers.feasible_at_infinity, "p": answers.arcs, "T": answers.duration}
    cells: dict[Key, float | None] = {}
    for i, arcs in enumerate(answers.arcs):
        for name, values in columns.items():
            cells[str(i + 1), name, ""] = float(values[i]) if name == "feasible_at_infinity" or arcs > 0 else None
    return cells


_PUBLISHED_2_1 = {
    "1": ("-0.1557", "5", "6.54"),
    "2": ("-0.1416", "2", "2.61"),
    "3": ("0.2057", "5", "6.54"),
    "4": ("0.8208", "5", "6.53"),
    "5": ("0.8494", "5", "6.52"),
    "6": ("0.5425", "6", "7.85"),
}

# In most tables p is the number of arcs; in those with these heads it is the S-model's time of acceleration.
ACCELERATION = {"p": "acceleration (s)"}
TABLES = {
    "1.1": TableSource(
        "Dion-Gauvin thesis, Table 1.1: oscillations needed at a distance of four radii, horizontal, A1",
        chapter_1.PUBLISHED["1.1"],
        chapter_1.table_1_1,
    ),
    "1.2": TableSource(
        "Dion-Gauvin thesis, Table 1.2: oscillations needed at various inclinations, sigma R = 1, xi = 1",
        chapter_1.PUBLISHED["1.2"],
        chapter_1.table_1_2,
    ),
    "1.3": TableSource(
        "Dion-Gauvin thesis, Table 1.3: oscillations needed with various amplitude functions, horizontal",
        chapter_1.PUBLISHED["1.3"],
        chapter_1.table_1_3,
    ),
    "2.1": TableSource(
        "Dion-Gauvin thesis, Table 2.1: feasibility at infinity, smallest number of arcs, duration (s)",
        {
            (row, column, ""): value
            for row, cells in _PUBLISHED_2_1.items()
            for column, value in zip(("feasible_at_infinity", "p", "T"), cells, strict=True)
        },
        _table_2_1,
    ),
    "3.2": TableSource(
        "Dion-Gauvin thesis, Table 3.2: smallest number of arcs and duration (s) with the printed beta-hat",
        table_3_2.PUBLISHED,
        table_3_2.table_3_2,
    ),
    "3.3": TableSource(
        "Dion-Gauvin thesis, Table 3.3: accessible and attainable orientations at four places, z0 = z = 1.7 m",
        chapter_3.PUBLISHED,
        chapter_3.table_3_3,
        with_choice=True,
        transposed=True,
    ),
    "3.4": TableSource(
        "Dion-Gauvin thesis, Table 3.4: smallest proportion (%) of attainable orientations from 1.5b to 3b, z0 = z",
        table_3_4.PUBLISHED,
        table_3_4.table_3_4,
        with_choice=True,
        by_processes=True,
    ),
    "4.1": TableSource(
        "Boralugoda thesis, Table 4.1: solutions of (28) and (29), s",
        boralugoda.PUBLISHED["4.1"],
        boralugoda.table_4_1,
        heads=ACCELERATION,
    ),
    "4.2": TableSource(
        "Boralugoda thesis, Table 4.2: path acceleration, slope (1/s^3) and intercept (1/s^2) of each range",
        boralugoda.PUBLISHED["4.2"],
        boralugoda.table_4_2,
    ),
    "4.3": TableSource(
        "Boralugoda thesis, Table 4.3: how far the S-model passes its boundaries, 1/s^2, and the first node without",
        boralugoda.PUBLISHED["4.3"],
        boralugoda.table_4_3,
        heads=ACCELERATION,
    ),
    "peers": TableSource(
        "Workspaces in papers on other tools: poses, and microseconds a pose here (compiling included), by linear "
        "programs and by least squares; for all poses of the first row CASPR prints 89 to 455 s (IROS 2016, Table I). "
        "Then WireX's hull of IPAnema1Design by the closed form (its README), and larger ones: where the tensions in "
        "closed form break the limits, others may keep them. Last, batotp's sample CSPR3DOF: the time of a motion "
        "that is proved to keep all limits, and a lower bound of the time of all motions along its path",
        ray_hulls.PUBLISHED | batotp.PUBLISHED,
        lambda: peers.peers() | ray_hulls.hulls() | batotp.least_time(),
        measures=True,
    ),
}


def table_cells(name: str, choice: TableSettings | None = None, workers: int = 1, *, again: bool = True) -> list[Cell]:
    """Compute a table."""
    source, choice = TABLES[name], choice or TableSettings()

    def compute() -> list[list]:
        with within(f"table {name}"):
            computed = source.compute(choice, workers) if source.with_choice else source.compute()
        return [[*key, value] for key, value in computed.items()]

    settings = dataclasses.asdict(choice) if source.with_choice else {}
    rows = compute() if source.measures else kept_result(f"table-{name}", settings, compute, again=again)
    return [
        Cell(row, column, value, source.published.get((row, column, variant), ""), variant)
        for row, column, variant, value in rows
    ]


def kept_result(name: str, settings: Any, compute: Callable[[], Any], *, again: bool = False) -> Any:
    """Result of an earlier run with the same sources, libraries and settings; if none, or `again`, compute and keep it.

    Results are kept beside compiled code, under a checksum: damaged ones are removed before they are read.
    """
    folder = os.environ.get(PROGRAMS)
    if not folder:
        return compute()
    versions = [jax.__version__, jaxlib.version.__version__, np.__version__, sys.version, jax.default_backend()]
    key = json.dumps([name, settings, versions, os.environ.get("XLA_FLAGS", ""), checksum_of_sources(_SOURCES)])
    path = Path(folder) / f"{name}-{hashlib.sha256(key.encode()).hexdigest()}"
    if not again:
        with contextlib.suppress(OSError, ValueError, TypeError, RecursionError):
            kept_key, result = json.loads(inflated(plain_bytes(path), LARGEST_RESULT))
            if kept_key == key:
                return result
    result = compute()
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        partial.write_bytes(zlib.compress(json.dumps([key, result]).encode()))
        partial.replace(path)  # the path may be a link to an earlier run's result
    return result


def table_object(name: str, cells: list[Cell]) -> dict[str, Any]:
    """The object that `cspr table --json` prints."""
    return {"schema": SCHEMA, "table": name, "cells": [_plain(cell) for cell in cells]}


def _plain(cell: Cell) -> dict[str, Any]:
    fields = {"row": cell.row, "column": cell.column, "computed": cell.computed, "published": cell.published}
    return fields | ({"variant": _variant(cell.variant)} if cell.variant else {})


def _variant(text: str) -> dict[str, str]:
    # Several choices read "key = value; key = value"; any other text is one reading, in plain words.
    if "; " not in text:
        return {"reading": text}
    return dict(part.split(" = ", 1) for part in text.split("; "))


def table_for_people(name: str, cells: list[Cell], *, all_readings: bool = False) -> Any:
    """The table for a terminal, laid out as in print: published and computed values, and why they differ."""
    source = TABLES[name]
    return grid(
        source.title,
        cells,
        transposed=source.transposed,
        heads=source.heads,
        reading=READINGS.get(name, ""),
        is_full=all_readings,
        reason=lambda cell: reason_of(name, cell),
    )


def chosen(name: str, options: dict[str, Any]) -> TableSettings | None:
    """Settings of a table, from the options of the command line."""
    if not TABLES[name].with_choice:
        for option, value in options.items():
            if value is not None:
                raise ConfigError(option, f"must be absent with table {name}")
        return None
    usual = TableSettings()

    def values_of(option: str, names: Iterable[str], otherwise: tuple[str, ...]) -> tuple[str, ...]:
        value, allowed = options[option], tuple(names)
        if value not in (None, "all", *allowed):
            raise ConfigError(option, f"{shown(value)}: {demand(one_of(value, allowed))}, all")
        return otherwise if value is None else allowed if value == "all" else (value,)

    return TableSettings(
        values_of("--definition", chapter_3.DEFINITIONS, usual.definitions),
        values_of("--amplitude", chapter_3.AMPLITUDES, usual.amplitudes),
        2 if options["--fine"] else 1,
        _count("--max-arcs", options["--max-arcs"], usual.max_arcs, LARGEST_ARCS),
        _count("--values", options["--values"], usual.values, LARGEST_VALUES),
    )


def _count(option: str, value: Any, otherwise: int, maximum: int) -> int:
    if value is None:
        return otherwise
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= maximum:
        raise ConfigError(option, f"{shown(value)}: must be an integer from 1 to {maximum}")
    return value
