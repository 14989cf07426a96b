"""Write docs/accuracy.md: every published table that is computed again, with every published cell that is known.

python docs/generate_accuracy.py            all of them, about 20 minutes
python docs/generate_accuracy.py 2.1 4.1    these; the others stay as they are
python docs/generate_accuracy.py choices-3.3 choices-3.4    how proportions depend on what was tried, over an hour
"""

import itertools
import re
import sys
import textwrap
from pathlib import Path

import cspr_jax
from cspr_jax.outputs.table_layout import Cell, computed_text
from cspr_jax.published import chapter_3, table_3_4
from cspr_jax.published.reasons import reason_of

PAGE = Path(__file__).with_name("accuracy.md")
HEAD = """# Accuracy

Do not edit: written by `python docs/generate_accuracy.py` (about 20 minutes), not by `make docs`. Each table that is
computed again (`cspr table NAME`) is shown with its published cells, as **published / computed**, with as many digits
as printed; blocks with more than a hundred cells show only cells that differ by more than one in their last digit.
Published numbers are compared with, never computed with. Cells that differ by more than the rounding of these digits
are in **bold**. "none" means that no feasible number was found. The text below each table says why cells differ.
[What was compared](comparisons.md) has further comparisons, with independent oracles and with another simulator;
`cspr table peers` compares with the numbers that other tools print.
"""
CHOICES_WORDS = (
    "The text does not say up to which number of arcs p, and with how many values of beta-hat, orientations were "
    "tried. These are the proportions, in percent, for both amplitude functions with short ends. Elsewhere on this "
    "page p goes to 20, with 20 values."
)
# Blocks with more cells are summed up.
MANY = 100
CHOICES = {"choices-3.3": "3.3", "choices-3.4": "3.4"}
# What the text does not say was tried in Tables 3.3 and 3.4.
LARGEST_ARCS, NUMBERS_OF_VALUES, AMPLITUDES = (10, 14, 20), (6, 12, 20), ("effective", "effective-c3")


def section(name: str, cells: list[Cell]) -> str:
    """A table as Markdown.

    Args:
        name: of the table.
        cells: all of it.

    Returns:
        its heading, its blocks and why cells differ.
    """
    printed = [cell for cell in cells if cell.printed]
    differ = sum(cell.differs for cell in printed)
    title = cspr_jax.list_tables()[name]
    said = f"{title}." + (f" Published cells compared: {len(printed)}, of which {differ} differ." if printed else "")
    parts = [f"## Table {name}\n\n{textwrap.fill(said, 118)}\n"]
    for variant in dict.fromkeys(cell.variant for cell in printed):
        own = [cell for cell in printed if cell.variant == variant]
        parts += [f"*{variant}*\n"] if variant else []
        parts.append(block(own) if len(own) <= MANY else summary(own))
    reasons = dict.fromkeys(reason_of(name, cell) for cell in printed if cell.differs)
    lines = [textwrap.fill(f"- {text[:1].upper()}{text[1:]}.", 118, subsequent_indent="  ") for text in reasons if text]
    return "\n".join([*parts, "\n".join(lines or ["No cell differs."]) + "\n"])


def block(cells: list[Cell]) -> str:
    """Cells of one reading of the source as a table, its shorter side across.

    Args:
        cells: some.

    Returns:
        Markdown.
    """
    keys = [(cell.row, cell.column) for cell in cells]
    down, across = (list(dict.fromkeys(key[i] for key in keys)) for i in (0, 1))
    if turned := len(across) > len(down):
        down, across = across, down
    by = {(cell.column, cell.row) if turned else (cell.row, cell.column): text(cell, cells) for cell in cells}
    lines = ["| | " + " | ".join(across) + " |", "|---" * (len(across) + 1) + "|"]
    lines += [f"| {row} | " + " | ".join(by.get((row, column), "") for column in across) + " |" for row in down]
    return "\n".join(lines) + "\n"


def summary(cells: list[Cell]) -> str:
    """How far the cells of a large block agree; those that differ by more than one in their last digit are listed."""
    differing = [cell for cell in cells if cell.differs]
    far = [cell for cell in differing if abs(cell.computed - float(cell.printed)) > 1.5 * 10.0 ** -decimals(cell)]
    words = f"{len(cells):,} cells compared; {len(differing) - len(far)} differ by one in their last digit"
    words += f", {len(far)} by more:" if far else "."
    return textwrap.fill(words, 118) + "\n" + (f"\n{block(far)}" if far else "")


def decimals(cell: Cell) -> int:
    """Number of decimals that are printed."""
    return len(cell.printed.partition(".")[2])


def choices(name: str) -> str:
    """How the proportions of Table 3.3 or 3.4 depend on the arcs and the values of beta-hat that are tried."""
    source = {"3.3": chapter_3.PRINTED, "3.4": table_3_4.PRINTED}[name]
    printed = [cells[2] if name == "3.3" else cells for cells in source.values()]
    parts = [f"## Table {name}: what was tried\n\n" + textwrap.fill(CHOICES_WORDS, 118) + "\n"]
    for amplitude in AMPLITUDES:
        lines = ["| p up to | values | " + " | ".join(source) + " |", "|---" * (len(source) + 2) + "|"]
        lines.append("| printed | | " + " | ".join(printed) + " |")
        for most, values in itertools.product(LARGEST_ARCS, NUMBERS_OF_VALUES):
            cells = cspr_jax.table(name, amplitude=amplitude, max_arcs=most, values=values, workers=None)
            shares = [f"{cell.computed:.1f}" for cell in cells if cell.column == "proportion"]
            lines.append(f"| {most} | {values} | " + " | ".join(shares) + " |")
            sys.stderr.write(f"{amplitude} {lines[-1]}\n")
        parts.append(f"*amplitude = {amplitude} 0.1; definition = scan*\n\n" + "\n".join(lines) + "\n")
    return "\n".join(parts)


def text(cell: Cell, cells: list[Cell]) -> str:
    """Published and computed number of a cell."""
    both = f"{cell.printed} / {computed_text(cell, cells)}"
    return f"**{both}**" if cell.differs else both


def main(names: list[str]) -> None:
    """Compute tables, and replace their sections."""
    known = re.split(r"^(?=## )", PAGE.read_text("utf-8"), flags=re.MULTILINE)[1:] if PAGE.exists() else []
    sections, tables = {}, [name for name in cspr_jax.list_tables() if name != "peers"]
    for own in known:
        name, tried = re.match(r"## Table ([^\s:]+)(: what was tried)?", own).groups()
        sections[f"choices-{name}" if tried else name] = own
    for name in names or tables:
        sections[name] = choices(CHOICES[name]) if name in CHOICES else section(name, cspr_jax.table(name))
    PAGE.write_text(
        "\n".join([HEAD, *(sections[name].strip() + "\n" for name in (*tables, *CHOICES) if name in sections)]),
        "utf-8",
    )


if __name__ == "__main__":
    main(sys.argv[1:])
