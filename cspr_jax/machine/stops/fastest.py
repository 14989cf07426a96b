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
from cspr_jax.machine.stops.candidates import Candidate, Stop, fastest_proved, hermite_spline, proved
from cspr_jax.machine.stops.dying_swings import dying_swings
from cspr_jax.machine.stops.free_stops import free_stops, short_stops
from cspr_jax.machine.stops.instants import RESTING, Instants, instants_of
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


class MotionSequence(NamedTuple):
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

        def at(times: Float[np.ndarray, "k"]) -> Instants:
            states = instants_of(self.motions, self.durations, times)
            return states.moved(self.frame, emergency.frame, (self.reference, emergency.reference))

        return at

    def resting(self, problem: Problem) -> Float[np.ndarray, "m"]:
        """Times between and after the motions at which the robot rests."""
        ends = np.concatenate([[0.0], np.cumsum(self.durations)])
        before = instants_of(self.motions, self.durations, np.maximum(ends, 0.0))
        return ends[before.rests(float(spool_radius(problem.robot)), float(problem.robot.gravity))]


def fastest_stops(emergency: Emergency, sequence: MotionSequence, times: Float[np.ndarray, "k"]) -> list[Stop | None]:
    """The fastest stop from each of k times, None where none is found; all are proved."""
    problem, scene, z0, gravity = (
        emergency.problem,
        emergency.scene,
        emergency.z0,
        float(emergency.problem.robot.gravity),
    )
    states_at = sequence.states_at(emergency)
    instants, resting = states_at(times), sequence.resting(problem)
    stops: list[Stop | None] = _resting(emergency, instants)
    left = _without(stops)
    if len(left) and _is_searched(problem):
        stage("stops: free motions")
        _put(stops, _free(emergency, instants, left))
    stage("stops: along the path")
    short = short_stops(instants, z0, gravity, jumps=emergency.jumps)
    _put(stops, fastest_proved(problem, scene, [one for one in short if _is_faster(one, stops)]))
    ladder = brakes(states_at, instants, resting, float(sequence.durations.sum()), z0, gravity) + rests_ahead(
        states_at, instants, resting, z0, gravity
    )
    _put(stops, fastest_proved(problem, scene, [one for one in ladder if _is_faster(one, stops)]))
    slower = np.array([k for k, stop in enumerate(stops) if stop is None or stop.kind == "path"], int)
    if len(slower) and _is_searched(problem):
        stage("stops: free motions again")
        _put(stops, _free(emergency, instants, slower, again=True))
    left = _without(stops)
    if len(left):
        stage("stops: swings")
        swings = dying_swings(instants.take(left), gravity, jumps=emergency.jumps)
        found = fastest_proved(problem, scene, swings)
        _put(stops, {int(left[k]): stop for k, stop in found.items()})
    return stops


def _without(stops: Sequence[Stop | None]) -> np.ndarray:
    return np.array([k for k, stop in enumerate(stops) if stop is None], int)


def _is_faster(candidate: Candidate, stops: Sequence[Stop | None]) -> bool:
    stop = stops[candidate.instant]
    return stop is None or candidate.duration < stop.duration


def _put(stops: list[Stop | None], found: dict[int, Stop]) -> None:
    for k, stop in found.items():
        before = stops[k]
        if before is None or stop.duration < before.duration:
            stops[k] = stop


def _resting(emergency: Emergency, instants: Instants) -> list[Stop | None]:
    # Where the robot rests, it may stay if that is proved; after a break, it may also lose its acceleration at once.
    problem = emergency.problem
    radius, gravity = float(spool_radius(problem.robot)), float(problem.robot.gravity)
    is_still = instants.rests(radius, gravity)
    if emergency.jumps:
        is_still = np.abs(instants.rates).max(1) <= RESTING * np.sqrt(gravity * radius)
    found: list[Stop | None] = [None] * len(instants)
    rows = np.flatnonzero(is_still).tolist()
    motions = [_constant(instants, k, emergency.z0) for k in rows]
    for k, motion, proof in zip(rows, motions, proved(problem, emergency.scene, motions), strict=True):
        if proof.is_feasible:
            found[k] = Stop("rest", motion, proof)
    return found


def _constant(instants: Instants, k: int, z0: float):
    zero = np.zeros((2, 3))
    turning = None
    if instants.quaternion is not None:
        turning = [instants.quaternion[[k, k]], np.zeros((2, 4)), np.zeros((2, 4))]
    return hermite_spline(np.array([0.0, 1.0]), [instants.position[[k, k]], zero, zero], turning, z0)


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
    given = largest if maximum is None else np.asarray(maximum)
    limits = dataclasses.replace(problem.limits, tension_max=as_float64(np.where(np.isfinite(given), given, largest)))
    return problem._replace(limits=limits)


def begins_with(instants: Instants, k: int, motion: Spline, emergency: Emergency) -> bool:
    """Tell whether a motion begins with the state of an instant: rounding spoils accelerations of very short ones."""
    state, robot = jax.tree.map(np.asarray, motion.state(jnp.asarray(0.0))), emergency.problem.robot
    gravity, radius = float(robot.gravity), float(spool_radius(robot))
    speed = np.sqrt(gravity * radius)
    pairs = [(state.position, instants.position[k], radius), (state.velocity, instants.velocity[k], speed)]
    pairs += [] if emergency.jumps else [(state.acceleration, instants.acceleration[k], gravity)]
    if instants.angular_velocity is not None and instants.angular_acceleration is not None:
        pairs.append((state.angular_velocity, instants.angular_velocity[k], speed / radius))
        turning = (
            []
            if emergency.jumps
            else [(state.angular_acceleration, instants.angular_acceleration[k], gravity / radius)]
        )
        pairs += turning
    return all(np.abs(mine - theirs).max() <= JOINED * unit for mine, theirs, unit in pairs)


def _free(emergency: Emergency, instants: Instants, left: np.ndarray, *, again: bool = False) -> dict[int, Stop]:
    bounded = _bounded(emergency.problem)
    rows, motions, answers = free_stops(
        bounded, emergency.scene, instants.take(left), emergency.z0, jumps=emergency.jumps, again=again
    )
    joined = [begins_with(instants, int(left[k]), motion, emergency) for k, motion in zip(rows, motions, strict=True)]
    chosen = np.flatnonzero(answers.feasible & np.array(joined, bool))
    found: dict[int, Any] = {int(left[rows[i]]): Stop("free", motions[i], answers.proof[i]) for i in chosen.tolist()}
    if bounded is emergency.problem or not found:
        return found
    proofs = proved(emergency.problem, emergency.scene, [stop.motion for stop in found.values()])
    pairs = zip(found.items(), proofs, strict=True)
    return {k: stop._replace(proof=proof) for (k, stop), proof in pairs if proof.is_feasible}
