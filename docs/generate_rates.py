"""Write docs/rates.md and its picture from benchmarks/history.jsonl: python docs/generate_rates.py."""

import json
from pathlib import Path

from matplotlib.figure import Figure

HERE = Path(__file__).parent
HISTORY = HERE.parent / "benchmarks" / "history.jsonl"
HEAD = """# Rates over time

Do not edit: written by `make bench-record`, which measures on the machine where it is called and appends a line to
`benchmarks/history.jsonl`. Rates are million checks a second. Ratios are to NumPy in the same run, and carry over to
other machines better than rates; on a shared host single figures vary by 15 % and more.
[Performance](performance.md#a-check) says what a check is, and what limits it.

![Checks a second over those of NumPy in the same run, by commit.](rates.png)

| date | commit | processor, cores | jax | six cables float32 / float64 | x NumPy | three cables float32 / float64 | x NumPy |
|---|---|---|---|---|---|---|---|
"""
KINDS = {"six_cable": "checks_per_second", "three_cable": "three_cable"}


def row(record: dict) -> str:
    """One line of the table."""
    cells = [record["date"], record["commit"], f"{record['processor']}, {record['cores']}", record["jax"]]
    for kind, key in KINDS.items():
        cells.append(" / ".join(f"{record[key][dtype] / 1e6:.3g}" for dtype in ("float32", "float64")))
        cells.append(" / ".join(f"{record['ratio_to_numpy'][kind][dtype]:.3g}" for dtype in ("float32", "float64")))
    return f"| {' | '.join(cells)} |\n"


def picture(records: list[dict]) -> Figure:
    """Ratios to NumPy by commit."""
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


def main() -> None:
    """Write the page and its picture."""
    records = [json.loads(line) for line in HISTORY.read_text("utf-8").splitlines()]
    (HERE / "rates.md").write_text(HEAD + "".join(map(row, records)), "utf-8")
    picture(records).savefig(HERE / "rates.png", dpi=110)


if __name__ == "__main__":
    main()
