"""Table 3.2 of the thesis: arcs and durations of the sequence of poses of Table 3.1."""

import copy
import math
from pathlib import Path
from typing import Any

from cspr_jax.config.plan import PlanFile
from cspr_jax.config.reading import checked, read_toml
from cspr_jax.plans.planning import plan_of
from cspr_jax.published.chapter_1 import Key
from cspr_jax.runtime.stages import within

SEQUENCE = Path(__file__).with_name("table_3_2.toml")
# The text names the quintic; the numbers fit the others. The epsilon used is not printed.
_AMPLITUDES: dict[str, Any] = {
    "quintic": "quintic",
    "effective 0.1": {"name": "effective", "epsilon": 0.1},
    "effective-c3 0.1": {"name": "effective-c3", "epsilon": 0.1},
}
# Torsion of pose 2: with the printed one, neither of its segments has a feasible number of arcs.
_TORSIONS = {"pi/3": math.pi / 3.0, "pi/2 (printed)": math.pi / 2.0}
_POSE = 2


def _variant(amplitude: str, torsion: str) -> str:
    return f"amplitude = {amplitude}; pose_2 = {torsion}"


def table_3_2() -> dict[Key, float | None]:
    """Arcs and durations with the printed beta-hat, for three amplitude functions and two readings of pose 2."""
    data, cells = read_toml(SEQUENCE), dict[Key, float | None]()
    for number, (amplitude, key) in enumerate(_AMPLITUDES.items()):
        segments: dict[int, tuple[float | None, float | None]] = {}
        for torsion, angle in _TORSIONS.items():
            changed = copy.deepcopy(data)
            changed["amplitude"] = key
            changed["pose"][_POSE]["tilt_torsion"][2] = angle
            # Only the segments at pose 2 differ, since a segment depends on its two poses alone.
            first = _POSE - 1 if segments else 0
            changed["pose"] = changed["pose"][first : _POSE + 2] if segments else changed["pose"]
            with within(f"{amplitude} ({number + 1} of {len(_AMPLITUDES)}), pose 2 {torsion}"):
                answers = plan_of(checked(PlanFile, changed, SEQUENCE), SEQUENCE).answers
            segments |= {
                first + i: (float(arcs), float(answers.duration[i])) if arcs > 0 else (None, None)
                for i, arcs in enumerate(answers.arcs)
            }
            for i, numbers in segments.items():
                for column, value in zip(("p", "T"), numbers, strict=True):
                    cells[str(i), column, _variant(amplitude, torsion)] = value
    return cells


_PRINTED = {
    "0": ("8", "9.4944"),
    "1": ("9", "10.6739"),
    "2": ("9", "10.6740"),
    "3": ("12", "14.2291"),
    "4": ("9", "10.6732"),
    "5": ("13", "15.4236"),
    "6": ("4", "4.7472"),
}
PUBLISHED: dict[Key, str] = {
    (row, column, _variant(amplitude, torsion)): value
    for amplitude in _AMPLITUDES
    for torsion in _TORSIONS
    for row, values in _PRINTED.items()
    for column, value in zip(("p", "T"), values, strict=True)
}
