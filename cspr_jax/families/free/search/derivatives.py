"""Equations of a motion at many instants, and their first and second derivatives.

Derivatives are taken by the coordinates and their derivatives in time, of which most results depend on few; those by
the duration, and in normalised time, follow from them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.free.search.determinants import determinant, unit_wrenches, with_derivatives
from cspr_jax.families.free.search.instants import residual_at, state_of
from cspr_jax.numerics.batches import in_batches
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.criteria import judged_poses

if TYPE_CHECKING:
    from jaxtyping import Float

BATCH = 256
# Entries of x behind the coordinates.
SCALARS = 2
# Powers of one over the duration, by which derivatives in normalised time become those in time.
POWERS = np.arange(3.0)


class InstantValues(NamedTuple):
    """Equations of instants, whose residuals are those of the tensions and less other values, and their derivatives.

    Derivatives are by x: the coordinates, their first and second derivatives in normalised time, the duration, and the
    level of the objective, on which the equations do not depend.

    Fields:
        residual: (..., n_equations) without the other values: what tensions miss of the wrench, over the weight; then
            less the other values of the state.
        slope: (..., n_equations, n_x).
        matrix: (..., dof, n_cables) wrenches of unit tensions.
        second_derivative: (..., n_x, n_x) second derivatives of the residuals times multipliers.
        mixed: (..., n_cables, n_x) of the same, by a tension and x.
    """

    residual: Any
    slope: Any
    matrix: Any
    second_derivative: Any
    mixed: Any


@persistent_jit
def _residual_kernel(robot: AnyRobot, limits: Limits, longest: Array | None, instants: tuple[Array, ...]) -> Array:
    def one(reference: Array, place: Array, duration: Array, tensions: Array) -> Array:
        missed = residual_at(robot, limits, reference, _motion(place, duration), tensions)
        if longest is not None:
            missed = jnp.append(missed, -duration / longest)
        if not judged_poses(robot)[0]:
            return missed
        still = jnp.zeros_like(place[0])
        return jnp.append(missed, -determinant(robot, state_of(robot, reference, place[0], still, still)))

    return jax.vmap(one)(*instants)


def _motion(place: Array, duration: Array) -> tuple[Array, Array, Array]:
    # Coordinates and derivatives in time, from those in normalised time, (3, d).
    return tuple(place * (duration**-POWERS)[:, None])


@persistent_jit
def _kernel(robot: AnyRobot, limits: Limits, longest: Array | None, instants: tuple[Array, ...]) -> InstantValues:
    def one(reference: Array, place: Array, duration: Array, tensions: Array, multipliers: Array) -> InstantValues:
        def missed(*motion: Array) -> Array:
            return residual_at(robot, limits, reference, motion, tensions)

        def matrix(place: Array) -> Array:
            still = jnp.zeros_like(place)
            return unit_wrenches(robot, state_of(robot, reference, place, still, still))

        motion = _motion(place, duration)
        residual, d = missed(*motion), place.shape[1]
        slope = jnp.concatenate([jax.jacfwd(missed, k)(*motion) for k in range(3)], axis=1)
        pushes, by_matrix = multipliers[: len(residual)], jnp.zeros((robot.dof, robot.n_cables))
        regular = with_derivatives(matrix, motion[0]) if judged_poses(robot)[0] else None
        if regular is not None:
            by_matrix = -multipliers[-1] * regular.cofactors

        def pushed(*motion: Array) -> Array:
            return jnp.dot(missed(*motion), pushes) + jnp.sum(by_matrix * matrix(motion[0]))

        second_derivative = _bend(pushed, motion)
        mixed = jax.jacfwd(lambda place: multipliers[: robot.dof] @ matrix(place))(motion[0])
        if longest is not None:
            residual, slope = jnp.append(residual, -duration / longest), jnp.pad(slope, [(0, 1), (0, 0)])
        if regular is not None:
            residual = jnp.append(residual, -regular.value)
            slope = jnp.concatenate([slope, jnp.pad(-regular.slope, (0, 2 * d))[None]])
            second_derivative = second_derivative.at[:d, :d].add(-multipliers[-1] * regular.second_derivative)
        slope, second_derivative = _chained(motion, duration, slope, second_derivative, multipliers)
        if longest is not None:
            slope = slope.at[len(pushes), -SCALARS].set(-1.0 / longest)
        return InstantValues(
            residual, slope, matrix(motion[0]), second_derivative, jnp.pad(mixed, [(0, 0), (0, 2 * d + SCALARS)])
        )

    return jax.vmap(one)(*instants)


def _bend(function: Callable[..., Array], motion: Sequence[Array]) -> Array:
    # Second derivatives by all of a motion, (3 d, 3 d): the further one differentiates, the fewer arguments are left.
    parts: list[tuple[Array, ...]] = [jax.jacfwd(jax.grad(function, range(k, 3)), k)(*motion) for k in range(3)]
    return jnp.block([[parts[k][i - k] if k <= i else parts[i][k - i].T for k in range(3)] for i in range(3)])


def _chained(
    motion: Sequence[Array], duration: Array, slope: Array, second_derivative: Array, multipliers: Array
) -> tuple[Array, Array]:
    # Derivatives by coordinates in normalised time, by the duration and by the level, from those by the motion in time.
    d, flat = len(motion[0]), jnp.concatenate(motion)
    power = np.repeat(POWERS, d)
    scale, along = duration**-power, -power * flat / duration
    push = multipliers @ slope
    side = scale * (second_derivative @ along - power * push / duration)
    corner = along @ second_derivative @ along + jnp.dot(push, power * (power + 1.0) * flat) / duration**2
    full: list[list[Any]] = [
        [second_derivative * jnp.outer(scale, scale), side[:, None]],
        [side[None], corner[None, None]],
    ]
    slopes = jnp.concatenate([slope * scale[None], (slope @ along)[:, None]], axis=1)
    return jnp.pad(slopes, [(0, 0), (0, 1)]), jnp.pad(jnp.block(full), (0, 1))


def instant_values(
    robot: AnyRobot, limits: Limits, longest: Float[np.ndarray, ""] | None, *instants: np.ndarray
) -> InstantValues:
    """Equations at many instants."""
    return InstantValues(*_at_all(partial(_kernel, robot, limits, longest), instants))


def residuals(
    robot: AnyRobot, limits: Limits, longest: Float[np.ndarray, ""] | None, *instants: np.ndarray
) -> Float[np.ndarray, "... n_equations"]:
    """Residuals of the equations at many instants, for trials of steps, which need no derivatives."""
    return _at_all(lambda part: (_residual_kernel(robot, limits, longest, part),), instants)[0]


def _at_all(
    kernel: Callable[[tuple[Array, ...]], Sequence[Array]], instants: tuple[np.ndarray, ...]
) -> list[np.ndarray]:
    # Results of a kernel, leaves (..., ...).
    shape = instants[2].shape
    flat = tuple(np.ascontiguousarray(part.reshape(-1, *part.shape[len(shape) :])) for part in instants)
    return [leaf.reshape(*shape, *leaf.shape[1:]) for leaf in in_batches(kernel, flat, batch_size=BATCH)]
