"""Durations of lines before they are proved: by formulas where these hold, else by search."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.families.lines import s_model as fastest
from cspr_jax.families.lines.any_limits import least_by_search
from cspr_jax.families.lines.faces import line_faces, sides
from cspr_jax.families.lines.lower_bounds import least_durations
from cspr_jax.families.lines.motion import fixed_law
from cspr_jax.families.lines.slacks import LineSlacks, line_slacks
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PointMassRobot, in_one_plane, plane_normal
from cspr_jax.robots.statics.wrench_sets import spanning
from cspr_jax.schema.limits import LIMITS

BATCH, BATCH_OF_SEARCH = 4096, 16
Rule = Literal["optimum", "thesis"]
# Names of limits on the motion of the effector, not on its position.
MOVING = tuple(limit.name for limit in LIMITS if limit.of_motion)


@dataclasses.dataclass(frozen=True)
class Durations:
    """Durations of n lines, (n,) each.

    Fields:
        duration: T, s; not finite where there is no motion.
        ratio: p / T.
        lower_bound: lower bound of the time of any motion along the line, s; 0 where none is proved.
        rest: smaller margin of rest at the two ends, m/s^2.
        depth: smaller depth of the two ends below the plane of the spools, m; inf if the spools have no common plane.
        is_bounded: whether anything bounds the acceleration.
        up: index, in `names_of`, of the bound that limits the acceleration.
        down: index of the bound that limits the braking.
    """

    duration: np.ndarray
    ratio: np.ndarray
    lower_bound: np.ndarray
    rest: np.ndarray
    depth: np.ndarray
    is_bounded: np.ndarray
    up: np.ndarray
    down: np.ndarray

    def part(self, indices: Int[np.ndarray, "n"]) -> "Durations":
        """Durations of some of the lines."""
        return Durations(**{name: value[indices] for name, value in vars(self).items()})

    def replace(self, indices: np.ndarray, part: "Durations") -> None:
        """Replace the durations of some of the lines."""
        for name, values in vars(part).items():
            getattr(self, name)[indices] = values


def moving(limits: Limits) -> tuple[str, ...]:
    """Names of the given limits on the motion of the effector, not on its position."""
    limit_names = [name for name in MOVING if getattr(limits, name) is not None]
    return tuple(name for name in limit_names if name != "tension_min" or np.asarray(limits.tension_min).any())


def names_of(robot: PointMassRobot, limits: Limits) -> tuple[str, ...]:
    """Names of the bounds along a line."""
    chosen = spanning(robot.n_cables, robot.dof) + 1
    cables = ("cables " + ", ".join(map(str, cables_of_face)) for cables_of_face in chosen.tolist())
    return (*cables, "max_acceleration", *moving(limits))


def by_formula(
    robot: PointMassRobot,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    *,
    law: str,
    rule: Rule,
    max_acceleration: float,
) -> Durations:
    """Least durations along straight lines if only taut cables and the largest acceleration limit them."""
    in_plane, largest = in_one_plane(robot), np.full(len(starts), float(max_acceleration))
    kernel = partial(_by_formula, robot, law=law, rule=rule, in_plane=in_plane)
    minimum, bound, rest, depth, is_bounded = in_batches(kernel, (starts, ends, largest), batch_size=BATCH)
    duration = minimum.duration * (1.0 + fastest.LONGER) if in_plane else np.full(len(starts), np.nan)
    fields = (duration, minimum.ratio, bound, rest, depth, is_bounded, minimum.up, minimum.down)
    return Durations(*(np.array(x) for x in fields))


@jax.jit
def _lines(problem: Problem, arguments) -> LineSlacks:
    return jax.vmap(partial(line_slacks, problem))(*arguments)


def lines_of(problem: Problem, starts: Float[np.ndarray, "n 3"], ends: Float[np.ndarray, "n 3"]) -> LineSlacks:
    """Coefficients of slacks along lines."""
    return in_batches(partial(_lines, problem), (starts, ends), batch_size=BATCH)


def by_cells(
    problem: Problem, starts: Float[np.ndarray, "n 3"], ends: Float[np.ndarray, "n 3"], max_acceleration: float
) -> Float[np.ndarray, "n"]:
    """Lower bounds of the duration of any motion along lines, also under limits of tensions and cables."""
    largest = max_acceleration / np.linalg.norm(ends - starts, axis=1)
    return least_durations(lines_of(problem, starts, ends), largest)


def by_search(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    timings: Durations,
    *,
    law: str,
    max_acceleration: float,
) -> Durations:
    """Least durations along straight lines under any limits, with spools in any layout."""
    moving_problem = problem._replace(
        limits=Limits(**{name: getattr(problem.limits, name) for name in moving(problem.limits)})
    )
    largest = np.full(len(starts), float(max_acceleration))
    minimum = in_batches(
        partial(_by_search, moving_problem, law=law), (starts, ends, largest), batch_size=BATCH_OF_SEARCH
    )
    numbers = _bound_numbers(moving_problem)
    return dataclasses.replace(
        timings, duration=minimum.duration, ratio=minimum.ratio, up=numbers[minimum.up], down=numbers[minimum.down]
    )


@partial(jax.jit, static_argnames=("rule", "law", "in_plane"))
def _by_formula(robot: PointMassRobot, arguments, *, law: str, rule: str, in_plane: bool):
    def one(start, end, largest):
        faces = line_faces(robot, start, end, in_plane=in_plane)
        bounds = sides(faces, largest / jnp.linalg.norm(end - start))
        if law != "s-curve":
            minimum = fastest.least_of_law(fixed_law(law), bounds)
        elif rule == "optimum":
            minimum = fastest.least_s_curve(bounds)
        else:
            minimum = fastest.thesis_s_curve(bounds)
        norms = jnp.stack([jnp.linalg.norm(faces.normal + t * faces.normal_change, axis=1) for t in (0.0, 1.0)])
        resting = -jnp.stack([faces.offset, faces.offset + faces.offset_change]) / jnp.where(norms > 0.0, norms, 1.0)
        there = faces.bounds[None] & jnp.stack([faces.first <= 0.0, faces.last >= 1.0])
        rest = minimum_of(jnp.where(there, resting, jnp.inf))
        is_bounded = jnp.isfinite(bounds.up).any() & jnp.isfinite(bounds.down).any()
        if not in_plane:
            return minimum, fastest.least_time(bounds, everywhere=False), rest, jnp.asarray(jnp.inf), is_bounded
        depth = jnp.minimum(plane_normal(robot) @ start, plane_normal(robot) @ end)
        return minimum, fastest.least_time(bounds), rest, depth, is_bounded & faces.bounds.any()

    return jax.vmap(one)(*arguments)


def _fixed(law: str) -> Amplitude | None:
    return None if law == "s-curve" else fixed_law(law)


@partial(jax.jit, static_argnames=("law",))
def _by_search(problem: Problem, arguments, *, law: str):
    def one(start, end, largest):
        line = line_slacks(problem, start, end)
        return least_by_search(line, largest / jnp.linalg.norm(end - start), _fixed(law))

    return jax.vmap(one)(*arguments)


def _bound_numbers(problem: Problem) -> np.ndarray:
    # Return the index in `names_of` of each slack that can bound a search, see `any_limits.Gain`; each face has two
    # sides.
    robot, names = problem.robot, names_of(problem.robot, problem.limits)
    faces, limit_names = 2 * len(spanning(robot.n_cables, robot.dof)), moving(problem.limits)
    counts = {"tension_min": faces, "tension_max": faces, "cable_speed_max": robot.n_cables}
    counts |= {"cable_acceleration_max": 2 * robot.n_cables, "speed_max": 1, "acceleration_max": 2}
    numbers = [np.tile(np.arange(faces // 2), 2)]
    for name, count in counts.items():
        if name in limit_names:
            numbers.append(np.full(count, names.index(name)))
        elif name.startswith("tension"):
            numbers.append(np.full(count, -1))  # a tension without a limit shifts no face
    return np.concatenate([*numbers, [names.index("max_acceleration")]])
