"""Bounds of clearances over a block of time: cables from each other, from obstacles and from their platform.

Contacts are those of `robots.contacts.clearance.Scene`. A rigid platform whose shape is not known, but whose points lie
in a plane, must meet the criterion of the thesis (section 3.10.2) instead: no cable may pass over the platform's face,
into the sector of the corner to which it is attached. The clearance is then the distance of the spool, in platform
axes, from this sector, which may vanish at isolated times only.

Clearances are signed: where solid bodies overlap they are minus the smallest translation that separates them, but not
below minus `Bodies.deepest`. Cables without thickness, and cables and sectors, meet at isolated times only, at which
the clearance is 0. `passings` proves that they pass through each other: the volume that they span (the height of the
cable over the face) has opposite signs at both ends of a block, while throughout the block their lines are nearest to
each other inside of both cables (the cable is over the sector). Cables of a planar platform lie in one plane, so that
they may cross for some time; their clearance is then minus `Bodies.deepest`.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, constant, cross, dot, norm_squared, rotated, stacked
from cspr_jax.numerics.bounds.function_bounds import changes_sign
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.bounds.state_bounds import CableBounds, StateBounds
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.contact_bodies import Bodies, Shape
from cspr_jax.robots.contacts.convex_gaps import (
    BOX,
    SEGMENT,
    Solid,
    along,
    clearance_bounds,
    depth_bound,
    distance_bound,
    turning,
)
from cspr_jax.robots.contacts.interference_lanes import residual
from cspr_jax.robots.model.patterns import PATTERNS

CORNER_ERROR = 1e-14  # rounding error of the corners of shapes, over the extent of a scene
POLAR = 1e-12  # largest cosine with a sector's directions of a direction that points away from the sector

Range = tuple[Array, Array]


def contact_bounds(robot: AnyRobot, bodies: Bodies, state: StateBounds, cables: CableBounds) -> Range:
    """Bounds of the clearances of all contacts, over one block."""
    ends, parts = _ends(state, cables), []
    if len(bodies.pairs):
        parts.append(_of_pairs(robot, bodies, ends))
    if len(bodies.order):
        low, high = jax.vmap(lambda x: _from_obstacles(bodies, Solid(x, *SEGMENT)))(ends)
        parts.append((low.T - bodies.radii[None], high.T - bodies.radii[None]))
    if bodies.body is not None:
        parts.append(_of_platform(bodies, bodies.body, state, cables, ends))
        if len(bodies.order):
            parts.append(_platform_from_obstacles(bodies, bodies.body, state))
    if bodies.sectors is not None:
        sides, normal = bodies.sectors
        parts.append(jax.vmap(lambda side, cable: _from_sector(side, normal, cable))(sides, _seen(state, ends)))
    if not parts:
        return jnp.zeros(0), jnp.zeros(0)
    low, high = (jnp.concatenate([side.ravel() for side in sides]) for sides in zip(*parts, strict=True))
    allowance = CORNER_ERROR * bodies.extent
    return low - allowance, high + allowance


def passings(robot: AnyRobot, bodies: Bodies, state: StateBounds, cables: CableBounds) -> Bool[Array, "n_contacts"]:
    """Cables that are proved to pass through each other, or over the platform, within one block."""
    ends, first = _ends(state, cables), bodies.pairs[:, 0]
    through = jax.vmap(_pass)(*(ends.each(lambda x, k=k: x[bodies.pairs[:, k]]) for k in range(2)))
    n_others = len(bodies.order) * len(bodies.radii)
    if bodies.body is not None:
        n_others += len(bodies.radii) + len(bodies.order)
    parts = [through, jnp.zeros(n_others, bool)] if len(first) else [jnp.zeros(n_others, bool)]
    if bodies.sectors is not None:
        sides, normal = bodies.sectors
        parts.append(jax.vmap(lambda side, cable: _passes_over(side, normal, cable))(sides, _seen(state, ends)))
    return jnp.concatenate(parts)


def corner_depths(corners: Float[Array, "n_corners 3"], state: StateBounds) -> AffineBounds:
    """Bounds of the depths of points of a platform."""
    return dot(state.rotation.each(lambda x: x[2][None]), corners) + state.position.each(lambda x: x[2])


def _ends(state: StateBounds, cables: CableBounds) -> AffineBounds:
    # Ends of the cables: points at which they leave, and attachment points, (n_cables, 2, 3).
    attached = state.position.each(lambda x: jnp.broadcast_to(x, cables.exit.middle.shape))
    attached = attached if cables.arm is None else attached + cables.arm
    return stacked([cables.exit, attached], axis=1)


def _seen(state: StateBounds, ends: AffineBounds) -> AffineBounds:
    # Cables from the platform to the spools in platform axes, (n_cables, 3).
    away = ends.each(lambda x: x[:, 0]) - ends.each(lambda x: x[:, 1])
    return rotated(state.rotation.each(lambda x: x.T[None]), away)


def _of_pairs(robot: AnyRobot, bodies: Bodies, ends: AffineBounds) -> Range:
    first, second = (ends.each(lambda x, k=k: x[bodies.pairs[:, k]]) for k in range(2))
    low, high = jax.vmap(lambda p, q: clearance_bounds(Solid(p, *SEGMENT), Solid(q, *SEGMENT)))(first, second)
    low = jnp.maximum(low, 0.0)
    if PATTERNS[robot.pattern].is_planar:
        low = jnp.where(low > 0.0, low, -bodies.deepest)
        high = jnp.where(jax.vmap(_cross_in_plane)(first, second), -bodies.deepest, high)
    need = bodies.radii[bodies.pairs].sum(1)
    return low - need, high - need


def _cross_in_plane(first: AffineBounds, second: AffineBounds) -> Array:
    # Tell whether segments (2, 3) in the plane y = 0 cross throughout: each line separates the ends of the other one.
    def parted(line: AffineBounds, points: AffineBounds) -> Array:
        start = line.each(lambda x: x[:1])
        ray, rays = line.each(lambda x: x[1:]) - start, points - start
        side = cross(ray, rays).each(lambda x: x[:, 1])
        low, high = side.low(), side.high()
        return ((low[0] > 0.0) & (high[1] < 0.0)) | ((high[0] < 0.0) & (low[1] > 0.0))

    return parted(first, second) & parted(second, first)


def _from_obstacles(bodies: Bodies, solid: Solid) -> Range:
    # Bound the distances of a body from all obstacles, (n_obstacles,).
    parts = []
    if len(bodies.rods):
        low, high = jax.vmap(lambda rod: clearance_bounds(solid, Solid(constant(rod), *SEGMENT)))(bodies.rods)
        parts.append((jnp.maximum(low, 0.0) - bodies.rod_radii, high - bodies.rod_radii))
    if bodies.boxes is not None:

        def from_box(box: Shape) -> Range:
            return _signed(bodies, solid, Solid(constant(box.corners), *BOX), depth_bound(solid, box.planes))

        parts.append(jax.vmap(from_box)(bodies.boxes))
    low, high = (jnp.concatenate(sides)[bodies.order] for sides in zip(*parts, strict=True))
    return low, high


def _signed(bodies: Bodies, first: Solid, second: Solid, depth: Array) -> Range:
    low, high = clearance_bounds(first, second)
    return jnp.maximum(low, -bodies.deepest), jnp.maximum(jnp.minimum(high, depth), -bodies.deepest)


def _of_platform(bodies: Bodies, body: Shape, state: StateBounds, cables: CableBounds, ends: AffineBounds) -> Range:
    # In the axes of the platform its shape and the attachment points do not move.
    away = rotated(state.rotation.each(lambda x: x.T[None]), cables.direction)
    spools = _inward(state, ends.each(lambda x: x[:, 0]))
    starts = away * bodies.leave + bodies.points
    shape = Solid(constant(body.corners), body.edges, body.faces)

    def one(start: AffineBounds, spool: AffineBounds) -> Range:
        cable = Solid(stacked([start, spool], axis=0), *SEGMENT)
        return _signed(bodies, cable, shape, depth_bound(cable, body.planes))

    low, high = jax.vmap(one)(starts, spools)
    # A cable that may be no longer than the part that is left out has no bounds.
    is_long = cables.length.low() > bodies.leave
    return jnp.where(is_long, low, -bodies.deepest) - bodies.radii, jnp.where(is_long, high, jnp.inf) - bodies.radii


def _inward(state: StateBounds, points: AffineBounds) -> AffineBounds:
    # Transform points (n, 3) to platform axes, with the mass centre as origin.
    return rotated(state.rotation.each(lambda x: x.T[None]), points - state.position.each(lambda x: x[None]))


def _platform_from_obstacles(bodies: Bodies, body: Shape, state: StateBounds) -> Range:
    shape, parts = Solid(constant(body.corners), body.edges, body.faces), []
    corners = rotated(state.rotation.each(lambda x: x[None]), body.corners) + state.position.each(lambda x: x[None])

    def from_rod(rod: Array) -> Range:
        axis = Solid(_inward(state, constant(rod)), *SEGMENT)
        return _signed(bodies, axis, shape, depth_bound(axis, body.planes))

    def from_box(box: Shape) -> Range:
        brick = Solid(_inward(state, constant(box.corners)), *BOX)
        depth = depth_bound(Solid(corners, body.edges, body.faces), box.planes)
        return _signed(bodies, brick, shape, jnp.minimum(depth, depth_bound(brick, body.planes)))

    if len(bodies.rods):
        low, high = jax.vmap(from_rod)(bodies.rods)
        parts.append((low - bodies.rod_radii, high - bodies.rod_radii))
    if bodies.boxes is not None:
        parts.append(jax.vmap(from_box)(bodies.boxes))
    low, high = (jnp.concatenate(sides)[bodies.order] for sides in zip(*parts, strict=True))
    return low, high


def _from_sector(sides: Array, normal: Array, cable: AffineBounds) -> Range:
    # Bound the distance of the end of a cable (3,), seen from its corner, from the sector of the corner. A direction
    # points away from the sector if no component along the sides, or along the middle between them, is positive.
    def off(seen: Array) -> Array:
        parts = residual((tuple(sides[0]), tuple(sides[1])), tuple(normal), tuple(seen))
        return jnp.stack(parts)

    def unit(vector: Array) -> Array:
        return vector / jnp.sqrt(jnp.maximum(jnp.sum(vector**2, axis=-1, keepdims=True), 1e-200))

    one, two = unit(sides)
    rays = jnp.stack([one, unit(jnp.cross(normal, two) + jnp.cross(one, normal)), two])
    line = turning(lambda seen: unit(off(seen)), cable)
    heights = jnp.maximum(rays @ (line.middle - line.linear), rays @ (line.middle + line.linear))
    line = line._replace(linear=jnp.where((heights <= POLAR).all(), line.linear, 0.0))
    low = along(line, cable.each(lambda x: x[None]))
    length = jnp.sqrt(norm_squared(cable).high())
    is_polar = (rays @ line.middle <= POLAR).all()
    low = jnp.where(is_polar, jnp.maximum(low - 4.0 * POLAR * length, 0.0), 0.0)
    return low, distance_bound(constant(cable.middle - off(cable.middle)), cable)


def _pass(first: AffineBounds, second: AffineBounds) -> Array:
    start, other = (x.each(lambda y: y[0]) for x in (first, second))
    u, v = (x.each(lambda y: y[1]) - x.each(lambda y: y[0]) for x in (first, second))
    between, normal = other - start, cross(u, v)
    square = norm_squared(normal)
    is_inside = square.low() > 0.0
    for ray in (v, u):
        # Fraction of a cable at which the lines are nearest, times the squared length of the normal.
        fraction = dot(cross(between, ray), normal)
        is_inside &= (fraction.low() > 0.0) & ((square - fraction).low() > 0.0)
    return is_inside & changes_sign(dot(between, normal))


def _passes_over(sides: Array, normal: Array, cable: AffineBounds) -> Array:
    over = [dot(cable, jnp.cross(normal, sides[1])), -dot(cable, jnp.cross(normal, sides[0]))]
    is_inside = (over[0].low() > 0.0) & (over[1].low() > 0.0)
    return changes_sign(dot(cable, normal)) & (is_inside | (sides == 0.0).all())
