"""Launches: the flight to a target, the segment on which an object is released, and the choice of what is left open.

The control point and the end of that segment follow from the position and the velocity of release, (29), and the
accelerations of all the sequence from that control point.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.beziers.launches.release import through
from cspr_jax.families.beziers.sequences import Anchored, duration_bounds, margins_of, segments_of, verified
from cspr_jax.launch.flight import aimed, flown
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.search.constrained_minima import constrained_minimum

# Fractions of the duration of its segment between which a release is searched for.
EARLIEST, LATEST = 0.05, 0.95


class Launch(NamedTuple):
    """Requirements of a launch; NumPy or jax numbers, None where a value is to be chosen.

    Fields:
        points: (n + 1, 3) of the sequence, z down, m; the end of the launching segment is ignored.
        segment: () number of the launching segment.
        target: (3,) m.
        point: (3,) position of the release, m; None: on the parabola of `velocity`.
        velocity: (3,) at the target, m/s; None: as `point` and the time of flight demand.
        time: () of the flight, s; None: to be chosen.
        release: () time after the start of the segment, s; None: to be chosen.
        z0: () depth at which slacks are normalised, m.
    """

    points: Any
    segment: Any
    target: Any
    point: Any
    velocity: Any
    time: Any
    release: Any
    z0: Any


class LaunchSequence(NamedTuple):
    """A launch and its sequence.

    Fields:
        sequence: with the end of the launching segment.
        durations: (n,) s.
        release: () time after the start of the segment, s.
        time: () of the flight, s.
        position: (3,) at the release, m.
        velocity: (3,) at the release, m/s.
    """

    sequence: Anchored
    durations: Any
    release: Any
    time: Any
    position: Any
    velocity: Any


@jax.jit
def _sequence_of(arguments: Any, x: Array) -> LaunchSequence:
    # Unknowns: logarithms of the free durations, then the release, then the logarithm of the flight's time.
    problem, launch, durations, free = arguments
    times = durations.at[free].set(jnp.exp(x[: len(free)])) if len(free) else durations
    rest, at = x[len(free) :], launch.segment
    fraction = rest[0] if launch.release is None else launch.release / times[at]
    time = jnp.exp(rest[-1]) if launch.time is None else launch.time
    gravity = problem.robot.gravity
    if launch.point is None:
        position, velocity = flown(launch.target, launch.velocity, gravity, -time)
    else:
        position, velocity = launch.point, aimed(launch.point, launch.target, gravity, time)
    middle, end = through(launch.points[at], position, velocity, fraction, times[at])
    sequence = Anchored(launch.points.at[at + 1].set(end), at, middle, launch.z0)
    return LaunchSequence(sequence, times, fraction * times[at], time, position, velocity)


def _margins(problem: Problem, launch: LaunchSequence) -> Array:
    fraction = launch.release / launch.durations[launch.sequence.segment]
    margins = margins_of(problem, segments_of(launch.sequence, launch.durations))
    return jnp.append(margins, jnp.minimum(fraction, 1.0 - fraction))


def _total(arguments, x: Array) -> tuple[Array, Array]:
    launch = _sequence_of(arguments, x)
    return jnp.sum(launch.durations), _margins(arguments[0], launch)


def _speed(arguments, x: Array) -> tuple[Array, Array]:
    # Square of the speed at the release, over gravity: kinetic energy over weight, m.
    launch = _sequence_of(arguments, x)
    return 0.5 * jnp.sum(launch.velocity**2) / arguments[0].robot.gravity, _margins(arguments[0], launch)


def _landing(arguments, x: Array) -> tuple[Array, Array]:
    launch, at = _sequence_of(arguments, x), arguments[1].segment
    before = jnp.sum(jnp.where(jnp.arange(len(launch.durations)) < at, launch.durations, 0.0))
    return before + launch.release + launch.time, _margins(arguments[0], launch)


def launched(problem: Problem, launch: Launch, durations: list[float | None], choose: str | None) -> LaunchSequence:
    """The launch, with a choice of all that is left open."""
    launch = Launch(*(value if value is None else jnp.asarray(value) for value in launch))
    if choose == "energy":
        launch = launch._replace(time=jnp.asarray(_searched(problem, launch, durations, _speed).time))
    if choose == "time":
        best, at = _searched(problem, launch, durations, _landing), int(launch.segment)
        launch = launch._replace(time=jnp.asarray(best.time), release=jnp.asarray(best.release))
        best_durations = np.asarray(best.durations).tolist()
        durations = [best_durations[i] if i <= at else time for i, time in enumerate(durations)]
    return _searched(problem, launch, durations, _total)


def _searched(problem: Problem, launch: Launch, durations: list[float | None], parts) -> LaunchSequence:
    initial = jnp.asarray([1.0 if time is None else time for time in durations])
    free = np.array([i for i, time in enumerate(durations) if time is None], int)
    arguments: Any = (problem, launch, initial, free)
    shortest, longest = duration_bounds(problem, np.asarray(launch.points))
    bounds = [(shortest, longest)] * len(free)
    bounds += [(EARLIEST, LATEST)] if launch.release is None else []
    bounds += [(shortest, longest)] if launch.time is None else []
    if not bounds:
        return _sequence_of(arguments, jnp.zeros(0))

    def verify(x: np.ndarray):
        candidate = _sequence_of(arguments, jnp.asarray(x))
        return verified(problem, segments_of(candidate.sequence, candidate.durations))

    low, high = (np.array(side) for side in zip(*bounds, strict=True))
    return _sequence_of(arguments, jnp.asarray(constrained_minimum(parts, arguments, low, high, verify)))
