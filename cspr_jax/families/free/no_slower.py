"""Motions of other families that replace those of a search where they are faster, or the search finds nothing.

Splines approximate these motions, and equal them at the poses. Orientations are splines of quaternions, since a
platform may turn by more than half a turn from its mean orientation, where Rodrigues vectors become infinite.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import cast

import jax
import numpy as np
from jax import Array

from cspr_jax.curves.spline import Spline
from cspr_jax.families.free.closed_forms import NEAR, ClosedForm
from cspr_jax.families.free.free_motion import FreeMotion
from cspr_jax.families.free.poses import FreePoses, half_swing, motions_of
from cspr_jax.families.free.problem import FreeQuestion, FreeSettings
from cspr_jax.families.free.search.equations import coordinates
from cspr_jax.families.free.search.interior_point import started
from cspr_jax.families.free.search.starts import ARCS
from cspr_jax.families.free.search.tasks import OUTER, Tasks
from cspr_jax.motion.answers import Answers, replaced
from cspr_jax.motion.motion import Motion, common_shape, states_at
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.cables import AnyRobot, tensions
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.limits import Limits
from cspr_jax.verification.proved_answers import proved_answers

BATCH = 128


def followed(tasks: Tasks, motions: list[Motion], duration: Float[np.ndarray, "s"], z0: float) -> list[Spline]:
    """Splines of a task that approximate motions."""
    along, about = coordinates(tasks.robot.pattern)
    samples = [np.asarray(states_at(motion, tasks.basis.averages).position)[:, along] for motion in motions]
    controls = np.einsum("kj,sjd->skd", tasks.basis.fit, np.array(samples))
    zero = np.zeros((*controls.shape[:2], len(about)))
    unknowns = started(tasks, np.concatenate([controls, zero], axis=2)[None], duration[None])
    splines = motions_of(tasks, unknowns, z0)
    if not len(about):
        return splines
    orientations = [
        _orientation_pieces(tasks, i, *pair) for i, pair in enumerate(zip(motions, duration.tolist(), strict=True))
    ]
    return [
        dataclasses.replace(spline, quaternion=as_float64(table))
        for spline, table in zip(splines, orientations, strict=True)
    ]


def _orientation_pieces(tasks: Tasks, segment: int, motion: Motion, duration: float) -> np.ndarray:
    # Return Bernstein coefficients (m, 6, 4) of quaternions that keep their sign.
    basis, (along, about) = tasks.basis, coordinates(tasks.robot.pattern)
    quaternions = np.array(states_at(motion, basis.averages).quaternion)
    turns_over = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    quaternions[1:] *= np.where(np.cumsum(turns_over) % 2 == 1, -1.0, 1.0)[:, None]
    controls, ends = basis.fit @ quaternions, states_at(motion, np.array([0.0, 1.0]))
    for side, pose in ((0, segment), (-1, segment + 1)):
        turning = np.zeros(4)
        turning[1:] = np.asarray(ends.angular_acceleration)[side]
        if not tasks.is_free[0, pose]:
            turning[1 + about] = tasks.accelerations[0, pose, len(along) :]
        # At rest q'' = alpha q / 2, with the angular acceleration alpha.
        second_derivative = 0.5 * products(turning[None], quaternions[side][None])[0]
        outer = [quaternions[side]] * (OUTER - 1) + [
            quaternions[side] + basis.acceleration_step * duration**2 * second_derivative
        ]
        controls[np.arange(OUTER) if side == 0 else -1 - np.arange(OUTER)] = outer
    return np.einsum("mbk,mkd->mbd", basis.pieces, basis.in_intervals(controls))


def energy_along(tasks: Tasks, motion: Motion) -> float:
    """Integral of the sum of the squares of the tensions over a motion."""
    kernel = partial(_tensions, tasks.robot, tasks.limits, common_shape(motion))
    force = in_batches(kernel, tasks.basis.tau.ravel(), batch_size=BATCH)
    return float(motion.duration()) * float(np.sum(tasks.basis.weights.ravel() * np.sum(force**2, axis=1)))


@jax.jit
def _tensions(robot: AnyRobot, limits: Limits, motion: Motion, tau: Array) -> Array:
    return jax.vmap(lambda one: tensions(robot, motion.state(one), limits))(tau)


# Intervals per half swing of a spline that approximates a closed form, and how often they are doubled.
INTERVALS, DOUBLINGS = 16, 3


def can_be_faster(free: FreeMotion, problem: Problem, poses: FreePoses, settings: FreeSettings) -> bool:
    """Tell whether closed forms may be better: the motion is not feasible, or slower than swings."""
    if not free.answers.feasible.all():
        return True
    return settings.objective == "time" and free.duration > ARCS * len(free.motions) * half_swing(problem, poses)


def no_slower(
    free: FreeMotion,
    problem: Problem,
    scene: Scene | None,
    poses: FreePoses,
    settings: FreeSettings,
    forms: Sequence[ClosedForm],
) -> FreeMotion:
    """The motion, or a closed form through the same poses that is faster, or proved when the motion is not."""
    is_proved = bool(free.answers.feasible.all())
    for form in sorted(forms, key=lambda one: float(one.duration.sum())):
        full = float(form.duration.sum())
        is_better = not is_proved or (settings.objective == "time" and full < free.duration)
        is_short = settings.longest is None or bool((form.duration <= settings.longest).all())
        if is_better and is_short and form.is_feasible.all():
            spline = _followed(problem, scene, poses, settings, form)
            if spline is not None:
                return dataclasses.replace(spline, is_stopped=free.is_stopped, searched=free.searched)
    return free


def _followed(
    problem: Problem, scene: Scene | None, poses: FreePoses, settings: FreeSettings, form: ClosedForm
) -> FreeMotion | None:
    # Double the intervals of the spline until it is proved; it has the accelerations that the poses prescribe.
    question = FreeQuestion.of(problem, scene, poses, settings)
    arcs = float(form.duration.max()) / half_swing(problem, poses)
    intervals = max(settings.intervals, 2 * int(np.ceil(0.5 * INTERVALS * arcs)))
    for doubling in range(DOUBLINGS):
        tasks = question.tasks(intervals * 2**doubling, question.samples)
        motions = followed(tasks, form.motions, form.duration, poses.z0)
        answers = proved_answers(problem, motions, scene)
        if answers.feasible.all():
            energy, level = np.array([energy_along(tasks, motion) for motion in motions]), np.full(len(motions), np.nan)
            families = (form.family,) * len(motions)
            return FreeMotion(motions, answers, energy, level, True, False, np.nan, families=families)
    return None


def lines_instead(
    problem: Problem, scene: Scene | None, poses: FreePoses, settings: FreeSettings, line: ClosedForm
) -> FreeMotion:
    """Lines that replace a search which was stopped without a result."""
    motions, answers = cast(list[Spline], line.motions), cast(Answers, line.answers)
    energy = _energies(FreeQuestion.of(problem, scene, poses, settings), line.motions)
    families, level = (line.family,) * len(motions), np.full(len(motions), np.nan)
    return FreeMotion(motions, answers, energy, level, False, True, np.nan, (), families)


def no_slower_than_lines(
    free: FreeMotion,
    problem: Problem,
    scene: Scene | None,
    poses: FreePoses,
    settings: FreeSettings,
    lines: Sequence[ClosedForm],
) -> FreeMotion:
    """The motion, with lines for segments that are slower than a line, or not feasible where a line is."""
    for line in lines:
        is_better = ~free.answers.feasible
        if settings.objective == "time":
            is_better |= line.duration < free.answers.duration
        indices = np.flatnonzero(is_better & fits(line, problem, poses, settings))
        if len(indices):
            free = _with(free, lines_instead(problem, scene, poses, settings, line), indices)
    return free


def _with(free: FreeMotion, line: FreeMotion, indices: np.ndarray) -> FreeMotion:
    # Replace some segments of a motion by lines.
    chosen, count = set(indices.tolist()), len(free.motions)
    motions = [(line if k in chosen else free).motions[k] for k in range(count)]
    families = tuple(line.families[k] if k in chosen else (free.families or [None] * count)[k] for k in range(count))
    energy, level = free.energy.copy(), free.level.copy()
    energy[indices], level[indices] = line.energy[indices], line.level[indices]
    answers = replaced(free.answers, indices, line.answers, indices)
    return dataclasses.replace(free, motions=motions, answers=answers, energy=energy, level=level, families=families)


def fits(line: ClosedForm, problem: Problem, poses: FreePoses, settings: FreeSettings) -> Bool[np.ndarray, "n"]:
    """Tell which lines are proved, short enough, and have the accelerations that the poses prescribe."""
    is_short = line.duration <= (np.inf if settings.longest is None else settings.longest)
    return line.is_feasible & is_short & (_accelerations_missed(line, poses) <= NEAR * float(problem.robot.gravity))


def _accelerations_missed(line: ClosedForm, poses: FreePoses) -> np.ndarray:
    # Return the largest differences from the prescribed accelerations, (n,) m/s^2 or rad/s^2.
    missed = np.zeros(len(line.motions))
    for k, motion in enumerate(line.motions):
        state, requested = states_at(motion, np.array([0.0, 1.0])), poses.accelerations[k : k + 2]
        parts = [state.acceleration, *([] if poses.quaternions is None else [state.angular_acceleration])]
        away = np.abs(np.concatenate([np.asarray(part) for part in parts], axis=1) - requested)
        missed[k] = np.max(away, initial=0.0, where=~np.isnan(requested))
    return missed


def _energies(question: FreeQuestion, motions: Sequence[Motion]) -> np.ndarray:
    tasks = question.tasks(question.settings.intervals, question.samples)
    return np.array([energy_along(tasks, motion) for motion in motions])
