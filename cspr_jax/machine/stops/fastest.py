"""The fastest proved stop from each instant of motions, by the robot that moves or by one that has lost cables."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.families.free.poses import check_searched
from cspr_jax.machine.stops.braking import StatesAt, brakes, rests_ahead
from cspr_jax.machine.stops.candidates import Candidate, ProvedStop, fastest_proved, hermite_spline, proved
from cspr_jax.machine.stops.dying_swings import dying_swings
from cspr_jax.machine.stops.free_stops import free_stops, short_stops
from cspr_jax.machine.stops.instants import StateSamples, instants_of
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.runtime.stages import stage

# A motion begins with a state if it misses it by at most this part of the robot's radius, of gravity and so on.
JOINED = 1e-6
# Largest tensions of searches for robots that have none, over their weight: without one, the least time is that of
# impulses.
LARGEST_TENSION = 2.0
CHUNK = 500  # number of instants whose candidates are held at once


class Emergency(NamedTuple):
    """A robot that is to be stopped.

    Fields:
        problem: the robot that stops, with its limits.
        scene: obstacles and shape; None: none.
        frame: axes of its file.
        reference: rotation from a platform's axes in the file to those of the kernels.
        z0: depth of P0 about which searches swing, m.
        jumps: whether accelerations may jump at the start, as where a cable breaks.
    """

    problem: Problem
    scene: Scene | None
    frame: Frame
    reference: np.ndarray
    z0: float
    jumps: bool = False


class ConsecutiveMotions(NamedTuple):
    """Motions that follow one another, in the axes of the kernels of the robot that moves.

    Fields:
        motions: the motions.
        durations: (n,) s.
        frame: axes of the robot's file.
        reference: as in `Emergency`.
    """

    motions: Sequence[Motion]
    durations: np.ndarray
    frame: Frame
    reference: np.ndarray

    def states_at(self, emergency: Emergency) -> StatesAt:
        """States at any times, in the axes of the robot that stops."""

        def at(times: Float[np.ndarray, "k"]) -> StateSamples:
            states = instants_of(self.motions, self.durations, times)
            return states.moved(self.frame, emergency.frame, (self.reference, emergency.reference))

        return at

    def resting(self, problem: Problem) -> Float[np.ndarray, "m"]:
        """Times between and after the motions at which the robot rests."""
        ends = np.concatenate([[0.0], np.cumsum(self.durations)])
        before = instants_of(self.motions, self.durations, ends)
        return ends[before.rests(float(spool_radius(problem.robot)), float(problem.robot.gravity))]


def fastest_stops(
    emergency: Emergency, sequence: ConsecutiveMotions, times: Float[np.ndarray, "k"]
) -> list[ProvedStop | None]:
    """The fastest stop from each of k times, None where none is found; all are proved."""
    chunks = [times[i : i + CHUNK] for i in range(0, len(times), CHUNK)]
    return [stop for chunk in chunks for stop in _fastest_stops(emergency, sequence, chunk)]


def _fastest_stops(
    emergency: Emergency, sequence: ConsecutiveMotions, times: Float[np.ndarray, "k"]
) -> list[ProvedStop | None]:
    problem, scene, z0, gravity = (
        emergency.problem,
        emergency.scene,
        emergency.z0,
        float(emergency.problem.robot.gravity),
    )
    states_at = sequence.states_at(emergency)
    samples, resting = states_at(times), sequence.resting(problem)
    solutions: list[ProvedStop | None] = _resting(emergency, samples)
    left = _without(solutions)
    if len(left) and _is_searched(problem):
        stage("stops: free motions")
        _put(solutions, _free(emergency, samples, left))
    stage("stops: along the path")
    short = short_stops(samples, z0, gravity, jumps=emergency.jumps)
    _put(solutions, fastest_proved(problem, scene, [one for one in short if _is_faster(one, solutions)]))
    ladder = brakes(states_at, samples, resting, float(sequence.durations.sum()), z0, gravity) + rests_ahead(
        states_at, samples, resting, z0, gravity
    )
    _put(solutions, fastest_proved(problem, scene, [one for one in ladder if _is_faster(one, solutions)]))
    slower = np.array([k for k, stop in enumerate(solutions) if stop is None or stop.kind == "path"], int)
    if len(slower) and _is_searched(problem):
        stage("stops: free motions again")
        _put(solutions, _free(emergency, samples, slower, again=True))
    left = _without(solutions)
    if len(left):
        stage("stops: swings")
        swings = dying_swings(samples.take(left), gravity, jumps=emergency.jumps)
        answers = fastest_proved(problem, scene, swings)
        _put(solutions, {int(left[k]): stop for k, stop in answers.items()})
    return solutions


def _without(solutions: Sequence[ProvedStop | None]) -> np.ndarray:
    return np.array([k for k, stop in enumerate(solutions) if stop is None], int)


def _is_faster(candidate: Candidate, solutions: Sequence[ProvedStop | None]) -> bool:
    stop = solutions[candidate.sample]
    return stop is None or candidate.duration < stop.duration


def _put(solutions: list[ProvedStop | None], answers: dict[int, ProvedStop]) -> None:
    for k, stop in answers.items():
        before = solutions[k]
        if before is None or stop.duration < before.duration:
            solutions[k] = stop


def _resting(emergency: Emergency, samples: StateSamples) -> list[ProvedStop | None]:
    # A robot at rest may stay if that is proved; after a break, it may also lose its acceleration at once.
    problem = emergency.problem
    radius, gravity = float(spool_radius(problem.robot)), float(problem.robot.gravity)
    is_still = samples.is_still(radius, gravity) if emergency.jumps else samples.rests(radius, gravity)
    answers: list[ProvedStop | None] = [None] * len(samples)
    rows = np.flatnonzero(is_still).tolist()
    motions = [_constant(samples, k, emergency.z0) for k in rows]
    for k, motion, proof in zip(rows, motions, proved(problem, emergency.scene, motions), strict=True):
        if proof.is_feasible:
            answers[k] = ProvedStop("rest", motion, proof)
    return answers


def _constant(samples: StateSamples, k: int, z0: float):
    zero = np.zeros((2, 3))
    turning = None
    if samples.quaternion is not None:
        turning = [samples.quaternion[[k, k]], np.zeros((2, 4)), np.zeros((2, 4))]
    return hermite_spline(np.array([0.0, 1.0]), [samples.position[[k, k]], zero, zero], turning, z0)


def _is_searched(problem: Problem) -> bool:
    try:
        check_searched(_bounded(problem))
    except InputError:
        return False
    return True


def _bounded(problem: Problem) -> Problem:
    # The problem with a largest tension for each cable.
    robot, maximum = problem.robot, problem.limits.tension_max
    if maximum is not None and np.isfinite(np.asarray(maximum)).all():
        return problem
    largest = np.full(robot.n_cables, LARGEST_TENSION * float(robot.mass * robot.gravity))
    if problem.limits.tension_min is not None:
        largest = np.maximum(largest, 4.0 * np.asarray(problem.limits.tension_min))
    bounds = largest if maximum is None else np.asarray(maximum)
    limits = dataclasses.replace(problem.limits, tension_max=as_float64(np.where(np.isfinite(bounds), bounds, largest)))
    return problem._replace(limits=limits)


def begins_with(samples: StateSamples, k: int, motion: Spline, emergency: Emergency) -> bool:
    """Tell whether a motion begins with the state of an instant: rounding spoils accelerations of very short ones."""
    state, robot = jax.tree.map(np.asarray, motion.state(jnp.asarray(0.0))), emergency.problem.robot
    gravity, radius = float(robot.gravity), float(spool_radius(robot))
    speed = np.sqrt(gravity * radius)
    pairs = [(state.position, samples.position[k], radius), (state.velocity, samples.velocity[k], speed)]
    pairs += [] if emergency.jumps else [(state.acceleration, samples.acceleration[k], gravity)]
    if (
        samples.quaternion is not None
        and samples.angular_velocity is not None
        and samples.angular_acceleration is not None
    ):
        start = samples.quaternion[k] / np.linalg.norm(samples.quaternion[k])
        pairs.append((state.quaternion * np.copysign(1.0, state.quaternion @ start), start, 1.0))
        pairs.append((state.angular_velocity, samples.angular_velocity[k], speed / radius))
        turning = (
            [] if emergency.jumps else [(state.angular_acceleration, samples.angular_acceleration[k], gravity / radius)]
        )
        pairs += turning
    return all(np.abs(actual - expected).max() <= JOINED * unit for actual, expected, unit in pairs)


def _free(
    emergency: Emergency, samples: StateSamples, left: np.ndarray, *, again: bool = False
) -> dict[int, ProvedStop]:
    bounded = _bounded(emergency.problem)
    rows, motions, searched = free_stops(
        bounded, emergency.scene, samples.take(left), emergency.z0, jumps=emergency.jumps, again=again
    )
    joined = [begins_with(samples, int(left[k]), motion, emergency) for k, motion in zip(rows, motions, strict=True)]
    chosen = np.flatnonzero(searched.feasible & np.array(joined, bool))
    answers: dict[int, Any] = {
        int(left[rows[i]]): ProvedStop("free", motions[i], searched.proof[i]) for i in chosen.tolist()
    }
    if bounded is emergency.problem or not answers:
        return answers
    proofs = proved(emergency.problem, emergency.scene, [stop.motion for stop in answers.values()])
    pairs = zip(answers.items(), proofs, strict=True)
    return {k: stop._replace(proof=proof) for (k, stop), proof in pairs if proof.is_feasible}
