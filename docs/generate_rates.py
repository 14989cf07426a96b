"""The page of rates over time and its picture, from benchmarks/history.jsonl."""

import json
from pathlib import Path

from matplotlib.figure import Figure

HISTORY = Path(__file__).parents[1] / "benchmarks" / "history.jsonl"
HEAD = """# Rates over time

`make bench-record` measures on the machine where it is called, and appends a line to `benchmarks/history.jsonl`, from
which this page is built. Rates are million checks a second. Ratios are to NumPy in the same run, and carry over to
other machines better than rates; on a shared host single figures vary by 15 % and more.
[Performance](../performance.md#checks) says what a check is, and what limits it.

![Checks a second over those of NumPy in the same run, by commit.](rates.png)

| date | commit | processor, cores | jax | six cables float32 / float64 | x NumPy | three cables float32 / float64 | x NumPy |
|---|---|---|---|---|---|---|---|
"""
KINDS = {"six_cable": "checks_per_second", "three_cable": "three_cable"}


def row(record: dict) -> str:
    """One line of the table."""
    cells = [record["date"], record["commit"], f"{record['processor']}, {record['cores']}", record["jax"]]
    for kind, key in KINDS.items():
        cells.append(" / ".join(f"{float(f'{record[key][dtype] / 1e6:.3g}'):,g}" for dtype in ("float32", "float64")))
        cells.append(" / ".join(f"{record['ratio_to_numpy'][kind][dtype]:.3g}" for dtype in ("float32", "float64")))
    return f"| {' | '.join(cells)} |\n"


def picture() -> Figure:
    """Ratios to NumPy by commit."""
    records = _records()
    figure = Figure(figsize=(6.8, 3.6), layout="constrained")
    panel = figure.add_subplot()
    for kind, words in (("six_cable", "six cables"), ("three_cable", "three cables")):
        for dtype, style in (("float32", "-o"), ("float64", "--s")):
            values = [record["ratio_to_numpy"][kind][dtype] for record in records]
            panel.plot(range(len(records)), values, style, label=f"{words}, {dtype}")
    panel.set_xticks(range(len(records)), [f"{r['commit']}\n{r['date']}" for r in records])
    panel.set(ylabel="checks a second, over NumPy's", xlim=(-0.5, len(records) - 0.5))
    panel.set_ylim(bottom=0.0)
    panel.grid(alpha=0.3)
    figure.legend(loc="outside right upper")
    return figure


def page_text() -> str:
    """The page."""
    return HEAD + "".join(map(row, _records()))


def _records() -> list[dict]:
    return [json.loads(line) for line in HISTORY.read_text("utf-8").splitlines()]
