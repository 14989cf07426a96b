"""Run the notebooks of the gallery from their beginning, and compare what they print with what they show.

python docs/gallery/run.py                  all of them, as `make gallery` does
python docs/gallery/run.py throwing         one of them
python docs/gallery/run.py --store          keep what they print and draw, in place of what they show
"""

import argparse
import re
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

HERE = Path(__file__).parent
SECONDS = 600  # of a cell, on a machine that has other work too
TOGETHER = 2  # notebooks at a time: much of each is compiling, on one core
# Other processors and versions may change last digits, and what a random search finds a little more.
TOLERANCE = 0.03
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def printed(notebook: nbformat.NotebookNode) -> list[str]:
    """Text that each cell of code prints."""
    return [
        "".join(output.text for output in cell.outputs if output.output_type == "stream" and output.name == "stdout")
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def alike(first: str, second: str) -> bool:
    """Whether two texts have the same words, and nearly the same numbers."""
    if NUMBER.sub("#", first).split() != NUMBER.sub("#", second).split():
        return False
    for one, other in zip(NUMBER.findall(first), NUMBER.findall(second), strict=True):
        digits = max(len(text.partition(".")[2]) for text in (one, other))
        if abs(float(one) - float(other)) > TOLERANCE * abs(float(one)) + 10.0**-digits:
            return False
    return True


def run(path: Path, *, store: bool) -> list[str]:
    """Run one notebook.

    Args:
        path: of the notebook.
        store: whether to keep its outputs.

    Returns:
        what is wrong, one text each.
    """
    shown = nbformat.read(path, as_version=4)
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        own = {"resources": {"metadata": {"path": folder}}, "extra_arguments": ["--log-level=ERROR"]}
        client = NotebookClient(notebook, timeout=SECONDS, kernel_name="python3", **own)
        try:
            client.execute()
        except CellExecutionError as error:
            return [str(error)]
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # its times
    if store:
        nbformat.write(notebook, path)
        return []
    pairs = zip(printed(shown), printed(notebook), strict=True)
    return [f"it shows\n{one}\nbut now prints\n{other}" for one, other in pairs if not alike(one, other)]


def timed(name: str, *, store: bool) -> tuple[list[str], float]:
    """Run one notebook.

    Args:
        store: whether to keep its outputs.

    Returns:
        what is wrong, and how many seconds it took.
    """
    began = time.monotonic()
    return run(HERE / f"{name}.ipynb", store=store), time.monotonic() - began


def main() -> int:
    """Run the notebooks that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of a notebook; none: all of them")
    parser.add_argument("--store", action="store_true")
    options = parser.parse_args()
    every, faults = sorted(path.stem for path in HERE.glob("*.ipynb")), 0
    if unknown := sorted({*options.names} - {*every}):
        parser.error(f"no notebook {unknown[0]}: there are {', '.join(every)}")
    names = options.names or every
    with ProcessPoolExecutor(TOGETHER) as pool:
        for name, (wrong, seconds) in zip(names, pool.map(partial(timed, store=options.store), names), strict=True):
            print(f"{name}: {'failed' if wrong else 'runs'}, {seconds:.0f} s", flush=True)
            for text in wrong:
                print(text, file=sys.stderr)
            faults += len(wrong)
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
