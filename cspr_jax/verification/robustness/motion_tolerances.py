"""Multiples of an uncertainty that motions with bounds of their states are proved to tolerate, and that are refuted.

The search is that of `verification.robustness.tolerances`; blocks are proved and refuted by
`verification.robustness.uncertain_slacks`.
"""

from __future__ import annotations

import dataclasses
from functools import partial

import jax
import numpy as np

from cspr_jax.motion.motion import BoundedMotion, Motion, common_shape
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import constant
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import Bodies, bodies_of, default_scene
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.block_slacks import BATCH
from cspr_jax.verification.bounds.blocks import Blocks
from cspr_jax.verification.robustness.tolerances import Tolerated, tolerated_by
from cspr_jax.verification.robustness.uncertain_slacks import blocks_hold, radii_of, states_fail, worst_directions
from cspr_jax.verification.time_proof import FIRST

STATES = 256  # number of states of a batch


@dataclasses.dataclass
class _StatePool:
    # Blocks of one motion, in s, with bounds of its states; see `tolerances.Pool`.
    problem: Problem
    bodies: Bodies
    motion: BoundedMotion
    contacts_alone: bool
    blocks: Blocks
    states: StateBounds
    middle_states: StateBounds
    directions: np.ndarray

    def part(self, index: np.ndarray) -> "_StatePool":
        states, middle_states = (jax.tree.map(lambda x: x[index], each) for each in (self.states, self.middle_states))
        return dataclasses.replace(
            self,
            blocks=self.blocks.part(index),
            states=states,
            middle_states=middle_states,
            directions=self.directions[index],
        )

    def halves(self, index: np.ndarray) -> "_StatePool":
        blocks = self.blocks.part(index).halves()
        return _pool(self.problem, self.bodies, self.motion, blocks, contacts_alone=self.contacts_alone)

    def middles(self) -> "_StatePool":
        return dataclasses.replace(self, states=self.middle_states)

    def hold(self, multiple: np.ndarray) -> np.ndarray:
        if not len(self.blocks.row):
            return np.zeros(0, bool)
        of_robot = self.problem.robot, self.problem.limits, self.bodies
        kernel = partial(blocks_hold, *of_robot, contacts_alone=self.contacts_alone)
        return in_batches(kernel, (self.states, radii_of(self.problem.limits, multiple)), batch_size=BATCH)

    def fail(self, multiple: np.ndarray) -> np.ndarray:
        if not len(self.blocks.row):
            return np.zeros(0, bool)
        of_robot = self.problem.robot, self.problem.limits, self.bodies
        radii = radii_of(self.problem.limits, multiple)
        return states_fail(*of_robot, self.middle_states, radii, self.directions, contacts_alone=self.contacts_alone)


def _pool(
    problem: Problem, bodies: Bodies, motion: BoundedMotion, blocks: Blocks, *, contacts_alone: bool
) -> _StatePool:
    middle = 0.5 * (blocks.start + blocks.stop)
    each = motion.bounds(blocks.start, blocks.stop), states_as_bounds(motion, middle / float(motion.duration()))
    states, middle_states = (jax.tree.map(np.asarray, bounds) for bounds in each)
    radii, of_robot = radii_of(problem.limits, np.ones(len(middle))), (problem.robot, problem.limits, bodies)
    directions = worst_directions(*of_robot, middle_states, radii, contacts_alone=contacts_alone)
    return _StatePool(problem, bodies, motion, contacts_alone, blocks, states, middle_states, directions)


@persistent_jit
def _constant_states(motion: Motion, tau) -> StateBounds:
    states = jax.vmap(motion.state)(tau)
    names = [name for name in StateBounds._fields if getattr(states, name) is not None]
    return StateBounds(**{name: constant(getattr(states, name)) for name in names})


def states_as_bounds(motion: Motion, tau: Float[np.ndarray, "k"]) -> StateBounds:
    """States of a motion, as bounds over blocks of length zero."""
    return in_batches(partial(_constant_states, common_shape(motion)), tau, batch_size=STATES)


def motion_tolerances(
    problem: Problem, motion: BoundedMotion, scene: Scene | None = None, *, contacts_alone: bool = False
) -> Tolerated:
    """Multiples of the uncertainty that a motion is proved to tolerate, and that are refuted."""
    duration = float(motion.duration())
    jumps = motion.jumps() if hasattr(motion, "jumps") else np.zeros(0)
    edges = np.unique(
        np.concatenate([np.linspace(0.0, duration, FIRST + 1), jumps[(jumps > 0.0) & (jumps < duration)]])
    )
    blocks = Blocks(np.zeros(len(edges) - 1, int), edges[:-1], edges[1:])
    bodies, problem = bodies_of(problem.robot, scene or default_scene(problem.robot)), touchable(problem)
    pool = _pool(problem, bodies, motion, blocks, contacts_alone=contacts_alone)
    return tolerated_by(pool, np.array([len(blocks.row) / FIRST]))
