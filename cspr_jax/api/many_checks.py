"""Checks of many motions of one robot from Python."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cspr_jax.api.arguments.check_keys import NAME, check_keys
from cspr_jax.api.arguments.checks import LimitsOrSpec, RobotOrFile, checked
from cspr_jax.build.problems import build_problem
from cspr_jax.build.robots import build_robot
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.plan import checked_plan
from cspr_jax.config.robot import resolve_robot
from cspr_jax.curves.files import kept_to, placed_inward, reference_of, samples_of, source_spline
from cspr_jax.curves.spline import SplineBatch
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import Cables, ManyTimes, PointsOfMany, QuaternionsOfMany, VectorsOfMany
from cspr_jax.motion.cause import Cause
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.schema.columns import Columns
from cspr_jax.schema.families import FAMILIES
from cspr_jax.verification.attained import with_attained
from cspr_jax.verification.mean_torques import with_means_of_each
from cspr_jax.verification.proved_answers import answers_of, proofs_of, verify_all_robots


@dataclasses.dataclass(frozen=True)
class ManyChecks(Columns):
    """Checks of n motions of one robot.

    Fields:
        verdict: (n,) `Verdict` flags; 0 if proved feasible.
        duration: (n,) s.
        margin: (n,) smallest distance of a tension from its limits, N, as in `Check`.
        margin_bound: (n,) proved lower bound of the margin, N.
        limit_margin: (n,) smallest slack of other limits, over the limit; inf without other limits.
        failing: n arrays (m, 2) of intervals of time in which each motion fails, s.
        causes: for each motion the reasons why it is not feasible, the worst one first.
    """

    verdict: np.ndarray
    duration: np.ndarray
    margin: np.ndarray
    margin_bound: np.ndarray
    limit_margin: np.ndarray
    failing: list[np.ndarray]
    causes: list[tuple[Cause, ...]]

    @property
    def feasible(self) -> np.ndarray:
        """Tell which motions are proved feasible, (n,)."""
        return self.verdict == 0


@checked(motion="spline")
def check_many(  # noqa: PLR0913
    robot: RobotOrFile,
    times: ManyTimes,
    positions: PointsOfMany,
    quaternions: QuaternionsOfMany | None = None,
    *,
    velocities: VectorsOfMany | None = None,
    accelerations: VectorsOfMany | None = None,
    interpolation: Literal["cubic", "quintic", "hermite"] | None = None,
    ends: Literal["rest", "natural", "periodic"] | None = None,
    limits: LimitsOrSpec = None,
    without: Cables | None = None,
) -> ManyChecks:
    """Check many motions of one robot; see `check`.

    Args:
        robot: a robot, the name of one of the catalogue, or the path of a robot file.
        times: (n,) for all motions, or (k, n), increasing, s.
        positions: (k, n, 3) positions of the mass centre, in the axes of the robot, m.
        quaternions: (k, n, 4) orientations of the platform, scalar first; None: its own axes.
        velocities: (k, n, 3) m/s, for Hermite pieces.
        accelerations: (k, n, 3) m/s^2, for Hermite pieces.
        interpolation: "cubic", "quintic" or "hermite"; None: "hermite" if there are velocities, else "cubic".
        ends: "rest", "natural" or "periodic"; None: "rest".
        limits: replace those of the robot, as for `check`.
        without: cables that are gone, from 0 on, as for `check`.

    Returns:
        the checks.

    Raises:
        InputError: samples that do not define a motion, or an impossible argument.
    """
    settings: dict[str, Any] = {"interpolation": interpolation, "ends": ends}
    settings["without"] = None if without is None else [int(i) for i in without]
    spec = checked_plan(check_keys(robot, limits, **settings), NAME)
    samples_of_all = (positions, quaternions, velocities, accelerations)
    columns = [None if column is None else np.asarray(column) for column in samples_of_all]
    others = {"times": times, "quaternions": quaternions, "velocities": velocities, "accelerations": accelerations}
    count, rows = np.shape(positions)[:2]
    _check_shapes(count, rows, {name: np.shape(array) for name, array in others.items() if array is not None})
    sample_times = np.broadcast_to(np.asarray(times, float), (count, rows))
    with double_precision():
        file = as_moved(
            resolve_robot(spec.robot, NAME, Path(), spec.parameters), [FAMILIES["spline"].legs], spec.without, NAME
        )
        problem = build_problem(file, spec, spec, NAME, any_cables=True)
        axes = frame_of(file.base_points, file.z_axis)
        reference = reference_of(build_robot(file, spec, NAME))
        kind: dict[str, Any] = {"z_axis": file.z_axis, "is_platform": file.is_platform}
        kind |= {"interpolation": interpolation, "ends": ends}
        motions = []
        for i in range(count):
            samples = samples_of(sample_times[i], *(None if column is None else column[i] for column in columns))
            try:
                curve = kept_to(file.own_pattern, source_spline(samples, **kind), is_planar=False)
                motions.append(placed_inward(curve, axes, reference))
            except InputError as error:
                raise InputError(
                    f"motion {i}, {error.key}", error.value, error.allowed, problem=error.problem
                ) from error
        batch, scene = SplineBatch(motions), scene_of(problem.robot, file, axes, spec, NAME, trajectory=spec)
        proofs = proofs_of(problem, batch.bounds, batch.durations, scene, batch.jumps)
        proofs = with_means_of_each(problem, proofs, motions)
        answers = with_attained(problem, answers_of(proofs, batch.durations), motions, scene)
        verify_all_robots(problem, answers, motions, scene)
    names = ("verdict", "duration", "margin", "margin_bound", "limit_margin")
    arrays = {name: getattr(answers, name) for name in names}
    causes = [answers.causes_of(i, axes) for i in range(count)]
    return ManyChecks(**arrays, failing=[proof.failing for proof in answers.proof], causes=causes)


def _check_shapes(count: int, rows: int, shapes: dict[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        fitting = [(rows,), (count, rows)] if name == "times" else [(count, rows, shape[-1])]
        if shape not in fitting:
            shapes_in_words = " or ".join(map(str, fitting))
            words = f"must have shape {shapes_in_words}, as positions of {count} motions at {rows} times each"
            raise InputError(name, None, words, problem=f"shape {shape}")
