"""Predicted measurements at a pose, and their derivatives, by the package's own lengths of cables."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.machine.calibration.measurements import Measurements
from cspr_jax.machine.calibration.parameters import LOCAL, SHIFT, TARGET, TRACKER, TURN, Parameters, with_common
from cspr_jax.machine.calibration.setups import EffectorPoses, Setup, coordinates, turning_axes, with_rotation
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.linear.rotations import conjugate, matrix, product
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.winches import motor_angles
from cspr_jax.robots.statics.cable_lengths import moved_lengths
from cspr_jax.runtime.persistent_jit import persistent_jit

BATCH = 64
# Poses are few: a program that takes longer, but a third of the time to compile.
QUICKLY = {"xla_backend_optimization_level": 0}


class Linearised(NamedTuple):
    """Residuals of k poses, whitened, and their derivatives; 0 where nothing was measured.

    Fields:
        residuals: (k, m) predicted minus measured.
        by_parameters: (k, m, p) 1/m.
        by_pose: (k, m, d) 1/m.
    """

    residuals: np.ndarray
    by_parameters: np.ndarray
    by_pose: np.ndarray


def readings_at(setup: Setup, position: Array, quaternion: Array, *, are_angles: bool) -> Float[Array, "n_cables"]:
    """Readings at a pose."""
    robot = setup.robot
    arms = jnp.zeros_like(robot.base_points)
    if isinstance(robot, PlatformRobot):
        arms = robot.platform_points @ matrix(quaternion).T
    zeros = jnp.zeros_like(arms)
    lengths = moved_lengths(robot, position[None] + arms, zeros, zeros)[0]
    if not are_angles or robot.winches is None:
        return lengths - setup.offsets
    winches = dataclasses.replace(robot.winches, zero_length=robot.winches.zero_length + setup.offsets)
    return motor_angles(winches, lengths)


def tracked(setup: Setup, position: Array, quaternion: Array) -> tuple[Float[Array, "3"], Float[Array, "4"]]:
    """Position and orientation that the tracker sees at a pose."""
    point = position + matrix(quaternion) @ setup.target
    return matrix(setup.orientation) @ point + setup.shift, product(setup.orientation, quaternion)


@partial(jax.jit, static_argnames=("are_angles",))
def readings_of(setup: Setup, poses: EffectorPoses, *, are_angles: bool) -> Float[Array, "k n_cables"]:
    """Readings at poses."""
    return jax.vmap(lambda pose: readings_at(setup, *pose, are_angles=are_angles))(poses)


@jax.jit
def tracked_poses(setup: Setup, poses: EffectorPoses) -> tuple[Float[Array, "k 3"], Float[Array, "k 4"]]:
    """Positions and orientations that the tracker sees at poses."""
    return jax.vmap(lambda pose: tracked(setup, *pose))(poses)


@persistent_jit(static_argnames=("are_angles",), compiler_options=QUICKLY)
def _linearised(setup: Setup, axes: Array, turns: Array, batch: tuple, *, are_angles: bool) -> tuple[Array, Array]:
    n_columns = LOCAL + TRACKER + axes.shape[1]

    def residuals(step: Array, pose: EffectorPoses, measured: tuple[Array, Array, Array]) -> Array:
        # Steps in numbers that all cables share: each reading depends on the numbers of its own cable alone.
        common, tracker, coordinate = jnp.split(step, [LOCAL, LOCAL + TRACKER])
        current = with_common(setup, common)._replace(
            orientation=with_rotation(setup.orientation, tracker[TURN], first=False),
            shift=setup.shift + tracker[SHIFT],
            target=setup.target + tracker[TARGET],
        )
        move = axes @ coordinate
        position, quaternion = pose.positions + move[:3], with_rotation(pose.quaternions, move[3:], first=True)
        readings = (readings_at(current, position, quaternion, are_angles=are_angles) - measured[0]) * setup.per_reading
        point, orientation = tracked(current, position, quaternion)
        difference = product(conjugate(measured[2]), orientation)
        rotation = 2.0 * jnp.where(difference[0] < 0.0, -1.0, 1.0) * (turns @ difference[1:])
        return jnp.concatenate([readings, point - measured[1], rotation])

    def at(pose: EffectorPoses, measured: tuple[Array, Array, Array]) -> tuple[Array, Array]:
        zero = jnp.zeros(n_columns)
        return residuals(zero, pose, measured), jax.jacfwd(residuals)(zero, pose, measured)

    return jax.vmap(at)(*batch)


@dataclasses.dataclass(frozen=True)
class Predictor:
    """Residuals of measurements.

    Fields:
        parameters: unknown numbers.
        measurements: what was measured.
        axes: (6, d) coordinates of a pose.
        turns: (3, 3) axes about which the effector turns, rows of zeros behind them.
        is_used: (k, m) residuals that exist.
    """

    parameters: Parameters
    measurements: Measurements
    axes: np.ndarray
    turns: np.ndarray
    is_used: np.ndarray

    def __call__(self, setup: Setup, poses: EffectorPoses) -> Linearised:
        """Residuals and derivatives at poses."""
        data, n_cables = self.measurements, setup.robot.n_cables
        measured = tuple(np.nan_to_num(x) for x in (data.readings, data.positions, data.quaternions))
        values, derivatives = in_batches(
            lambda batch: _linearised(setup, self.axes, self.turns, batch, are_angles=data.are_angles),
            (EffectorPoses(*poses), measured),
            batch_size=BATCH,
        )
        # A residual that does not exist may be no number: a product with 0 would be none either.
        derivatives = np.where(self.is_used[:, :, None], derivatives / data.scales(n_cables)[:, None], 0.0)
        by_cables = np.einsum("kij,ijp->kip", derivatives[:, :n_cables, :LOCAL], self.parameters.of_cables)
        by_tracker = derivatives[:, n_cables:, LOCAL : LOCAL + TRACKER] @ self.parameters.of_tracker
        return Linearised(
            np.where(self.is_used, values / data.scales(n_cables), 0.0),
            np.concatenate([by_cables, by_tracker], axis=1),
            derivatives[:, :, LOCAL + TRACKER :],
        )


def predictor(setup: Setup, parameters: Parameters, measurements: Measurements, axes: tuple[int, ...]) -> Predictor:
    """Residuals of measurements of a setup, of positions along some axes."""
    turns = turning_axes(setup.robot)
    rows = np.concatenate([turns, np.zeros((3 - len(turns), 3))])
    is_used = measurements.is_measured(axes, len(turns))
    return Predictor(parameters, measurements, coordinates(setup.robot), rows, is_used)
