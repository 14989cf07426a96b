"""Formats of set points, one row each, by the ending of the file; set points of plans."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.machine.setpoints import SetPoints, set_points
from cspr_jax.outputs.setpoints import cyclic_table, joint_trajectory, plain_csv
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.schema.setpoints import LARGEST_RATE, SETPOINT_FORMATS
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish

LARGEST_NUMBERS = 10_000_000  # largest number of instants times axes
# Lines of each file, from set points, their rate in Hz and the counts of the encoders, if known.
LINES: dict[str, Callable[[SetPoints, float, np.ndarray | None], Iterator[str]]] = {
    ".csv": plain_csv.lines,
    ".yaml": joint_trajectory.yaml_lines,
    ".json": joint_trajectory.json_lines,
    ".txt": cyclic_table.lines,
}


def points_of(plan: PlannedMotions, rate: float) -> SetPoints:
    """Set points of a plan, feasible or not."""
    durations = plan.answers.duration
    if not 0.0 < rate <= LARGEST_RATE:
        raise ConfigError("--rate", f"{rate:g}: must be a number > 0, at most {LARGEST_RATE:g}, in Hz")
    if not np.isfinite(durations).all():
        raise ConfigError("--setpoints", "must be absent for a plan with a segment that has no motion; see its verdict")
    robot = plan.problem.robot
    if (rate * durations.sum() + 1.0) * robot.n_cables > LARGEST_NUMBERS:
        largest = LARGEST_NUMBERS // robot.n_cables
        raise ConfigError("--rate", f"{rate:g} Hz: must give at most {largest} set points of {robot.n_cables} axes")
    motions = [motion for leg in plan.legs for motion in leg.motions]
    return set_points(robot, plan.problem.limits, motions, durations, rate, plan.keys.tension_rule)


def write_set_points(plan: PlannedMotions, path: Path, rate: float) -> None:
    """Write the set points of a feasible plan."""
    if path.suffix not in SETPOINT_FORMATS:
        raise ConfigError(path, f"must end in {' or '.join(SETPOINT_FORMATS)}")
    if not plan.feasible:
        raise ConfigError(path, "not written, since a segment is not proved feasible: motors get proved motions alone")
    winches = plan.problem.robot.winches
    counts = None if winches is None or winches.encoder_counts is None else np.asarray(winches.encoder_counts)
    if path.suffix == ".txt" and counts is None:
        raise ConfigError(path, "needs winch.encoder_counts in the robot file: one number, or one per cable")
    points = points_of(plan, rate)
    if not all(np.isfinite(array).all() for array in points if array is not None):
        raise ConfigError(path, "not written: set points of this motion are not finite")
    text = "".join(f"{line}\n" for line in LINES[path.suffix](points, rate, counts))
    publish(Disk(), path, text.encode())
