"""Equations of a motion at many samples, and their first and second derivatives.

Derivatives are taken by the coordinates and their derivatives in time, as most results depend on few of them; those by
the duration and by derivatives in normalised time follow from these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.free.search.determinants import determinant, unit_wrenches, with_derivatives
from cspr_jax.families.free.search.equations import residual_at, state_of
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.criteria import pose_conditions

BATCH = 256
# Number of entries of x after the coordinates and their derivatives.
SCALARS = 2
# Powers of 1 / duration that turn derivatives in normalised time into those in time.
POWERS = np.arange(3.0)


class EquationValues(NamedTuple):
    """Residuals at samples, without the parts that depend on other values, and their derivatives.

    Derivatives are by x: the coordinates, their first and second derivatives in normalised time, the duration, and the
    level of the objective; the equations do not depend on the level.

    Fields:
        residual: (..., n_equations) wrench of the tensions minus the required one, over the weight; then, for values
            other than tensions, minus the value of the state, to which the search adds the unknown value.
        jacobian: (..., n_equations, n_x).
        matrix: (..., dof, n_cables) wrenches of unit tensions.
        hessian: (..., n_x, n_x) second derivatives of the residuals times multipliers.
        mixed: (..., n_cables, n_x) second derivatives of the same by a tension and by x.
    """

    residual: Any
    jacobian: Any
    matrix: Any
    hessian: Any
    mixed: Any


@persistent_jit
def _residual_kernel(robot: AnyRobot, limits: Limits, longest: Array | None, samples: tuple[Array, ...]) -> Array:
    def one(reference: Array, normalised: Array, duration: Array, tensions: Array) -> Array:
        missed = residual_at(robot, limits, reference, _motion(normalised, duration), tensions)
        if longest is not None:
            missed = jnp.append(missed, -duration / longest)
        if not pose_conditions(robot)[0]:
            return missed
        zero = jnp.zeros_like(normalised[0])
        return jnp.append(missed, -determinant(robot, state_of(robot, reference, normalised[0], zero, zero)))

    return jax.vmap(one)(*samples)


def _motion(normalised: Array, duration: Array) -> tuple[Array, Array, Array]:
    # Return coordinates and derivatives in time from those in normalised time, (3, d).
    return tuple(normalised * (duration**-POWERS)[:, None])


@persistent_jit
def _kernel(robot: AnyRobot, limits: Limits, longest: Array | None, samples: tuple[Array, ...]) -> EquationValues:
    def one(
        reference: Array, normalised: Array, duration: Array, tensions: Array, multipliers: Array
    ) -> EquationValues:
        def missed(*motion: Array) -> Array:
            return residual_at(robot, limits, reference, motion, tensions)

        def matrix(position: Array) -> Array:
            zero = jnp.zeros_like(position)
            return unit_wrenches(robot, state_of(robot, reference, position, zero, zero))

        motion = _motion(normalised, duration)
        residual, d = missed(*motion), normalised.shape[1]
        jacobian = jnp.concatenate([jax.jacfwd(missed, k)(*motion) for k in range(3)], axis=1)
        duals, by_matrix = multipliers[: len(residual)], jnp.zeros((robot.dof, robot.n_cables))
        regular = with_derivatives(matrix, motion[0]) if pose_conditions(robot)[0] else None
        if regular is not None:
            by_matrix = -multipliers[-1] * regular.cofactors

        def lagrangian(*motion: Array) -> Array:
            return jnp.dot(missed(*motion), duals) + jnp.sum(by_matrix * matrix(motion[0]))

        hessian = _hessian(lagrangian, motion)
        mixed = jax.jacfwd(lambda position: multipliers[: robot.dof] @ matrix(position))(motion[0])
        if longest is not None:
            residual, jacobian = jnp.append(residual, -duration / longest), jnp.pad(jacobian, [(0, 1), (0, 0)])
        if regular is not None:
            residual = jnp.append(residual, -regular.value)
            jacobian = jnp.concatenate([jacobian, jnp.pad(-regular.gradient, (0, 2 * d))[None]])
            hessian = hessian.at[:d, :d].add(-multipliers[-1] * regular.hessian)
        jacobian, hessian = _chained(motion, duration, jacobian, hessian, multipliers)
        if longest is not None:
            jacobian = jacobian.at[len(duals), -SCALARS].set(-1.0 / longest)
        return EquationValues(
            residual, jacobian, matrix(motion[0]), hessian, jnp.pad(mixed, [(0, 0), (0, 2 * d + SCALARS)])
        )

    return jax.vmap(one)(*samples)


def _hessian(function: Callable[..., Array], motion: Sequence[Array]) -> Array:
    # Return second derivatives by coordinates, velocities and accelerations, (3 d, 3 d); each pair is computed once.
    parts: list[tuple[Array, ...]] = [jax.jacfwd(jax.grad(function, range(k, 3)), k)(*motion) for k in range(3)]
    return jnp.block([[parts[k][i - k] if k <= i else parts[i][k - i].T for k in range(3)] for i in range(3)])


def _chained(
    motion: Sequence[Array], duration: Array, jacobian: Array, hessian: Array, multipliers: Array
) -> tuple[Array, Array]:
    # Convert derivatives by the motion in time to those by coordinates in normalised time, duration and level.
    d, flat = len(motion[0]), jnp.concatenate(motion)
    power = np.repeat(POWERS, d)
    scale, along = duration**-power, -power * flat / duration
    gradient = multipliers @ jacobian
    side = scale * (hessian @ along - power * gradient / duration)
    corner = along @ hessian @ along + jnp.dot(gradient, power * (power + 1.0) * flat) / duration**2
    blocks: list[list[Any]] = [
        [hessian * jnp.outer(scale, scale), side[:, None]],
        [side[None], corner[None, None]],
    ]
    chained = jnp.concatenate([jacobian * scale[None], (jacobian @ along)[:, None]], axis=1)
    return jnp.pad(chained, [(0, 0), (0, 1)]), jnp.pad(jnp.block(blocks), (0, 1))


def equation_values(
    robot: AnyRobot, limits: Limits, longest: Float[np.ndarray, ""] | None, *samples: np.ndarray
) -> EquationValues:
    """Equations at many samples."""
    return EquationValues(*_at_all(partial(_kernel, robot, limits, longest), samples))


def residuals(
    robot: AnyRobot, limits: Limits, longest: Float[np.ndarray, ""] | None, *samples: np.ndarray
) -> Float[np.ndarray, "... n_equations"]:
    """Residuals of the equations at many samples, without derivatives, for trials of steps."""
    return _at_all(lambda part: (_residual_kernel(robot, limits, longest, part),), samples)[0]


def _at_all(
    kernel: Callable[[tuple[Array, ...]], Sequence[Array]], samples: tuple[np.ndarray, ...]
) -> list[np.ndarray]:
    # Call a kernel on flattened samples; return leaves (..., ...).
    shape = samples[2].shape
    flat = tuple(np.ascontiguousarray(part.reshape(-1, *part.shape[len(shape) :])) for part in samples)
    return [values.reshape(*shape, *values.shape[1:]) for values in in_batches(kernel, flat, batch_size=BATCH)]
