"""Scatter of landings due to errors of the winches and of the time of release, by random sampling and to first order.

At the release, lengths and rates of the cables differ from the plan's. The effector is at the position and has the
velocity that these lengths and rates determine; redundant cables, whose errors contradict each other, determine them
by least squares. From there the object flies to the height of its target. A random sample of errors gives a sample of
landings; the derivatives of the landing with respect to all errors give the covariance for small errors.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors.given_numbers import Numbers, checked_integer
from cspr_jax.errors.suggestions import with_suggestions
from cspr_jax.launch.flight import flown
from cspr_jax.motion.motion import Motion
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import solved
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import PointMassRobot, is_planar
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.force_balance import cable_motion

BATCH = 1024
NEWTON_STEPS = 12
# As for the keys of a plan file.
LARGEST_ERROR = 1e3
MAX_THROWS = 1_000_000
LARGEST_SEED = 2**63 - 1


class Throw(NamedTuple):
    """Planned release.

    Fields:
        motions: consecutive motions, z down; the object is released at the end of one or before.
        release: () time of release since the start of the first motion, s.
        target: (3,) m; the object lands at its height.
    """

    motions: tuple[Motion, ...]
    release: Any
    target: Any


@with_suggestions
@dataclasses.dataclass(frozen=True)
class LaunchErrors:
    """Independent errors of a launch.

    Fields:
        release: standard deviation of the time of release, s.
        cable_length: standard deviation of the length of each cable at the release, m.
        cable_speed: standard deviation of the rate of each cable's length, m/s.
        encoder: largest error of each length due to the resolution of its encoder, m; errors are uniformly distributed.
        throws: number of throws in the sample.
        seed: seed of the random sample.
    """

    release: float = 0.0
    cable_length: float = 0.0
    cable_speed: float = 0.0
    encoder: float = 0.0
    throws: int = 10_000
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse numbers out of their ranges."""
        for name in ("release", "cable_length", "cable_speed", "encoder"):
            Numbers("a number from 0 to 1000", minimum=0.0, maximum=LARGEST_ERROR).array(name, getattr(self, name))
        checked_integer("throws", self.throws, 2, MAX_THROWS)
        checked_integer("seed", self.seed, 0, LARGEST_SEED)


@dataclasses.dataclass(frozen=True)
class Scatter:
    """Landings of a sample of throws, their covariance, and the covariance to first order.

    Fields:
        landings: (throws, 2) x and y relative to the target, m; NaN where the object never comes to its height.
        covariance: (2, 2) covariance of the sample, m^2.
        first_order: (2, 2) covariance for small errors, by derivatives, m^2.
    """

    landings: np.ndarray
    covariance: np.ndarray
    first_order: np.ndarray

    def to_dict(self) -> dict[str, Any]:
        """Figures of the scatter."""
        landed = self.landings[np.isfinite(self.landings).all(1)]
        distances = np.linalg.norm(landed, axis=1)
        return {
            "throws": len(self.landings),
            "missed": len(self.landings) - len(landed),
            "mean": landed.mean(0).tolist(),
            "covariance": self.covariance.tolist(),
            "covariance_first_order": self.first_order.tolist(),
            "mean_error": float(distances.mean()),
            "standard_deviation": float(distances.std()),
            "largest_error": float(distances.max()),
        }


def state_at(throw: Throw, late: Float[Array, ""]) -> State:
    """State of the effector some time after the planned release, at rest before the first and after the last motion."""
    # Times of single motions are not clipped between them: clipping halves the derivative of a release at a waypoint.
    time = jnp.maximum(throw.release + late, 0.0)
    *others, last = throw.motions
    states, starts = [], []
    for motion in others:
        states.append(motion.state(time / motion.duration()))
        time = time - motion.duration()
        starts.append(time)
    state = last.state(jnp.minimum(time / last.duration(), 1.0))
    for before, since in zip(reversed(states), reversed(starts), strict=True):
        state = jax.tree.map(partial(jnp.where, since > 0.0), state, before)
    return state


def landing(robot: PointMassRobot, throw: Throw, errors: Array) -> Float[Array, "2"]:
    """Landing of one throw."""
    count = robot.n_cables
    state = state_at(throw, errors[0])
    lengths, rates, _ = cable_motion(robot, *state[:3])
    position = _placed(robot, state.position, lengths + errors[1 : count + 1])
    velocity = _moving(robot, position, rates + errors[count + 1 :])
    height, gravity = throw.target[2] - position[2], robot.gravity
    time = (jnp.sqrt(velocity[2] ** 2 + 2.0 * gravity * height) - velocity[2]) / gravity
    return flown(position, velocity, gravity, time)[0][:2] - throw.target[:2]


def _placed(robot: PointMassRobot, start: Array, lengths: Array) -> Array:
    # Find the position with these cable lengths by Newton's method; its last step carries the derivatives.
    def step(position, _):
        current_lengths = cable_motion(robot, position, position * 0.0, position * 0.0)[0]
        return position + _moving(robot, position, lengths - current_lengths), None

    return jax.lax.scan(step, start, None, length=NEWTON_STEPS)[0]


def _moving(robot: PointMassRobot, position: Array, rates: Array) -> Array:
    # Return the velocity that gives these rates; on redundant cables, by least squares.
    units = jax.jacfwd(lambda velocity: cable_motion(robot, position, velocity, velocity * 0.0)[1])(position * 0.0)
    units = units[:, np.array([0, 2])] if is_planar(robot) else units
    if robot.n_cables > robot.dof:
        units, rates = units.T @ units, units.T @ rates
    velocity = solved(units, rates[:, None])[0][:, 0]
    if not is_planar(robot):
        return velocity
    x, z = velocity
    return jnp.stack([x, jnp.zeros_like(x), z])


@jax.jit
def _landings(robot: PointMassRobot, throw: Throw, errors: Array) -> Array:
    return jax.vmap(lambda error: landing(robot, throw, error))(errors)


@jax.jit
def _derivatives(robot: PointMassRobot, throw: Throw, errors: Array) -> Array:
    return jax.jacfwd(lambda error: landing(robot, throw, error))(errors)


def scatter(robot: PointMassRobot, throw: Throw, errors: LaunchErrors) -> Scatter:
    """Scatter of the landings of a launch."""
    count, random = robot.n_cables, np.random.default_rng(errors.seed)
    # All kinds of errors are always drawn, then scaled: so larger errors of one kind scale the same sample.
    release = random.normal(size=(errors.throws, 1)) * errors.release
    lengths = random.normal(size=(errors.throws, count)) * errors.cable_length
    rates = random.normal(size=(errors.throws, count)) * errors.cable_speed
    lengths = lengths + random.uniform(-1.0, 1.0, size=(errors.throws, count)) * errors.encoder
    sample = np.concatenate([release, lengths, rates], axis=1)
    landings = in_batches(partial(_landings, robot, throw), sample, batch_size=BATCH)
    landed = landings[np.isfinite(landings).all(1)]
    variances = [errors.release**2]
    variances += [errors.cable_length**2 + errors.encoder**2 / 3.0] * count + [errors.cable_speed**2] * count
    derivatives = np.asarray(_derivatives(robot, throw, jnp.zeros(1 + 2 * count)))
    covariance = np.cov(landed.T) if len(landed) > 1 else np.full((2, 2), np.nan)
    return Scatter(landings, covariance, (derivatives * np.array(variances)) @ derivatives.T)
