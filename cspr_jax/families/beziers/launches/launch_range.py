"""Range of launches: for each landing point, the release and the Bezier segment from rest that reach it.

Unknowns are the position of release, the time of flight, the duration of the segment, and the time of release on it.
All else follows: the velocity of release (26), the control point and the end of the segment (29).
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.beziers.launches.release import ReleaseBounds, through
from cspr_jax.families.beziers.margins import depths_of
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.families.beziers.sequences import margins_of
from cspr_jax.families.beziers.verdicts import BATCH, smallest_slacks, verdicts
from cspr_jax.launch.flight import aimed
from cspr_jax.maps.releases import Releases
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import minimum_of
from cspr_jax.numerics.search.differential_evolution import evolved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.schema.verdicts import FLAGS

UNKNOWNS, POPULATION = 6, 64
# Margins that the launch of least speed must keep in the search. Those of taut cables are exact; those of limits are
# only sampled in the search and proved later, so they are larger.
EXACT = (1e-6,)
SAMPLED = (1e-3, 1e-2)
SAMPLES = 33
# Number of landing points whose answers are computed at a time.
TOGETHER = 512


class LaunchRequirement(NamedTuple):
    """Starts and targets of n launches, in the kernels' coordinates.

    Fields:
        start: (n, 3) where the segment starts at rest, m.
        target: (n, 3) where the object is to land, m.
        z0: (n,) depth at which slacks are normalised, m.
    """

    start: Any
    target: Any
    z0: Any


class Shot(NamedTuple):
    """A launch.

    Fields:
        position: (3,) of the release, m.
        velocity: (3,) there, m/s.
        flight_time: () time of flight, s.
        fraction: () time of release over the duration of the segment.
        motion: the segment on which the object is released.
    """

    position: Any
    velocity: Any
    flight_time: Any
    fraction: Any
    motion: Bezier


@dataclasses.dataclass(frozen=True)
class LaunchRange(Releases):
    """Launches to n landing points by one Bezier segment each; see `Releases`.

    A verdict of 0 says that the segment is proved feasible. Any other verdict is that of the segment with the largest
    margin found; it does not exclude other segments. Margins are the smallest slacks of taut cables, depth and limits.

    Fields:
        duration: (n,) of the segment, s.
        release_time: (n,) of the release, after the start of the segment, s.
    """

    duration: np.ndarray
    release_time: np.ndarray


def _shot(problem_and_bounds: tuple[Problem, ReleaseBounds], question: LaunchRequirement, x: Array) -> Shot:
    problem, bounds = problem_and_bounds
    unknowns = bounds.low + (bounds.high - bounds.low) * x
    position, (flight, duration), fraction = unknowns[:3], jnp.exp(unknowns[3:5]), unknowns[5]
    velocity = aimed(position, question.target, problem.robot.gravity, flight)
    middle, end = through(question.start, position, velocity, fraction, duration)
    return Shot(position, velocity, flight, fraction, Bezier(question.start, middle, end, duration, question.z0))


def _energy(
    problem_and_bounds: tuple[Problem, ReleaseBounds], question: LaunchRequirement, x: Array
) -> tuple[Array, Array]:
    # Return the kinetic energy at the release over weight and radius of the robot, and the smallest margin.
    robot, shot = problem_and_bounds[0].robot, _shot(problem_and_bounds, question, x)
    margins = margins_of(problem_and_bounds[0], jax.tree.map(lambda x: jnp.asarray(x)[None], shot.motion), SAMPLES)
    return 0.5 * jnp.sum(shot.velocity**2) / (robot.gravity * spool_radius(robot)), minimum_of(margins)


@jax.jit
def _shots(problem_and_bounds: tuple[Problem, ReleaseBounds], cases: tuple[LaunchRequirement, Array]) -> Shot:
    return jax.vmap(lambda question, x: _shot(problem_and_bounds, question, x))(*cases)


def launch_range(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    targets: Float[np.ndarray, "n 3"],
    bounds: ReleaseBounds,
    population: int = POPULATION,
) -> LaunchRange:
    """Launches of least speed to landing points, and the largest margins."""
    question = LaunchRequirement(starts, targets, depths_of(problem.robot, starts))
    margins = (np.inf, *(SAMPLED if limits_set(problem.limits) else EXACT))
    unknowns = evolved(_energy, (problem, bounds), question, unknowns=UNKNOWNS, margins=margins, population=population)
    parts = [slice(i, i + TOGETHER) for i in range(0, len(starts), TOGETHER)]
    answers = [
        _answers((problem, bounds), jax.tree.map(lambda x, s=chunk: x[s], (question, unknowns))) for chunk in parts
    ]
    return LaunchRange(**{name: np.concatenate([vars(part)[name] for part in answers]) for name in vars(answers[0])})


def _answers(
    problem_and_bounds: tuple[Problem, ReleaseBounds], cases: tuple[LaunchRequirement, np.ndarray]
) -> LaunchRange:
    # Make one candidate for every landing point and margin; the margin is the index that changes fastest.
    count, n_margins, _ = cases[1].shape
    question = jax.tree.map(lambda x: np.repeat(x, n_margins, axis=0), cases[0])
    shots = in_batches(
        lambda batch: _shots(problem_and_bounds, batch),
        (question, cases[1].reshape(count * n_margins, -1)),
        batch_size=BATCH,
    )
    verdict, margin = _verdicts_and_margins(problem_and_bounds[0], shots.motion, (count, n_margins))
    speed = np.linalg.norm(shots.velocity, axis=1).reshape(count, n_margins)
    slowest = np.where(verdict == 0, speed, np.inf).argmin(1)
    largest, each, is_found = margin.argmax(1), np.arange(count), (verdict == 0).any(1)

    def shown(values: np.ndarray) -> np.ndarray:
        return np.where(is_found, values.reshape(count, n_margins)[each, slowest], np.nan)

    x, y, z = (shown(axis) for axis in shots.position.T)
    return LaunchRange(
        verdict=np.where(is_found, FLAGS(0), verdict[each, largest]),
        largest_margin=margin[each, largest],
        release_speed=shown(speed),
        flight_time=shown(shots.flight_time),
        release_x=x,
        release_y=y,
        release_z=z,
        duration=shown(shots.motion.time),
        release_time=shown(shots.fraction * shots.motion.time),
    )


def _verdicts_and_margins(problem: Problem, motions: Bezier, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    # Verify motions in batches of one size, so that one program serves any number of them.
    parts = [slice(i, i + BATCH) for i in range(0, len(motions.time), BATCH)]
    results = [verdicts(problem, jax.tree.map(lambda x, s=chunk: x[s], motions)) for chunk in parts]
    verdict = np.concatenate([x.verdict for x in results])
    margin = np.concatenate([smallest_slacks(problem, x) for x in results])
    return verdict.reshape(shape), margin.reshape(shape)
