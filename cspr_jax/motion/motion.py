"""Motion of an effector: what every trajectory family provides, and what plans, margins, peaks and files take.

A motion is a pytree that holds its own amplitude function, number of arcs and depth of P0, so that it can be jitted,
vmapped and differentiated. Normalised time tau runs from 0 to 1.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, Protocol, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.formulas import HasFormulas, MotionPiece, backwards
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds import state_bounds
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model import state as states
from cspr_jax.robots.model.state import State
from cspr_jax.runtime.persistent_jit import persistent_jit

# Number of states that are computed at once.
STATES = 64
# Relative distance in time of the sample just before two pieces meet.
BESIDE = 4.0 * np.finfo(float).eps

jax.tree_util.register_dataclass(Frame, ["signs", "origin", "rest"], [])


class Motion(Protocol):
    """Motion over normalised time."""

    @property
    def z0(self) -> Array:
        """Depth of P0, at which slacks are normalised, below the centroid of the spools, () m."""

    def duration(self) -> Array:
        """Duration T.

        Returns:
            () s.
        """
        ...

    def state(self, tau: Array) -> State:
        """State at one time, with derivatives in time.

        Args:
            tau: () normalised time in [0, 1].

        Returns:
            the state.
        """
        ...

    def breaks(self) -> Array:
        """Times at which the acceleration or its derivative may jump.

        Returns:
            (n,) tau in ]0, 1[, increasing.
        """
        ...


class BoundedMotion(Motion, Protocol):
    """Motion with bounds of its states over blocks of time, so that verdicts on it can be proved between samples."""

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states over blocks of time.

        Args:
            start: (k,) s, in any order.
            end: (k,) s, later than `start`.

        Returns:
            the bounds, leaves (k, ...).
        """
        ...


Kind = TypeVar("Kind", bound=Motion)


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Backwards(Generic[Kind]):
    """Motion run from its end to its start; see `Motion`.

    Fields:
        motion: the motion.
    """

    motion: Kind

    @property
    def z0(self) -> Array:
        """Depth of P0; see `Motion.z0`."""
        return self.motion.z0

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.motion.duration()

    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""
        return states.backwards(self.motion.state(1.0 - tau))

    def breaks(self) -> Array:
        """Breaks; see `Motion.breaks`."""
        return jnp.flip(1.0 - self.motion.breaks())

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states, of a motion that has them; see `BoundedMotion.bounds`."""
        full, motion = float(self.duration()), cast(BoundedMotion, self.motion)
        return state_bounds.backwards(motion.bounds(full - end, full - start))

    def formulas(self) -> list[MotionPiece]:
        """Formulas, of a motion that knows them; see `motion.formulas.HasFormulas`."""
        return backwards(cast(HasFormulas, self.motion).formulas())


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Placed(Generic[Kind]):
    """Motion in the axes of a robot file; see `Motion`.

    Fields:
        motion: in the kernels' axes: from the centroid of the spools, z down.
        frame: of the robot.
    """

    motion: Kind
    frame: Frame

    @property
    def z0(self) -> Array:
        """Depth of P0; see `Motion.z0`."""
        return self.motion.z0

    @jax.jit
    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.motion.duration()

    @jax.jit
    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""
        return outward(self.frame, self.motion.state(tau))

    def breaks(self) -> Array:
        """Breaks; see `Motion.breaks`."""
        return self.motion.breaks()


def sample_times(motion: Motion, count: int, each: int = 4) -> Float[np.ndarray, "n"]:
    """Normalised times at which extremes are searched for: equidistant ones, and some in each piece and at its ends."""
    breaks = np.asarray(motion.breaks(), float)
    edges = np.concatenate([[0.0], breaks, [1.0]])
    inner = edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0.0, 1.0, each + 1)[1:-1]
    parts = np.linspace(0.0, 1.0, count), inner.ravel(), breaks, breaks * (1.0 - BESIDE)
    return np.sort(np.clip(np.concatenate(parts), 0.0, 1.0))


def common_shape(motion: Kind) -> Kind:
    """The same motion, its pieces padded to a usual number so that motions share compiled code."""
    return jax.tree.map(lambda part: part.padded() if _is_in_pieces(part) else part, motion, is_leaf=_is_in_pieces)


def has_pieces(motion: Motion) -> bool:
    """Tell whether a motion consists of pieces, possibly of very many."""
    return any(map(_is_in_pieces, jax.tree.leaves(motion, is_leaf=_is_in_pieces)))


def _is_in_pieces(part: Any) -> bool:
    return hasattr(part, "padded")


def states_at(motion: Motion, tau: Float[np.ndarray, "k"], batch_size: int = STATES) -> State:
    """States of a motion at many times."""
    state: Any = in_batches(partial(_states, common_shape(motion)), tau, batch_size=batch_size)
    return state


@persistent_jit
def _states(motion: Motion, tau: Array) -> State:
    return jax.vmap(motion.state)(tau)


def inward(frame: Frame, state: State) -> State:
    """State in the kernels' axes, from the axes of a robot file."""
    # The rotation between the axes is its own inverse.
    position: Any = frame.inward(state.position)
    return outward(frame, state)._replace(position=position)


def outward(frame: Frame, state: State) -> State:
    """State in the axes of a robot file."""
    vector, tensor, quaternion = frame.rotated, frame.rotated_tensor, frame.rotated_quaternions
    # In the order of the fields of a state; a point mass has no orientation.
    changes: tuple[Callable[..., Any], ...] = (frame.outward, vector, vector, tensor, vector, vector, quaternion)
    return State(*(value if value is None else change(value) for change, value in zip(changes, state, strict=True)))
