"""Append the rates of `cspr bench` to benchmarks/history.jsonl, with the processor, the versions and the commit.

On an idle machine: `make bench-record`, from which the site has a page of rates.
"""

import datetime
import json
import subprocess
import sys
from pathlib import Path

from cspr_jax.sweep.environment import environment

HISTORY = Path(__file__).with_name("history.jsonl")
KEPT = (
    "checks_per_second",
    "three_cable",
    "workspaces",
    "ellipses",
    "ratio_to_numpy",
    "cores",
    "device",
    "machine",
    "flags",
    "jax",
)


def main() -> None:
    bench = [sys.executable, "-m", "cspr_jax", "bench", "--json"]  # with the flags of the command line
    report = json.loads(subprocess.run(bench, capture_output=True, text=True, check=True).stdout)
    words = ["git", "-C", str(HISTORY.parent), "describe", "--always", "--dirty"]
    commit = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    here = environment()
    about = {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "commit": commit,
        "processor": here["cpu_model"],
        "version": here["version"],
        "python": here["python"],
        "numpy": here["numpy"],
    }
    with HISTORY.open("a", encoding="utf-8") as file:
        file.write(json.dumps(about | {name: report[name] for name in KEPT}) + "\n")
    print(f"{HISTORY}: {commit}, {about['processor']}")


if __name__ == "__main__":
    main()
