"""Published tables as printed: digits, signs, blocks. Nothing here computes a table."""

import io
import sys

import pytest
from rich.console import Console

from cspr_jax.outputs.table_layout import LEGEND, Cell, grid, two_digits
from cspr_jax.published.reasons import READINGS, REASONS, reason_of
from cspr_jax.published.tables import TABLES, table_for_people
from cspr_jax.runtime import terminal


def lines_of(cells, **options) -> list[list[str]]:
    """What stands in the boxes, line by line; a line without boxes is one text."""
    console = Console(file=io.StringIO(), width=140, highlight=False, force_terminal=False)
    console.print(grid("Table 9.9", cells, **options))
    lines = console.file.getvalue().splitlines()
    texts = [[part.strip() for part in line.replace("┃", "│").strip("│").split("│")] for line in lines]
    return [parts for parts in texts if not set(parts[0]) & set("┏┡└━─")]


@pytest.mark.parametrize(
    ("printed", "computed", "published", "differs"),
    [
        ("6.54", 6.5381, 6.54, False),
        ("6.54", 6.5449, 6.54, False),
        ("6.54", 6.5451, 6.54, True),
        ("10.6740", 10.67396, 10.674, False),
        ("5", 5.0, 5, False),
        ("5", 6.0, 5, True),
        ("5", None, 5, True),
        ("-0.1557", -0.15568, -0.1557, False),
        ("", 3.0, None, False),
        ("", None, None, False),
    ],
)
def test_what_differs(printed, computed, published, differs):
    cell = Cell("r", "c", computed, printed)
    assert (cell.published, type(cell.published)) == (published, type(published)) and cell.differs is differs


def test_rows_and_columns():
    cells = [
        Cell("1", "p", 5.0, "5"),
        Cell("1", "T", 6.5381, "6.54"),
        Cell("2", "p", None, "13"),
        Cell("2", "T", None, ""),
        Cell("3", "p", 34134.0, ""),
        Cell("3", "T", 7.0, "6.5400"),
        Cell("3", "epsilon", 0.059912, ""),
    ]
    assert lines_of(cells)[:5] == [
        ["Table 9.9"],
        ["", "p", "T (s)", "epsilon"],
        ["1", "5 / 5", "6.54 / 6.54", ""],
        ["2", "13 / none !=", "? / none", ""],
        ["3", "? / 34134", "6.5400 / 7.0000 !=", "? / 0.05991"],
    ]


def test_a_transposed_table_and_its_readings():
    cells = [
        Cell(place, column, computed, printed, reading)
        for reading in ("first", "second")
        for place, values in {"x": ((27610.0, "27610"), (-0.0, "0.0")), "y": ((34134.0, "27610"), (1.04, ""))}.items()
        for column, (computed, printed) in zip(("accessible", "error"), values, strict=True)
    ]
    block = [["", "x", "y"], ["accessible", "27610 / 27610", "27610 / 34134 !="], ["error", "0.0 / 0.0", "? / 1.0"]]
    found = lines_of(cells, transposed=True)
    assert found[:9] == [["Table 9.9"], ["first"], *block, ["second"], *block]
    assert " ".join(parts[0] for parts in found[9:]) == LEGEND


@pytest.mark.parametrize(
    ("name", "head"), [("2.1", "p"), ("3.2", "p"), ("4.1", "acceleration (s)"), ("4.3", "acceleration (s)")]
)
def test_p_is_the_number_of_arcs_in_every_table(name, head):
    """What the S-model calls p is a time, and is named so for people; programs get the printed name."""
    console = Console(file=io.StringIO(), width=140)
    console.print(table_for_people(name, [Cell("1", "p", 2.24, "2.240"), Cell("1", "T", 4.377, "4.377")]))
    (line,) = (line for line in console.file.getvalue().splitlines() if "T (s)" in line)
    assert [part.strip() for part in line.strip("┃").split("┃")][1:] == [head, "T (s)"] and name in TABLES


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (5.4, "5.4"),
        (5.44e-3, "0.0054"),
        (123.4, "123"),
        (98765.0, "98765"),
        (-0.62, "-0.62"),
        (3.2e-7, "3.2e-07"),
        (0.0, "0"),
    ],
)
def test_two_digits(value, text):
    assert two_digits(value) == text


def test_the_reading_that_fits_is_shown_and_reasons_are_named_once(capsys):
    """Others are a line each, with the letters of their reasons; all in full where they are asked for."""
    numbers = {("one", "p"): 8.0, ("two", "p"): 9.0}
    variants = ("right", "wrong")
    cells = [Cell(row, "p", value, "8", variant) for variant in variants for (row, _), value in numbers.items()]

    def told(**choices):
        table = grid("title", cells, reading="right", reason=lambda cell: "misprint", **choices)
        terminal.print_table(table, sys.stdout)
        return capsys.readouterr().out

    text = told()
    assert "right (the reading that the printed numbers fit)" in text and "wrong: 1 of 2 cells differ [a]" in text
    assert text.count("8 / 9 != [a]") == 1 and text.count("[a]: misprint") == 1
    assert told(is_full=True).count("8 / 9 != [a]") == 2


def test_every_reading_that_is_named_is_one_of_its_table():
    for name, reading in READINGS.items():
        assert reading in {variant for _, _, variant in TABLES[name].published}
    assert REASONS.keys() <= TABLES.keys()
    cell = Cell("2", "p", None, "9", "amplitude = quintic; pose_2 = pi/2 (printed)")
    assert "pi/3" in reason_of("3.2", cell) and reason_of("3.2", Cell("3", "p", 1.0, "12", cell.variant)) == ""
