"""Closed forms in place of what a search finds, where they are faster, or it finds nothing."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from cspr_jax.free.closed_forms import ClosedForm
from cspr_jax.free.followed import energy_along, followed
from cspr_jax.free.free_motion import FreeMotion
from cspr_jax.free.poses import FreePoses, half_swing
from cspr_jax.free.question import FreeQuestion, FreeSettings
from cspr_jax.free.starts import ARCS
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import proved_answers
from cspr_jax.robots.clearance import Scene

# Intervals of each half swing of a spline that follows a closed form, at first, and how often they are doubled.
INTERVALS, DOUBLINGS = 16, 3


def can_be_faster(free: FreeMotion, problem: Problem, poses: FreePoses, settings: FreeSettings) -> bool:
    """Tell whether closed forms may take the place of a motion: an arc takes about half a swing.

    Args:
        free: as it was found.

    Returns:
        False of a motion that is proved, and no slower than the swings from which searches begin.
    """
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
    """A motion that is at most as slow as closed forms through the same poses.

    Args:
        free: as it was found.

    Returns:
        the motion, or a spline that follows the fastest of the forms, which it then names.
    """
    is_proved = bool(free.answers.feasible.all())
    for form in sorted(forms, key=lambda one: float(one.duration.sum())):
        whole = float(form.duration.sum())
        is_better = not is_proved or (settings.objective == "time" and whole < free.duration)
        is_short = settings.longest is None or bool((form.duration <= settings.longest).all())
        if is_better and is_short and form.is_feasible.all():
            spline = _followed(problem, scene, poses, settings, form)
            if spline is not None:
                return dataclasses.replace(spline, is_stopped=free.is_stopped, searched=free.searched)
    return free


def _followed(
    problem: Problem, scene: Scene | None, poses: FreePoses, settings: FreeSettings, form: ClosedForm
) -> FreeMotion | None:
    # The spline of so many intervals that it is proved; at the poses it has the accelerations that these have.
    question = FreeQuestion.of(problem, scene, poses, settings)
    arcs = float(form.duration.max()) / half_swing(problem, poses)
    intervals = max(settings.intervals, 2 * int(np.ceil(0.5 * INTERVALS * arcs)))
    for doubling in range(DOUBLINGS):
        tasks = question.tasks(intervals * 2**doubling, question.instants)
        motions = followed(tasks, form.motions, form.duration, poses.z0)
        answers = proved_answers(problem, motions, scene)
        if answers.feasible.all():
            energy, level = np.array([energy_along(tasks, motion) for motion in motions]), np.full(len(motions), np.nan)
            return FreeMotion(motions, answers, energy, level, True, False, np.nan, family=form.family)
    return None
