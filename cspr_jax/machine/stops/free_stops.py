"""Fastest stops along any path: free motions from a state to rest at any pose, searched for and proved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.families.free.batch import free_motions
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.families.free.search.equations import coordinates
from cspr_jax.families.free.search.starts import Starts
from cspr_jax.families.free.search.tasks import Tasks
from cspr_jax.machine.stops.candidates import Candidate, hermite_spline
from cspr_jax.machine.stops.instants import StateSamples
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.robots.contacts.clearance import Scene

# Numbers of intervals of the first search and of the final motion.
MESHES = ((10, 28), (16, 40))
# Durations of short stops over half a swing: from, to, number.
SHORT = (3e-3, 0.1, 10)
# Durations of the motions from which searches start: multiples of the time in which gravity would take the speed away,
# added to a fraction of half a swing; how far they go on with the speed, over speed times duration; and how far their
# ends lie towards the point below the centroid of the spools.
BRAKING, SHORTEST, ONWARD, CENTRED = (2.0, 5.0), 0.15, 0.4, (0.0, 0.6)
# A second search has durations over half a swing, and half swings of motions that come to rest in P0.
DURATIONS, TOWARDS, HALVES = (0.4, 0.8, 1.4), (0.4, 0.75, 1.0), (1, 2)


def free_stops(
    problem: Problem, scene: Scene | None, samples: StateSamples, z0: float, *, jumps: bool = False, again: bool = False
) -> tuple[np.ndarray, list[Spline], Answers]:
    """Indices of the instants for which motions are found, the motions, and their answers.

    With `jumps` the acceleration at the start is free, as after a cable has broken. A search made `again` starts
    from more and slower motions, where the first one has found nothing.
    """
    pairs = [_poses(samples, k, z0, jumps=jumps) for k in range(len(samples))]
    solutions = free_motions(problem, scene, pairs, MESHES, lambda tasks: _starts(tasks, z0, again=again))
    return solutions.indices, solutions.motions, solutions.answers


def short_stops(samples: StateSamples, z0: float, gravity: float, *, jumps: bool) -> list[Candidate]:
    """Single quintics to rest, for instants so near to rest that rounding spoils what a search finds."""
    half, candidates = np.pi * np.sqrt(z0 / gravity), []
    for k in range(len(samples)):
        for duration in (half * np.geomspace(*SHORT)).tolist():
            times, zero = np.array([0.0, duration]), np.zeros(3)
            acceleration = zero if jumps else samples.acceleration[k]
            end = samples.position[k] + _halted(samples.velocity[k], acceleration, duration)
            values = [samples.position[k], end], [samples.velocity[k], zero], [acceleration, zero]
            turning = _turning(samples, k, duration, jumps=jumps)
            candidates.append(
                Candidate(k, "free", hermite_spline(times, [np.array(one) for one in values], turning, z0))
            )
    return candidates


def _halted(rate: np.ndarray, second: np.ndarray, duration: float) -> np.ndarray:
    # Displacement with which the quintic to rest is a quartic: the speed falls as a cubic.
    return 0.5 * duration * rate + duration**2 * second / 12.0


def _turning(samples: StateSamples, k: int, duration: float, *, jumps: bool) -> list[np.ndarray] | None:
    # Quaternions (1, v) q0, of any norm, at both ends, with two derivatives.
    if samples.quaternion is None or samples.angular_velocity is None or samples.angular_acceleration is None:
        return None
    rate, second = 0.5 * samples.angular_velocity[k], 0.5 * samples.angular_acceleration[k] * (not jumps)
    zero, start = np.zeros(3), np.repeat(samples.quaternion[[k]], 2, axis=0)
    values = [zero, _halted(rate, second, duration)], [rate, zero], [second, zero]
    scalars = np.array([[1.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    pairs = zip(scalars, values, strict=True)
    return [products(np.concatenate([one[:, None], np.array(vectors)], axis=1), start) for one, vectors in pairs]


def _poses(samples: StateSamples, k: int, z0: float, *, jumps: bool) -> FreePoses:
    twice = np.array([k, k])
    rates, accelerations = samples.rates[twice], samples.accelerations[twice]
    rates[1] = accelerations[1] = 0.0
    if jumps:
        accelerations[0] = np.nan
    quaternions = None if samples.quaternion is None else samples.quaternion[twice]
    return FreePoses(samples.position[twice], quaternions, rates, accelerations, z0, rests_anywhere=True)


def _starts(tasks: Tasks, z0: float, *, again: bool) -> Starts:
    begun = [part for k in range(len(tasks.ends)) for part in (_more if again else _few)(_Task.of(tasks, k, z0))]
    each = len(begun) // len(tasks.ends)
    controls = np.einsum("kj,njd->nkd", tasks.basis.fit, np.array([samples for samples, _ in begun]))
    durations = np.array([[duration] for _, duration in begun])
    return Starts(np.repeat(np.arange(len(tasks.ends)), each), controls[:, None], durations)


class _Task(NamedTuple):
    # A state in coordinates, the point below the centroid of the spools, half a swing, s, and gravity.
    tau: np.ndarray
    position: np.ndarray
    rate: np.ndarray
    second: np.ndarray
    middle: np.ndarray
    half: float
    gravity: float

    @classmethod
    def of(cls, tasks: Tasks, k: int, z0: float) -> _Task:
        gravity, along = float(tasks.robot.gravity), coordinates(tasks.robot.pattern)[0]
        position, middle = tasks.ends[k, 0, 0], tasks.ends[k, 0, 0].copy()
        middle[: len(along)] = np.where(along == 2, middle[: len(along)], 0.0)
        second = tasks.turns[k, 0, 0] @ tasks.accelerations[k, 0]
        rate, half = tasks.velocities[k, 0, 0], np.pi * np.sqrt(z0 / gravity)
        return cls(tasks.basis.averages[:, None], position, rate, second, middle, half, gravity)

    def quintic(self, end: np.ndarray, duration: float) -> np.ndarray:
        """Values at the Greville abscissae of the quintic from the state to rest."""
        return _quintic(self.tau, self.position, duration * self.rate, 0.5 * duration**2 * self.second, end)


def _few(task: _Task) -> list[tuple[np.ndarray, float]]:
    # Quintics to rest, on with the speed and towards the middle.
    begun = []
    for factor, fraction in zip(BRAKING, CENTRED, strict=True):
        duration = factor * float(np.linalg.norm(task.rate)) / task.gravity + SHORTEST * task.half
        onward = task.position + ONWARD * duration * task.rate
        for end, longer in ((onward, duration), (onward + fraction * (task.middle - onward), 2.0 * duration)):
            begun.append((task.quintic(end, longer), longer))
    return begun


def _more(task: _Task) -> list[tuple[np.ndarray, float]]:
    # Slower quintics towards the middle, and swings about it that die.
    begun = []
    for duration in (fraction * task.half for fraction in DURATIONS):
        ends = (task.position + fraction * (task.middle - task.position) for fraction in TOWARDS)
        begun += [(task.quintic(end, duration), duration) for end in ends]
    for halves in HALVES:
        angle, tau = halves * np.pi * task.tau, task.tau
        swing = (task.position - task.middle) * np.cos(angle) + task.rate * (task.half / np.pi) * np.sin(angle)
        begun.append((task.middle + (1.0 - tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)) * swing, halves * task.half))
    return begun


def _quintic(tau: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray, end: np.ndarray) -> np.ndarray:
    # The quintic a + b tau + c tau^2 + ... that rests at its end.
    gap, derivative, second_derivative = end - a - b - c, -(b + 2.0 * c), -2.0 * c
    x3 = 10.0 * gap - 4.0 * derivative + 0.5 * second_derivative
    x4 = -15.0 * gap + 7.0 * derivative - second_derivative
    x5 = 6.0 * gap - 3.0 * derivative + 0.5 * second_derivative
    return a + b * tau + c * tau**2 + x3 * tau**3 + x4 * tau**4 + x5 * tau**5
