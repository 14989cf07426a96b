"""Names of half-planes of a path: which limit each of them is, and of which cable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cspr_jax.families.paths.least_time.constraints import TANGENTS, face_count, unit_wrenches
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_sets import spanning
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import Verdict

if TYPE_CHECKING:
    from jaxtyping import Float

FLAGS = {row.name: row.flag for row in LIMITS}
# Flag of a criterion, and its cable from 0 on, or None.
RowName = tuple[Verdict, int | None]


def row_names(
    problem: Problem, state: State, u: Float[np.ndarray, "n_rows"], x: Float[np.ndarray, "n_rows"]
) -> list[RowName]:
    """Names of the half-planes of one place, in the order of `families.paths.least_time.constraints.path_rows`."""
    robot, limits = problem.robot, problem.limits
    names = _of_faces(problem, state, np.stack([u, x], axis=1))
    if limits.cable_acceleration_max is not None:
        names += [(Verdict.CABLE_OVER_ACCELERATION, k) for k in range(robot.n_cables)] * 2
    if getattr(limits, "acceleration_max", None) is not None:
        names += [(FLAGS["acceleration_max"], None)] * (TANGENTS + 1)
    return names


def _of_faces(problem: Problem, state: State, shares: np.ndarray) -> list[RowName]:
    # On as many cables as degrees of freedom all cables but one span a face, on which the tension of that one is the
    # smallest where the half-plane has it with the other sign, else the largest.
    robot = problem.robot
    count = face_count(robot)
    if robot.n_cables > robot.dof:
        return [(Verdict.WRENCH_INFEASIBLE, None)] * count
    parts = unit_wrenches(robot, state)
    tensions = np.linalg.solve(parts.matrix, np.stack([parts.momentum, parts.second_derivative], axis=1))
    beside = [set(range(robot.n_cables)) - set(chosen) for chosen in spanning(robot.n_cables, robot.dof).tolist()]
    cables = [cable for others in beside for cable in others] * 2
    is_least = [tensions[cable] @ fraction < 0.0 for cable, fraction in zip(cables, shares, strict=False)]
    return [
        (Verdict.SLACK_CABLE if minimum else Verdict.OVER_TENSION, cable)
        for minimum, cable in zip(is_least, cables, strict=True)
    ]
