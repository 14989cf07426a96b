"""The lowest versions that pyproject.toml allows, as constraints for pip: `python tests/lowest.py`."""

import re
import sys
import tomllib
from pathlib import Path

PROJECT = Path(__file__).parent.parent / "pyproject.toml"


def lowest(requirements: list[str]) -> list[str]:
    """Constraints that pin each requirement to its lower bound; those without one, and the package itself, are none."""
    bounds = (re.fullmatch(r"([A-Za-z0-9_.-]+)(?:\[.*\])?>=([0-9.]+)", one.replace(" ", "")) for one in requirements)
    return [f"{bound[1]}=={bound[2]}" for bound in bounds if bound]


if __name__ == "__main__":
    project = tomllib.loads(PROJECT.read_text("utf-8"))["project"]
    needed = project["dependencies"] + [
        one for name, own in project["optional-dependencies"].items() if name != "test" for one in own
    ]
    sys.stdout.write("\n".join(lowest(needed)) + "\n")
