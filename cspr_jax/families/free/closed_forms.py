"""Motions of other families through the same poses, from which searches start."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.families.free.search.equations import coordinates
from cspr_jax.families.free.search.starts import Starts
from cspr_jax.families.free.search.tasks import Tasks
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import Leg
from cspr_jax.motion.motion import Motion, states_at
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.rotations import CONJUGATE, products
from cspr_jax.robots.model.point_mass import spool_radius

# Motions may miss poses by this fraction of the robot's radius r, and velocities by this fraction of sqrt(g r).
NEAR = 1e-9
# No search starts from Rodrigues vectors longer than this.
FAR = 10.0


class ClosedForm(NamedTuple):
    """Motions of a family through the poses of a search.

    Fields:
        family: name of the family.
        motions: n of them, in the axes of the kernels.
        is_feasible: (n,) whether each is proved.
        duration: (n,) s.
        answers: answers of the motions; None unless all are proved in the way that splines are.
    """

    family: str
    motions: list[Motion]
    is_feasible: np.ndarray
    duration: np.ndarray
    answers: Answers | None = None

    def segment(self, i: int) -> "ClosedForm":
        """The motion of one segment alone."""
        part = slice(i, i + 1)
        answers = None if self.answers is None else self.answers.rows(np.arange(i, i + 1))
        return ClosedForm(self.family, self.motions[part], self.is_feasible[part], self.duration[part], answers)


def closed_forms(legs: Sequence[Leg], problem: Problem, poses: FreePoses) -> list[ClosedForm]:
    """Join poses by motions of other families."""
    forms = list[ClosedForm]()
    for leg in legs:
        try:
            leg.check(problem)
            answers, motions = leg.join(problem, poses.z0)
        except (ConfigError, InputError):
            continue  # the family cannot join these poses
        is_full = all(proof is not None and proof.parts.usual for proof in answers.proof)
        proved = answers if is_full else None
        form = ClosedForm(leg.waypoints.family, motions, answers.feasible, np.asarray(answers.duration), proved)
        if answers.feasible.any() and _passes(form, problem, poses):
            forms.append(form)
    return forms


def _passes(form: ClosedForm, problem: Problem, poses: FreePoses) -> bool:
    # Tell whether all proved motions start and end as the poses say; accelerations may differ.
    radius = float(spool_radius(problem.robot))
    speed = np.sqrt(radius * float(problem.robot.gravity))
    for i in np.flatnonzero(form.is_feasible).tolist():
        state = states_at(form.motions[i], np.array([0.0, 1.0]))
        ends = slice(i, i + 2)
        far = np.abs(state.position - poses.positions[ends]).max() > NEAR * radius
        fast = np.abs(state.velocity - poses.velocities[ends]).max() > NEAR * speed
        rotated = poses.quaternions is not None and (
            np.abs(np.sum(state.quaternion * poses.quaternions[ends], axis=1)).min() < 1.0 - NEAR
        )
        if far or fast or rotated:
            return False
    return True


def controls_of(single: Tasks, motion: Motion) -> np.ndarray:
    """Control points of a spline that is near a motion."""
    along, about = coordinates(single.robot.pattern)
    state = states_at(motion, single.basis.averages)
    samples = np.asarray(state.position)[:, along]
    if len(about):
        turning = products(np.asarray(state.quaternion), single.references[0, 0][None] * CONJUGATE)
        with np.errstate(divide="ignore", invalid="ignore"):
            samples = np.concatenate([samples, turning[:, 1 + about] / turning[:, :1]], axis=1)
    return single.basis.fit @ samples


def form_starts(single: Tasks, indices: np.ndarray, forms: Sequence[ClosedForm]) -> Starts:
    """Starts of a search from closed forms."""
    feasible = [(i, form, k) for form in forms for i, k in enumerate(indices.tolist()) if form.is_feasible[k]]
    controls = np.zeros((len(feasible), 1, single.basis.controls, single.ends.shape[-1]))
    for n, (_, form, k) in enumerate(feasible):
        controls[n, 0] = controls_of(single.take(np.array([k])), form.motions[k])
    turns = np.abs(controls[..., len(coordinates(single.robot.pattern)[0]) :])
    is_near = (turns < FAR).all(axis=(1, 2, 3))
    task = np.array([i for i, *_ in feasible], int)
    duration = np.array([form.duration[k] for _, form, k in feasible], float)
    return Starts(task[is_near], controls[is_near], duration[is_near, None])
