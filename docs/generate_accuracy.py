"""The page of accuracy: every published table that is computed again, with every published cell that is known.

The page is built with the site from docs/accuracy.json, which holds what was computed, since that takes long:

python docs/generate_accuracy.py all        compute all tables again, about 20 minutes
python docs/generate_accuracy.py 2.1 4.1    these; the others stay as they are
python docs/generate_accuracy.py choices-3.3 choices-3.4    how proportions depend on what was tried, over an hour
"""

import itertools
import json
import sys
import textwrap
from pathlib import Path

import cspr_jax
from cspr_jax.outputs.table_layout import Cell, computed_text
from cspr_jax.published import chapter_3, table_3_4
from cspr_jax.published.reasons import reason_of

STORED = Path(__file__).with_name("accuracy.json")
HEAD = """# Accuracy

Each table that is computed again (`cspr table NAME`) is shown with its published cells, as **published / computed**,
with as many digits as printed; blocks with more than a hundred cells show only cells that differ by more than one in
their last digit. Published numbers are compared with, never computed with. Cells that differ by more than the rounding
of these digits are in **bold**. "none" means that no feasible number was found. The text below each table says why
cells differ. [What was compared](../comparisons.md) has further comparisons, with independent oracles and with another
simulator; `cspr table peers` compares with the numbers that other tools print.

The computed numbers are those of `docs/accuracy.json`: `python docs/generate_accuracy.py all` computes them again, in
about 20 minutes.
"""
CHOICES_WORDS = (
    "The text does not say up to which number of arcs p, and with how many values of beta-hat, orientations were "
    "tried. These are the proportions, in percent, for both amplitude functions with short ends. Elsewhere on this "
    "page p goes to 20, with 20 values."
)
# Blocks with more cells are summed up, and only cells that differ are stored.
MANY = 100
CHOICES = {"choices-3.3": "3.3", "choices-3.4": "3.4"}
# What the text does not say was tried in Tables 3.3 and 3.4.
LARGEST_ARCS, NUMBERS_OF_VALUES, AMPLITUDES = (10, 14, 20), (6, 12, 20), ("effective", "effective-c3")


def record(name: str, cells: list[Cell]) -> list[dict]:
    """What is stored of a table: for each reading of the source how many cells were compared, and the cells."""
    printed = [cell for cell in cells if cell.printed]
    blocks = []
    for variant in dict.fromkeys(cell.variant for cell in printed):
        block = [cell for cell in printed if cell.variant == variant]
        shown = block if len(block) <= MANY else [cell for cell in block if cell.differs]
        rows = [[cell.row, cell.column, _rounded(cell.computed), cell.printed] for cell in shown]
        blocks.append({"variant": variant, "compared": len(block), "cells": rows})
    return blocks


def _rounded(number: float | None) -> float | None:
    return None if number is None else float(f"{number:.10g}")


def record_choices(name: str) -> list[dict]:
    """Proportions of Table 3.3 or 3.4 for each number of arcs and of values of beta-hat that may have been tried."""
    source = {"3.3": chapter_3.PRINTED, "3.4": table_3_4.PRINTED}[name]
    blocks = []
    for amplitude in AMPLITUDES:
        tried = []
        for max_arcs, values in itertools.product(LARGEST_ARCS, NUMBERS_OF_VALUES):
            cells = cspr_jax.table(name, amplitude=amplitude, max_arcs=max_arcs, values=values, workers=None)
            proportions = [f"{cell.computed:.1f}" for cell in cells if cell.column == "proportion"]
            tried.append([str(max_arcs), str(values), *proportions])
            sys.stderr.write(f"{amplitude} {tried[-1]}\n")
        printed = [cells[2] if name == "3.3" else cells for cells in source.values()]
        variant = f"amplitude = {amplitude} 0.1; definition = scan"
        blocks.append({"variant": variant, "columns": list(source), "printed": printed, "tried": tried})
    return blocks


def page_text() -> str:
    """The page."""
    stored = json.loads(STORED.read_text("utf-8"))
    names = [name for name in (*cspr_jax.list_tables(), *CHOICES) if name in stored]
    return "\n".join([HEAD, *((_choices if name in CHOICES else section)(name, stored[name]) for name in names)])


def section(name: str, blocks: list[dict]) -> str:
    """A table as Markdown: its heading, its blocks and why cells differ."""
    known = [[Cell(*row, block["variant"]) for row in block["cells"]] for block in blocks]
    differing = [cell for cells in known for cell in cells if cell.differs]
    said = f"{cspr_jax.list_tables()[name]}. Published cells compared: {sum(block['compared'] for block in blocks)}, "
    said += f"of which {len(differing)} differ."
    parts = [f"## Table {name}\n\n{textwrap.fill(said, 118)}\n"]
    for block, cells in zip(blocks, known, strict=True):
        parts += [f"*{block['variant']}*\n"] if block["variant"] else []
        parts.append(_grid(cells) if block["compared"] <= MANY else _summary(block["compared"], cells))
    reasons = dict.fromkeys(reason_of(name, cell) for cell in differing)
    lines = [textwrap.fill(f"- {text[:1].upper()}{text[1:]}.", 118, subsequent_indent="  ") for text in reasons if text]
    return "\n".join([*parts, "\n".join(lines or ["No cell differs."]) + "\n"])


def _grid(cells: list[Cell]) -> str:
    # Cells of one reading of the source, the shorter side across.
    keys = [(cell.row, cell.column) for cell in cells]
    down, across = (list(dict.fromkeys(key[i] for key in keys)) for i in (0, 1))
    if is_transposed := len(across) > len(down):
        down, across = across, down
    by = {(cell.column, cell.row) if is_transposed else (cell.row, cell.column): _both(cell, cells) for cell in cells}
    lines = ["| | " + " | ".join(across) + " |", "|---" * (len(across) + 1) + "|"]
    lines += [f"| {row} | " + " | ".join(by.get((row, column), "") for column in across) + " |" for row in down]
    return "\n".join(lines) + "\n"


def _summary(compared: int, differing: list[Cell]) -> str:
    # How far the cells of a large block agree; those that differ by more than one in their last digit are listed.
    far = [cell for cell in differing if abs(cell.computed - float(cell.printed)) > 1.5 * 10.0 ** -_decimals(cell)]
    words = f"{compared:,} cells compared; {len(differing) - len(far)} differ by one in their last digit"
    words += f", {len(far)} by more:" if far else "."
    return textwrap.fill(words, 118) + "\n" + (f"\n{_grid(far)}" if far else "")


def _decimals(cell: Cell) -> int:
    return len(cell.printed.partition(".")[2])


def _both(cell: Cell, cells: list[Cell]) -> str:
    both = f"{cell.printed} / {computed_text(cell, cells)}"
    return f"**{both}**" if cell.differs else both


def _choices(name: str, blocks: list[dict]) -> str:
    parts = [f"## Table {CHOICES[name]}: what was tried\n\n" + textwrap.fill(CHOICES_WORDS, 118) + "\n"]
    for block in blocks:
        rows = [["p up to", "values", *block["columns"]], ["printed", "", *block["printed"]], *block["tried"]]
        lines = ["| " + " | ".join(row).replace("|  |", "| |") + " |" for row in rows]
        lines.insert(1, "|---" * len(rows[0]) + "|")
        parts.append(f"*{block['variant']}*\n\n" + "\n".join(lines) + "\n")
    return "\n".join(parts)


def main(names: list[str]) -> None:
    """Compute tables, and store what is shown of them, a block a line."""
    stored = json.loads(STORED.read_text("utf-8")) if STORED.exists() else {}
    tables = [name for name in cspr_jax.list_tables() if name != "peers"]
    if not names or not set(names) <= {"all", *tables, *CHOICES}:
        sys.exit(f"{' '.join(names)}: must be all, or some of {', '.join((*tables, *CHOICES))}")
    for name in tables if names == ["all"] else names:
        stored[name] = record_choices(CHOICES[name]) if name in CHOICES else record(name, cspr_jax.table(name))
    write(stored)


def write(stored: dict[str, list[dict]]) -> None:
    """Write what is stored, in the order of the page."""
    order = [name for name in (*cspr_jax.list_tables(), *CHOICES) if name in stored]
    lines = (f'"{name}": [\n' + ",\n".join(map(json.dumps, stored[name])) + "\n]" for name in order)
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
