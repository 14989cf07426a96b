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
# Why computed cells differ from the printed ones.
REASONS = {
    "1.1": "No cell differs.",
    "1.2": "The printed inclination of A1 is the best for 1,001 samples of time; the number of oscillations is flat "
    "there and differs by 1e-6 only, while n at the opposite inclination changes with it. A2 at v = 0 is 1.19: the "
    "printed cell is a misprint.",
    "1.3": "The caption names a distance whose w_max is 10; the printed numbers belong to 5 sqrt(3), a distance along "
    "H_0. Both are computed. The printed epsilon of A_eff, 0.0399, cannot give the printed n; 0.0599 does.",
    "2.1": "No cell differs.",
    "3.2": "The text names the quintic amplitude function; with it the printed numbers of arcs are not feasible in "
    "four segments. The piecewise function of chapter 1, (1.110), and its smooth relative give all of them but one, "
    "for which they need fewer arcs than printed. Pose 2 as printed, with a torsion of pi/2, can neither be reached "
    "nor left with the printed arcs; with pi/3 it can.",
    "3.3": "The number of accessible orientations depends on how they are counted, and no reading of the text "
    "gives the printed counts "
    "([definitions](theory.md#orientations-accessible-attainable-chapter-3-sections-310-and-3123)). The proportions "
    "depend on the amplitude function, see Table 3.2.",
    "3.4": "The reasons are those of Table 3.3.",
    "4.1": "The two imaginary solutions are printed with the sign of p exchanged.",
    "4.2": "No reading gives all eight numbers: -1.752 follows from the printed T and p, of three decimals, and 0.896 "
    "from exact ones.",
    "4.3": "The source must have rounded the boundaries to five decimals: so rounded, all 1,240 numbers of the grid "
    "agree. The other cell that differs is the optimum T that the source's text names, 4.35 s: it contradicts the "
    "source's own table, where the first node without overshoot is 4.40 s.",
}
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
    return "\n".join([*parts, textwrap.fill(REASONS[name], 118, break_long_words=False) + "\n"])


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
    sections = {}
    for own in known:
        name, tried = re.match(r"## Table ([^\s:]+)(: what was tried)?", own).groups()
        sections[f"choices-{name}" if tried else name] = own
    for name in names or REASONS:
        sections[name] = choices(CHOICES[name]) if name in CHOICES else section(name, cspr_jax.table(name))
    PAGE.write_text(
        "\n".join([HEAD, *(sections[name].strip() + "\n" for name in (*REASONS, *CHOICES) if name in sections)]),
        "utf-8",
    )


if __name__ == "__main__":
    main(sys.argv[1:])
