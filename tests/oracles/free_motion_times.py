"""Times of the cases, and accelerations at nodes of motions that meet them, as ipopt found them: read without casadi.

Made in half an hour, with casadi installed (`pip install 'cspr_jax[peers]'`), by

    PYTHONPATH=tests python -m oracles.free_motion_times [name of a case ...]

which leaves all other cases as they are.
"""

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np

from . import free_motion_bounds, free_motion_cases, free_motions

FILE = Path(__file__).with_suffix(".json")
# Of "3R3T-7 0 outside" other meshes end at other minima, 6 % apart: nothing to compare with.
NAMES = [f"segment {k}" for k in range(8)] + [f"{k} 0 inside" for k in free_motion_cases.KINDS]
NAMES += [f"{k} {int(k == '3R3T-7')} outside" for k in free_motion_cases.KINDS]


@dataclasses.dataclass(frozen=True)
class Reference:
    """What is known of the least time of a case, s.

    below: proved to be less than all times. infimum: estimate for ever finer meshes. time: of the motion. agreeing:
    starts that ended within 0.1 % of the best one, of `starts`.
    """

    case: free_motion_cases.Case
    below: float
    infimum: float
    time: float
    agreeing: int
    starts: int
    motion: object


def case_of(name):
    """The case of a name."""
    kind, number, *where = name.split()
    if kind == "segment":
        return free_motion_cases.segment(int(number))
    return free_motion_cases.case(kind, int(number), where == ["outside"])


def reference(name):
    """Reference of a case of `NAMES`."""
    case, known = case_of(name), dict(json.loads(FILE.read_text("utf-8"))[name])
    sides = case.robot, case.start, case.end, known["time"]
    nodes = free_motions.integrated(*sides, known.pop("accelerations"))
    return Reference(case, motion=free_motions.motion(*sides, nodes), **known)


def made(name):
    """What the file holds of a case."""
    case, is_fine = case_of(name), name.startswith("segment")
    sides = case.robot, case.limits, case.start, case.end
    answer = free_motions.least_time(*sides, steps=(40, 80) if is_fine else (20, 40), count=8 if is_fine else 6)
    starts = np.array(answer.starts)
    return {
        "below": float(f"{0.9999 * free_motion_bounds.least(*sides):.5g}"),
        "infimum": float(f"{answer.infimum:.7g}"),
        "time": float(answer.time),
        "agreeing": int(np.sum(starts < 1.001 * starts.min())),
        "starts": len(starts),
        "accelerations": [[float(f"{x:.9g}") for x in row] for row in answer.nodes[2]],
    }


if __name__ == "__main__":
    known = json.loads(FILE.read_text("utf-8")) if FILE.exists() else {}
    for name in sys.argv[1:] or NAMES:
        known[name] = made(name)
        print(name, {k: v for k, v in known[name].items() if k != "accelerations"}, flush=True)
        lines = [f"{json.dumps(n)}: {json.dumps(known[n], separators=(',', ':'))}" for n in NAMES if n in known]
        FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
