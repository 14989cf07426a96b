"""Slacks of all robots within an uncertainty, over blocks of time: proved positive, or broken by one of these robots.

Spools and the mass centre lie in balls around their places. What is proved rests on the tensions of
`robots.uncertain_tensions`, for the smallest and the largest mass: sums of the tensions of both, in proportion, serve
all masses between. Lengths change by no more than spools do; unit vectors of cables stay in cones, which bounds rates,
accelerations and clearances. Determinant and depth are judged for the planned robot alone.

What is refuted rests on the slacks of single robots at instants, displaced along differences of these slacks.
"""

import dataclasses
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.arithmetic.affine_bounds import AffineBounds, norm_bound
from cspr_jax.motions.block_slacks import limit_slacks, tension_slacks
from cspr_jax.robots.cables import AnyRobot, wrench_units
from cspr_jax.robots.contact_bodies import Bodies
from cspr_jax.robots.contact_bounds import contact_bounds
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.state_bounds import CableBounds, StateBounds, attachments, balance_bounds, cable_bounds
from cspr_jax.robots.uncertain_tensions import centre_wrench, uncertain_tensions, with_mass
from cspr_jax.robots.wrench_sets import tension_range

# Displacement by which differences are taken, over the length of a cable; criteria of which the worst one is sought.
STEP, NEAREST = 1e-6, 2


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


@partial(jax.jit, static_argnames="contacts_alone")
def blocks_hold(
    robot: AnyRobot, limits: Limits, bodies: Bodies, cases: tuple[StateBounds, Share], *, contacts_alone: bool = False
) -> Array:
    """Prove that all robots keep taut cables, limits and distances throughout blocks.

    Args:
        robot: without pulleys.
        cases: bounds of k states, and shares (k,).
        contacts_alone: whether only distances are asked about.

    Returns:
        (k,).
    """

    def one(state: StateBounds, share: Share) -> Array:
        cables = cable_bounds(robot, state)
        is_met = jnp.ones((), bool) if contacts_alone else _cables_hold(robot, limits, state, cables, share)
        turn = jnp.arcsin(share.spools / cables.length.low())
        wide = cables._replace(
            exit=_wider(cables.exit, share.spools),
            direction=_wider(cables.direction, turn[:, None]),
            length=_wider(cables.length, share.spools),
        )
        apart = contact_bounds(robot, bodies, state, wide)[0]
        return is_met & ((apart > 0.0).all() | (share.spools == 0.0))

    return jax.vmap(one)(*cases)


def _wider(bounds: AffineBounds, radius: Array) -> AffineBounds:
    return bounds._replace(radius=bounds.radius + radius)


def _cables_hold(robot: AnyRobot, limits: Limits, state: StateBounds, cables: CableBounds, share: Share) -> Array:
    # Prove tensions, and the limits of lengths, speeds and accelerations, with the unit vectors u' of cables at most
    # `turn` from u.
    (low, high), is_met, spools = tension_range(robot, limits), jnp.ones((), bool), share.spools
    for ratio in (1.0 / share.factor, share.factor):
        heavy = with_mass(robot, ratio)
        tensions = uncertain_tensions(heavy, state, cables, (low, high), (spools, share.centre))
        is_met &= ((tensions.low > low) & (tensions.high < high)).all()
    if limits.cable_length_max is not None:
        is_met &= (cables.length.high() + spools < limits.cable_length_max).all()
    if limits.cable_speed_max is None and limits.cable_acceleration_max is None:
        return is_met
    _, _, velocity, pull = attachments(robot, state)
    near, speed = cables.length.low(), cables.rate.size()
    sine = spools / near
    slowest = jnp.maximum(0.0, jnp.maximum(cables.rate.low(), -cables.rate.high()))
    square = jnp.maximum(norm_bound(velocity) ** 2 - slowest**2, 0.0)
    faster = sine * jnp.sqrt(square) + (1.0 - jnp.sqrt(1.0 - sine**2)) * speed
    if limits.cable_speed_max is not None:
        is_met &= (speed + faster < limits.cable_speed_max).all()
    if limits.cable_acceleration_max is not None:
        # With q = v^2 - rate^2, of length q / l + u pull: q' / l' - q / l, and (u' - u) pull.
        short = jnp.where(near > spools, near - spools, jnp.nan)
        more = faster * (2.0 * speed + faster) / short + square * spools / (near * short)
        more += jnp.arcsin(sine) * norm_bound(pull)
        is_met &= (cables.acceleration.size() + more < limits.cable_acceleration_max).all()
    return is_met


def _upper_slacks(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    state: StateBounds,
    moved: Array,
    ratio: Array,
    *,
    contacts_alone: bool,
) -> Array:
    # Upper bounds of slacks of a robot whose spools and mass centre are moved, (n_cables + 1, 3) m, (n_slacks,).
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


@partial(jax.jit, static_argnames="contacts_alone")
def worst_ways(
    robot: AnyRobot, limits: Limits, bodies: Bodies, cases: tuple[StateBounds, Share], *, contacts_alone: bool = False
) -> Array:
    """Unit displacements that are worst, to first order, for the criteria that an uncertainty breaks first.

    Args:
        robot: without pulleys.
        cases: states at k instants, and the uncertainty (k,).
        contacts_alone: as for `blocks_hold`.

    Returns:
        (k, 2, n_cables + 1, 3) of the spools and of the mass centre.
    """

    def one(state: StateBounds, share: Share) -> Array:
        shape, ratio = (robot.n_cables + 1, 3), jnp.ones(())
        step = STEP * jnp.max(cable_bounds(robot, state).length.middle)
        moves = step * jnp.eye(shape[0] * shape[1]).reshape(-1, *shape)
        slacks = partial(_upper_slacks, robot, limits, bodies, state, ratio=ratio, contacts_alone=contacts_alone)
        planned, others = slacks(jnp.zeros(shape)), jax.vmap(slacks)(moves)
        slopes = ((others - planned[None]) / step).T.reshape(-1, *shape)
        slopes = jnp.where(jnp.isfinite(slopes), slopes, 0.0)
        sizes = jnp.sqrt(jnp.sum(slopes**2, axis=2))
        radii = jnp.append(jnp.full(robot.n_cables, share.spools), share.centre)
        room = planned / (sizes @ radii)
        first = jnp.argsort(jnp.where(jnp.isfinite(room), room, jnp.inf))[jnp.array([0, min(1, len(room) - 1)])]
        return -slopes[first] / jnp.where(sizes > 0.0, sizes, 1.0)[first, :, None]

    return jax.vmap(one)(*cases)


@partial(jax.jit, static_argnames="contacts_alone")
def instants_fail(
    robot: AnyRobot,
    limits: Limits,
    bodies: Bodies,
    cases: tuple[StateBounds, Share, Array],
    *,
    contacts_alone: bool = False,
) -> Array:
    """Tell at which instants a robot that is displaced, light or heavy, breaks a criterion.

    Args:
        robot: without pulleys.
        cases: states at k instants, shares (k,), and unit displacements as of `worst_ways`.
        contacts_alone: as for `blocks_hold`.

    Returns:
        (k,).
    """

    def one(state: StateBounds, share: Share, ways: Array) -> Array:
        radii = jnp.append(jnp.full(robot.n_cables, share.spools), share.centre)[:, None]
        masses = jnp.stack([1.0 / share.factor, share.factor])
        slacks = partial(_upper_slacks, robot, limits, bodies, state, contacts_alone=contacts_alone)
        high = jax.vmap(lambda way: jax.vmap(lambda ratio: slacks(radii * way, ratio))(masses))(ways)
        return (high < 0.0).any()

    return jax.vmap(one)(*cases)
