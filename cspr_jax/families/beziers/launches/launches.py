"""Launches: flight to a target, segment on which the object is released, and the choice of what is left open.

The position and the velocity of release determine the control point and the end of that segment, (29); from this
control point follow the accelerations of the whole sequence.
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

# A release is searched for between these fractions of the duration of its segment.
EARLIEST, LATEST = 0.05, 0.95


class Launch(NamedTuple):
    """Requirements of a launch; NumPy or jax numbers, None where a value is to be chosen.

    Fields:
        points: (n + 1, 3) of the sequence, z down, m; the end of the launching segment is ignored.
        segment: () index of the launching segment.
        target: (3,) m.
        point: (3,) position of release, m; None: it is on the parabola of `velocity`.
        velocity: (3,) at the target, m/s; None: `point` and the time of flight determine it.
        time: () time of flight, s; None: to be chosen.
        release: () time of release since the start of the segment, s; None: to be chosen.
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
        sequence: the segments, with the end of the launching segment determined.
        durations: (n,) s.
        release: () time of release since the start of the segment, s.
        time: () time of flight, s.
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
    # Unknowns are logarithms of the free durations, the time of release, and the logarithm of the time of flight.
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
    # Return the kinetic energy at the release over weight, as the squared speed over gravity, m.
    launch = _sequence_of(arguments, x)
    return 0.5 * jnp.sum(launch.velocity**2) / arguments[0].robot.gravity, _margins(arguments[0], launch)


def _landing(arguments, x: Array) -> tuple[Array, Array]:
    launch, at = _sequence_of(arguments, x), arguments[1].segment
    before = jnp.sum(jnp.where(jnp.arange(len(launch.durations)) < at, launch.durations, 0.0))
    return before + launch.release + launch.time, _margins(arguments[0], launch)


def launched(problem: Problem, launch: Launch, durations: list[float | None], choose: str | None) -> LaunchSequence:
    """The launch with all that it leaves open chosen."""
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
