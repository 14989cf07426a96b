"""Slacks of all robots within an uncertainty, over blocks of time: proved positive, or refuted by one of these robots.

Spools and the mass centre lie in balls around their positions. Proofs rest on the tensions of
`robots.bounds.uncertain_tensions`, for the smallest and the largest mass: weighted means of both tensions serve all
masses between. Lengths change by no more than the spools move; unit vectors of cables stay in cones, which bounds
rates, accelerations and clearances. Determinant and depth are checked for the planned robot alone.

Refutations rest on slacks of single robots in single states, displaced along gradients of these slacks.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.limits import limits_set
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, norm
from cspr_jax.numerics.elementary import as_float64, minimum_of
from cspr_jax.numerics.shapes import Bool, Float
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

STEP = 1e-6  # displacement for finite differences, over the length of a cable
NEAREST = 2  # number of criteria, those that would fail first, for which worst displacements are computed
BATCH = 256  # number of robots in single states of a batch


class Radii(NamedTuple):
    """Multiple of an uncertainty, for each of k blocks or for one.

    Fields:
        spools: (k,) or () largest displacement of a spool, m.
        centre: (k,) or () largest displacement of the mass centre, m.
        factor: (k,) or () largest factor of the mass.
    """

    spools: Array
    centre: Array
    factor: Array


def radii_of(limits: Limits, multiple: Float[np.ndarray, "k"]) -> Radii:
    """Multiples of an uncertainty."""
    uncertainty: Any = limits.uncertainty
    with np.errstate(over="ignore"):
        factor = as_float64(float(uncertainty.mass_factor) ** multiple)
    spools, centre = (
        as_float64(multiple * float(radius)) for radius in (uncertainty.spool_positions, uncertainty.mass_centre)
    )
    return Radii(spools, centre, factor)


@persistent_jit(static_argnames="contacts_alone", compiler_options=compile_options.proof_options())
def blocks_hold(
    robot: AnyRobot, limits: Limits, bodies: Bodies, cases: tuple[StateBounds, Radii], *, contacts_alone: bool = False
) -> Float[Array, "k"]:
    """Prove that all robots keep taut cables, limits and distances throughout blocks."""

    def one(state: StateBounds, radii: Radii) -> Array:
        cables = cable_bounds(robot, state)
        parts = [] if contacts_alone else _cable_slacks(robot, limits, state, cables, radii)
        turn = jnp.arcsin(radii.spools / cables.length.low())
        wide = cables._replace(
            exit=_wider(cables.exit, radii.spools),
            direction=_wider(cables.direction, turn[:, None]),
            length=_wider(cables.length, radii.spools),
        )
        distances = contact_bounds(robot, bodies, state, wide)[0]
        is_met = (jnp.concatenate(parts) > 0.0).all() if parts else jnp.ones((), bool)
        return is_met & ((distances > 0.0).all() | (radii.spools == 0.0))

    return jax.vmap(one)(*cases)


@persistent_jit(compiler_options=compile_options.proof_options())
def lower_slacks(robot: AnyRobot, limits: Limits, cases: tuple[StateBounds, Radii]) -> Float[Array, "k n_slacks"]:
    """Lower bounds of the slacks of tensions and limits of all robots over blocks."""

    def one(state: StateBounds, radii: Radii) -> Array:
        slacks = jnp.concatenate(_cable_slacks(robot, limits, state, cable_bounds(robot, state), radii))
        return jnp.where(jnp.isnan(slacks), -jnp.inf, slacks)

    return jax.vmap(one)(*cases)


def _wider(bounds: AffineBounds, radius: Array) -> AffineBounds:
    return bounds._replace(radius=bounds.radius + radius)


def _cable_slacks(
    robot: AnyRobot, limits: Limits, state: StateBounds, cables: CableBounds, radii: Radii
) -> list[Array]:
    # Bound the slacks of tensions, and of limits of lengths, speeds and accelerations, from below; the unit vectors u'
    # of cables are at a distance of at most `turn` from u.
    low, high = tension_range(robot, limits)

    def at_mass(ratio: Array) -> UncertainTensions:
        other = with_mass(robot, ratio)
        return uncertain_tensions(other, state, cables, (low, high), (radii.spools, radii.centre))

    tensions = jax.vmap(at_mass)(jnp.stack([1.0 / radii.factor, radii.factor]))
    parts = [minimum_of(tensions.low - low[None], axis=0)]
    parts += [] if limits.tension_max is None else [minimum_of(high[None] - tensions.high, axis=0)]
    parts = [minimum_of(jnp.concatenate(parts), keepdims=True)] if robot.n_cables > robot.dof else parts
    maximum = _largest(robot, limits, state, cables, radii.spools)
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
    _, _, velocity, acceleration = attachments(robot, state)
    near, speed = cables.length.low(), cables.rate.magnitude()
    sine = spools / near
    slowest = jnp.maximum(0.0, jnp.maximum(cables.rate.low(), -cables.rate.high()))
    square = jnp.maximum(norm(velocity).high() ** 2 - slowest**2, 0.0)
    faster = sine * jnp.sqrt(square) + (1.0 - jnp.sqrt(1.0 - sine**2)) * speed
    # With q = v^2 - rate^2, of length q / l + u p'': q' / l' - q / l, and (u' - u) p''.
    short = jnp.where(near > spools, near - spools, jnp.nan)
    more = faster * (2.0 * speed + faster) / short + square * spools / (near * short)
    more += jnp.arcsin(sine) * norm(acceleration).high()
    return lengths | {"speed": speed + faster, "acceleration": cables.acceleration.magnitude() + more}


@persistent_jit(static_argnames="contacts_alone", compiler_options=compile_options.proof_options())
def _upper_slacks(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    cases: tuple[StateBounds, Array, Array],
    *,
    contacts_alone: bool,
) -> Array:
    # Upper bounds of slacks, (k, n_slacks), in states, of robots with displaced spools and mass centre, (k, n_cables
    # + 1, 3) m, and with masses that are multiples of the planned mass, (k,).
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
    # Upper bounds of slacks, (k, m, n_slacks), of m robots in each of k states.
    shape = moved.shape[:2]
    repeated = jax.tree.map(lambda x: np.repeat(x, shape[1], axis=0), states)
    cases = repeated, moved.reshape(-1, *moved.shape[2:]), ratio.reshape(-1)
    kernel = partial(_upper_slacks, robot, limits, bodies, contacts_alone=contacts_alone)
    return in_batches(kernel, cases, batch_size=BATCH).reshape(*shape, -1)


def worst_directions(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    states: StateBounds,
    radii: Radii,
    *,
    contacts_alone: bool = False,
) -> Float[np.ndarray, "k 2 n_cables+1 3"]:
    """Unit displacements that are worst, to first order, for the criteria that fail first."""
    count = robot.n_cables + 1
    rays = np.asarray(robot.base_points)[None] - states.position.middle[:, None]
    step = STEP * np.linalg.norm(rays, axis=2).max(1)[:, None, None, None]
    # The first row is the planned robot, the others have one displaced coordinate each.
    moves = np.eye(3 * count + 1, 3 * count, -1).reshape(1, -1, count, 3)
    ratio = np.ones((len(step), 3 * count + 1))
    high = _of_robots(robot, limits, bodies, states, step * moves, ratio, contacts_alone=contacts_alone)
    with np.errstate(invalid="ignore", divide="ignore"):
        derivatives = np.swapaxes(high[:, 1:] - high[:, :1], 1, 2).reshape(len(step), -1, count, 3) / step
        derivatives = np.where(np.isfinite(derivatives), derivatives, 0.0)
        norms = np.linalg.norm(derivatives, axis=3)
        tolerated = high[:, 0] / (
            norms[..., :-1].sum(2) * radii.spools[:, None] + norms[..., -1] * radii.centre[:, None]
        )
        first = np.argsort(np.where(np.isfinite(tolerated), tolerated, np.inf), axis=1)[
            :, np.minimum(np.arange(NEAREST), tolerated.shape[1] - 1)
        ]
        directions = -derivatives / np.where(norms > 0.0, norms, 1.0)[..., None]
    return np.take_along_axis(directions, first[..., None, None], axis=1)


def states_fail(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    states: StateBounds,
    radii: Radii,
    directions: np.ndarray,
    *,
    contacts_alone: bool = False,
) -> Bool[np.ndarray, "k"]:
    """Tell in which states a robot with the worst displacements, and extreme masses, fails a criterion."""
    distances = np.repeat(np.stack([radii.spools, radii.centre], axis=1), [robot.n_cables, 1], axis=1)
    moved = np.repeat(distances[:, None, :, None] * directions, 2, axis=1)
    ratio = np.tile(np.stack([1.0 / radii.factor, radii.factor], axis=1), (1, directions.shape[1]))
    return _of_robots(robot, limits, bodies, states, moved, ratio, contacts_alone=contacts_alone).min((1, 2)) < 0.0
