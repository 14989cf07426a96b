"""Poses that no motion can reach: refused before the search."""

import dataclasses
import functools
import operator

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.families.free.problem import planned_problem
from cspr_jax.maps.proved_map import CONTACTS
from cspr_jax.motion.cause import Cause
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.proved_answers import proved_answers

# Criteria on positions: if a pose breaks one, so does every motion to it. A pose at rest must meet all criteria.
_OF_POSITIONS = (CONTACTS, Verdict.ABOVE_SPOOLS, Verdict.BELOW_FLOOR, Verdict.CABLE_TOO_LONG)
OF_POSITIONS = functools.reduce(operator.or_, _OF_POSITIONS)


def first_refused(problem: Problem, scene: Scene | None, poses: FreePoses, frame: Frame) -> tuple[int, Cause] | None:
    """The first pose that no motion can reach, with the cause; None if there is none."""
    units = [None] * len(poses.positions) if poses.quaternions is None else list(poses.quaternions)
    at_rest = [
        Spline(
            as_float64(np.array([0.0, 1.0])),
            as_float64(position[None, None]),
            None if unit is None else as_float64(unit[None, None]),
        )
        for position, unit in zip(poses.positions, units, strict=True)
    ]
    answers = proved_answers(planned_problem(problem), at_rest, scene)
    for i in range(len(at_rest)):
        rests = not (poses.accelerations[i].any() or poses.velocities[i].any())
        causes = answers.causes_of(i, frame) if answers.proof[i].broken.any() else ()
        for cause in causes:
            if rests or Verdict[cause.criterion.upper()] & OF_POSITIONS:
                return i, dataclasses.replace(cause, t=np.nan)
    return None
