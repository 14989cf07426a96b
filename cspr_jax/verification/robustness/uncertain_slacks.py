"""Slacks of all robots within an uncertainty, over blocks of time: proved positive, or broken by one of these robots.

Spools and the mass centre lie in balls around their places. What is proved rests on the tensions of
`robots.bounds.uncertain_tensions`, for the smallest and the largest mass: sums of the tensions of both, in proportion,
serve all masses between. Lengths change by no more than spools do; unit vectors of cables stay in cones, which bounds
rates, accelerations and clearances. Determinant and depth are judged for the planned robot alone.

What is refuted rests on the slacks of single robots at instants, displaced along differences of these slacks.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.limits import limits_set
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, norm
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.bounds.contact_bounds import contact_bounds
from cspr_jax.robots.bounds.state_bounds import CableBounds, StateBounds, attachments, balance_bounds, cable_bounds
from cspr_jax.robots.bounds.uncertain_tensions import UncertainTensions, centre_wrench, uncertain_tensions, with_mass
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.contacts.contact_bodies import Bodies
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.block_slacks import limit_slacks, tension_slacks

if TYPE_CHECKING:
    from jaxtyping import Float

# Displacement by which differences are taken, over the length of a cable; criteria of which the worst one is sought.
STEP, NEAREST = 1e-6, 2
BATCH = 256  # robots at instants


class Share(NamedTuple):
    """A multiple of an uncertainty, one for each block, or of one.

    Fields:
        spools: (k,) or () largest displacement of a spool, m.
        centre: (k,) or () likewise of the mass centre, m.
        factor: (k,) or () of the mass.
    """

    spools: Array
    centre: Array
    factor: Array


def share_of(limits: Limits, multiple: Float[np.ndarray, "k"]) -> Share:
    """Multiples of an uncertainty."""
    uncertainty: Any = limits.uncertainty
    with np.errstate(over="ignore"):
        factor = as_float64(float(uncertainty.mass_factor) ** multiple)
    spools, centre = (
        as_float64(multiple * float(size)) for size in (uncertainty.spool_positions, uncertainty.mass_centre)
    )
    return Share(spools, centre, factor)


@persistent_jit(static_argnames="contacts_alone", compiler_options=compile_options.least())
def blocks_hold(
    robot: AnyRobot, limits: Limits, bodies: Bodies, cases: tuple[StateBounds, Share], *, contacts_alone: bool = False
) -> Float[Array, "k"]:
    """Prove that all robots keep taut cables, limits and distances throughout blocks."""

    def one(state: StateBounds, fraction: Share) -> Array:
        cables = cable_bounds(robot, state)
        parts = [] if contacts_alone else _cable_slacks(robot, limits, state, cables, fraction)
        turn = jnp.arcsin(fraction.spools / cables.length.low())
        wide = cables._replace(
            exit=_wider(cables.exit, fraction.spools),
            direction=_wider(cables.direction, turn[:, None]),
            length=_wider(cables.length, fraction.spools),
        )
        apart = contact_bounds(robot, bodies, state, wide)[0]
        is_met = (jnp.concatenate(parts) > 0.0).all() if parts else jnp.ones((), bool)
        return is_met & ((apart > 0.0).all() | (fraction.spools == 0.0))

    return jax.vmap(one)(*cases)


@persistent_jit(compiler_options=compile_options.least())
def lower_slacks(robot: AnyRobot, limits: Limits, cases: tuple[StateBounds, Share]) -> Float[Array, "k n_slacks"]:
    """Lower bounds of the slacks of tensions and limits of all robots over blocks."""

    def one(state: StateBounds, fraction: Share) -> Array:
        slacks = jnp.concatenate(_cable_slacks(robot, limits, state, cable_bounds(robot, state), fraction))
        return jnp.where(jnp.isnan(slacks), -jnp.inf, slacks)

    return jax.vmap(one)(*cases)


def _wider(bounds: AffineBounds, radius: Array) -> AffineBounds:
    return bounds._replace(radius=bounds.radius + radius)


def _cable_slacks(
    robot: AnyRobot, limits: Limits, state: StateBounds, cables: CableBounds, fraction: Share
) -> list[Array]:
    # Bound the slacks of tensions, and of the limits of lengths, speeds and accelerations, from below, with the unit
    # vectors u' of cables at most `turn` from u.
    low, high = tension_range(robot, limits)

    def at_mass(ratio: Array) -> UncertainTensions:
        other = with_mass(robot, ratio)
        return uncertain_tensions(other, state, cables, (low, high), (fraction.spools, fraction.centre))

    tensions = jax.vmap(at_mass)(jnp.stack([1.0 / fraction.factor, fraction.factor]))
    parts = [jnp.min(tensions.low - low[None], axis=0)]
    parts += [] if limits.tension_max is None else [jnp.min(high[None] - tensions.high, axis=0)]
    parts = [jnp.min(jnp.concatenate(parts), keepdims=True)] if robot.n_cables > robot.dof else parts
    maximum = _largest(robot, limits, state, cables, fraction.spools)
    for row in limits_set(limits):
        if row.quantity != "tension":
            limit = jnp.broadcast_to(getattr(limits, row.name), robot.n_cables if row.per_cable else 1)
            parts.append(limit - maximum.get(row.quantity, jnp.full(limit.shape, -jnp.inf)))
    return parts


def _largest(
    robot: AnyRobot, limits: Limits, state: StateBounds, cables: CableBounds, spools: Array
) -> dict[str, Array]:
    # Bound the lengths, speeds and accelerations of the cables of all robots from above.
    lengths = {"length": cables.length.high() + spools}
    if limits.cable_speed_max is None and limits.cable_acceleration_max is None:
        return lengths
    _, _, velocity, pull = attachments(robot, state)
    near, speed = cables.length.low(), cables.rate.magnitude()
    sine = spools / near
    slowest = jnp.maximum(0.0, jnp.maximum(cables.rate.low(), -cables.rate.high()))
    square = jnp.maximum(norm(velocity).high() ** 2 - slowest**2, 0.0)
    faster = sine * jnp.sqrt(square) + (1.0 - jnp.sqrt(1.0 - sine**2)) * speed
    # With q = v^2 - rate^2, of length q / l + u pull: q' / l' - q / l, and (u' - u) pull.
    short = jnp.where(near > spools, near - spools, jnp.nan)
    more = faster * (2.0 * speed + faster) / short + square * spools / (near * short)
    more += jnp.arcsin(sine) * norm(pull).high()
    return lengths | {"speed": speed + faster, "acceleration": cables.acceleration.magnitude() + more}


@persistent_jit(static_argnames="contacts_alone", compiler_options=compile_options.least())
def _upper_slacks(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    cases: tuple[StateBounds, Array, Array],
    *,
    contacts_alone: bool,
) -> Array:
    # Upper bounds of slacks, (k, n_slacks), at instants, of robots whose spools and mass centre are moved, (k, n_cables
    # + 1, 3) m, and whose masses are multiples of the planned one, (k,).
    def one(state: StateBounds, moved: Array, ratio: Array) -> Array:
        other = with_mass(dataclasses.replace(robot, base_points=robot.base_points + moved[:-1]), ratio)
        cables, unit = cable_bounds(other, state), 1.0 / wrench_units(robot)
        parts: list[tuple[Array, ...]] = [contact_bounds(other, bodies, state, cables)]
        if not contacts_alone:
            matrix, wrench = balance_bounds(other, state, cables)
            wrench = wrench + centre_wrench(other, state, moved[-1])
            parts += tension_slacks(other, limits, matrix * unit[:, None], wrench * unit)
            parts += limit_slacks(limits, state, cables)
        high = jnp.concatenate([part[1] for part in parts])
        return jnp.where(jnp.isnan(high), jnp.inf, high)

    return jax.vmap(one)(*cases)


def _of_robots(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    states: StateBounds,
    moved: np.ndarray,
    ratio: np.ndarray,
    *,
    contacts_alone: bool,
) -> np.ndarray:
    # Upper bounds of slacks, (k, m, n_slacks), of m robots at each of k instants.
    shape = moved.shape[:2]
    repeated = jax.tree.map(lambda x: np.repeat(x, shape[1], axis=0), states)
    cases = repeated, moved.reshape(-1, *moved.shape[2:]), ratio.reshape(-1)
    kernel = partial(_upper_slacks, robot, limits, bodies, contacts_alone=contacts_alone)
    return in_batches(kernel, cases, batch_size=BATCH).reshape(*shape, -1)


def worst_ways(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    states: StateBounds,
    fraction: Share,
    *,
    contacts_alone: bool = False,
) -> Float[np.ndarray, "k 2 n_cables+1 3"]:
    """Unit displacements that are worst, to first order, for the criteria that an uncertainty breaks first."""
    count = robot.n_cables + 1
    rays = np.asarray(robot.base_points)[None] - states.position.middle[:, None]
    step = STEP * np.linalg.norm(rays, axis=2).max(1)[:, None, None, None]
    # The planned robot comes first.
    moves = np.eye(3 * count + 1, 3 * count, -1).reshape(1, -1, count, 3)
    ratio = np.ones((len(step), 3 * count + 1))
    high = _of_robots(robot, limits, bodies, states, step * moves, ratio, contacts_alone=contacts_alone)
    with np.errstate(invalid="ignore", divide="ignore"):
        slopes = np.swapaxes(high[:, 1:] - high[:, :1], 1, 2).reshape(len(step), -1, count, 3) / step
        slopes = np.where(np.isfinite(slopes), slopes, 0.0)
        sizes = np.linalg.norm(slopes, axis=3)
        room = high[:, 0] / (
            sizes[..., :-1].sum(2) * fraction.spools[:, None] + sizes[..., -1] * fraction.centre[:, None]
        )
        first = np.argsort(np.where(np.isfinite(room), room, np.inf), axis=1)[
            :, np.minimum(np.arange(NEAREST), room.shape[1] - 1)
        ]
        ways = -slopes / np.where(sizes > 0.0, sizes, 1.0)[..., None]
    return np.take_along_axis(ways, first[..., None, None], axis=1)


def instants_fail(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    states: StateBounds,
    fraction: Share,
    ways: np.ndarray,
    *,
    contacts_alone: bool = False,
) -> Float[np.ndarray, "k"]:
    """Tell at which instants a robot that is displaced, light or heavy, breaks a criterion."""
    radii = np.repeat(np.stack([fraction.spools, fraction.centre], axis=1), [robot.n_cables, 1], axis=1)
    moved = np.repeat(radii[:, None, :, None] * ways, 2, axis=1)
    ratio = np.tile(np.stack([1.0 / fraction.factor, fraction.factor], axis=1), (1, ways.shape[1]))
    return _of_robots(robot, limits, bodies, states, moved, ratio, contacts_alone=contacts_alone).min((1, 2)) < 0.0
