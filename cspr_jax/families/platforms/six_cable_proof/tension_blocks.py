"""Bounds of tensions and of the determinant on blocks of a platform's motions, one lane a block.

With N_k and det J the determinants of Cramer's rule for the tension of cable k,

    kappa_k = 6 z0 N_k / (g det J(P0)),    D = det J / det J(P0),    slack of a taut cable = kappa_k / D

are analytic on a block. They are computed at Chebyshev nodes; remainders of the polynomials through these values are
bounded on ellipses of complex time by Hadamard's inequality. With Bernstein coefficients k_i of kappa and d_i of D, and
remainders r and q, no slack is below the smallest (k_i - r) / (d_i + q). The same holds for limits on tensions, speeds
and accelerations of cables, `limit_blocks`: docs/theory.md.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.families.platforms.platform_segment import PlatformSegment
from cspr_jax.families.platforms.platform_segment_lanes import StateLanes, squared_duration, state
from cspr_jax.families.platforms.six_cable_proof.complex_bounds import (
    EllipseBounds,
    ellipse_bounds,
    middle_of,
    phase_beside,
)
from cspr_jax.families.platforms.six_cable_proof.limit_blocks import (
    QUANTITIES,
    STRAIGHT,
    CableEllipseBounds,
    Enclosed,
    Node,
    Pair,
    at_most,
    ratio,
)
from cspr_jax.families.platforms.six_cable_proof.work_list import smallest_nodes
from cspr_jax.motion.limits import limits_set, scales
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds import chebyshev
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.linear import packed_arrays
from cspr_jax.numerics.linear.lanes import dot, materialized
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.wrench_lanes import CABLES, balance, cable_lanes, inertial_wrench
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.limits import Limit

# Rounding error of a value at a node over its bound on real time (ten times what tests find); Lebesgue's constant
# multiplies it for the polynomial through such values, and Bernstein coefficients add a fraction of the values.
NODE_ERROR = 1e-13 * chebyshev.LEBESGUE
COEFFICIENTS = 2.0 * np.finfo(float).eps * (chebyshev.DEGREE + 1) * float(np.abs(chebyshev.bernstein()).sum(1).max())
REGULAR = CABLES  # index of D among the values
BASIC = 2  # number of criteria that are no limits


class TensionBounds(NamedTuple):
    """Slacks on n blocks: of taut cables, of the determinant (D), and of the given limits on the motion.

    Fields:
        nodes: (n_nodes, n_criteria, n) smallest slacks at the nodes, rounded up so that they are not below the true
            ones; infinite where D is not certainly positive. With margins the slack of the determinant is that of
            `wrench_lanes.normalised_determinant` over its value at rest in P0. Without all nodes: only the minima,
            (1, n_criteria, n).
        offset: (n,) time in the block of the smallest of the minima, from -1 to 1; 0 if all nodes are kept.
        bound: (n_criteria, n) proved lower bounds.
        rounding: (n,) largest allowance for rounding in the slacks of taut cables, before division by D.
        allowed: (n,) largest total allowance, including the remainders of the polynomials.
    """

    nodes: Array
    offset: Array
    bound: Array
    rounding: Array
    allowed: Array


class _Block(NamedTuple):
    # Parameters of n blocks.
    segments: PlatformSegment
    squared: Array  # T^2, s^2
    regular: Array  # det J(P0), m^9
    z0: Array


def of_motion(problem: Problem) -> list[Limit]:
    """The limits on the motion that are given."""
    return [row for row in limits_set(problem.limits) if row.of_motion]


@persistent_jit(static_argnames=("kind", "margins", "reduced"))
def tension_blocks(
    problem: Problem, one: Float[Array, ""], items, *, kind: PlatformMotionKind, margins: bool, reduced: bool = False
) -> TensionBounds:
    """Bounds of slacks on blocks."""
    interpolated = _interpolated(problem, one, items, kind=kind, margins=margins, single_precision=reduced)
    # Values that only margins need come last, and have no bounds.
    nodes, bound = _bounds(problem, interpolated)
    if margins:
        nodes[1] = nodes[1] * interpolated.values[:, len(interpolated.remainders)]
    if reduced:
        node_values, offset = smallest_nodes(nodes, len(nodes), chebyshev.nodes())
    else:
        node_values, offset = jnp.stack(nodes, axis=1), jnp.zeros_like(bound[0])
    return TensionBounds(node_values, offset, jnp.stack(bound), *_allowances(interpolated))


class TensionRange(NamedTuple):
    """Tensions on n blocks, per mass and length, over that of equal cables at rest in P0.

    Fields:
        low: (n_cables, n) proved lower bounds.
        high: (n_cables, n) proved upper bounds; infinite if the determinant may vanish.
        rounding: (n,) as in `TensionBounds`.
        allowed: (n,) as in `TensionBounds`.
    """

    low: Array
    high: Array
    rounding: Array
    allowed: Array


@partial(jax.jit, static_argnames="kind")
def tension_ranges(problem: Problem, one: Float[Array, ""], items, *, kind: PlatformMotionKind) -> TensionRange:
    """Ranges of the tensions of each cable on blocks."""
    interpolated = _interpolated(problem, one, items, kind=kind, margins=False)
    low, high = (_coefficients(interpolated.values) + sign * interpolated.remainders[None] for sign in (-1.0, 1.0))
    regular = low[:, REGULAR, None], high[:, REGULAR, None]
    minimum, maximum = ratio(low[:, :CABLES], regular), ratio(-high[:, :CABLES], regular)
    return TensionRange(minimum_of(minimum, axis=0), -minimum_of(maximum, axis=0), *_allowances(interpolated))


def _coefficients(values: Array) -> Array:
    # Return the Bernstein coefficients of polynomials through values (m, n_values, n) at the nodes.
    matrix = jnp.asarray(chebyshev.bernstein())
    return (matrix @ values.reshape(len(matrix), -1)).reshape(values.shape)


def _allowances(interpolated: "_Interpolated") -> tuple[Array, Array]:
    return maximum_of(interpolated.rounding[:CABLES], axis=0), maximum_of(interpolated.remainders[:CABLES], axis=0)


class _Interpolated(NamedTuple):
    # Values of blocks at the nodes (m, n_values, n), remainders of the polynomials through the first n_rests of these
    # values (n_rests, n), and the part of the remainders that is rounding.
    block: _Block
    values: Array
    remainders: Array
    rounding: Array


def _interpolated(
    problem: Problem, one: Array, items, *, kind: PlatformMotionKind, margins: bool, single_precision: bool = False
) -> _Interpolated:
    segments, arcs, regular, start, stop = items
    middle, half = middle_of(problem.amplitude, 0.5 * (start + stop)), 0.5 * (stop - start)
    block = _Block(segments, squared_duration(segments, arcs), regular, problem.robot.gravity / segments.rate)

    def at(off):
        phase = phase_beside(middle, segments.sense, arcs, off * half)
        return state(segments, arcs, materialized(phase, one), kind, one)

    def values_at(node):
        return [x for pair in _values(problem, block, at(node), margins=margins) for x in pair]

    pack, unpack = (
        (packed_arrays.packed, packed_arrays.unpacked)
        if single_precision
        else (packed_arrays.paired, packed_arrays.parts)
    )
    values = jnp.stack(unpack(lax.map(lambda node: pack(values_at(node)), chebyshev.nodes())), axis=1)
    lengths = materialized(_lengths(problem.robot, at(0.0)), one)
    radii = np.array(chebyshev.RADII)
    axes = np.vstack([chebyshev.semi_axes(radii), [1.0, 0.0]])

    def bounds_on(ellipse):
        along, aside = ellipse
        return packed_arrays.paired(ellipse_bounds(segments, arcs, middle, (along * half, aside * half), kind))

    def magnitudes_on(ellipse):
        along, pairs, factor = ellipse
        bounds = _magnitude_bounds(problem, block, EllipseBounds(*packed_arrays.parts(pairs)), along * half, lengths)
        return packed_arrays.paired([jnp.where(jnp.isnan(x), jnp.inf, x) * factor for x in bounds])

    factors = np.append(chebyshev.remainders(radii), NODE_ERROR)
    magnitudes = jnp.stack(packed_arrays.parts(lax.map(magnitudes_on, (axes[:, 0], lax.map(bounds_on, axes), factors))))
    amplified = maximum_of(values[:, REGULAR + 1], axis=0) ** 1.5
    largest = maximum_of(jnp.abs(values[:, : len(magnitudes)]), axis=0)
    largest = jnp.where(jnp.isnan(largest), jnp.inf, largest)  # three cables in one plane
    rounding = magnitudes[:, -1] * amplified[None] + COEFFICIENTS * largest
    remainders = minimum_of(magnitudes[:, :-1], axis=1) + rounding
    if single_precision:
        remainders = remainders + chebyshev.LEBESGUE * packed_arrays.SINGLE_ERROR * largest
    return _Interpolated(block, values, remainders, rounding)


def _values(problem: Problem, block: _Block, current: StateLanes, *, margins: bool) -> list[Pair]:
    # Return the values at one node in pairs, each of which XLA computes in one loop: kappa and D, the factor of
    # rounding, values that limits need, and the factor that converts D to the normalised determinant.
    robot = problem.robot
    cables = cable_lanes(robot, current.position, current.rotation)

    def slowed(vector):
        return tuple(x / block.squared for x in vector)

    force, moment = inertial_wrench(
        robot, slowed(current.acceleration), current.rotation, current.omega, current.angular_acceleration
    )
    balanced = balance(cables, force, slowed(moment))
    inverse = 1.0 / balanced.volume
    squares = [dot(ray, ray) for ray in cables.rays]
    amplified = math.prod(squares[2::2], start=squares[0]) * inverse * inverse
    fraction = inverse * inverse * inverse / block.regular
    kappa = [x * (fraction * (CABLES * block.z0 / robot.gravity)) for x in balanced.numerators]
    regular = balanced.denominator * fraction
    pairs = [*zip(kappa[::2], kappa[1::2], strict=True), (regular, amplified)]
    node = Node(current, cables, kappa, block.squared, block.z0)
    for quantity, row in _quantities(problem).items():
        pairs += QUANTITIES[quantity].values(node, getattr(problem.limits, row[0].name))
    if margins:
        standing = cable_lanes(robot, tuple(block.segments.center[:, i] for i in range(3)), _level(regular))
        rest = [dot(ray, ray) for ray in standing.rays]
        lengths = [jnp.sqrt(a / b) for a, b in zip(rest, squares, strict=True)]
        shortened = math.prod(lengths[1:], start=lengths[0])
        pairs.append((shortened, shortened))
    return pairs


def _level(template: Array):
    one, nothing = jnp.ones_like(template), jnp.zeros_like(template)
    return tuple(tuple(one if i == j else nothing for j in range(3)) for i in range(3))


def _quantities(problem: Problem) -> dict[str, list[Limit]]:
    # Return the limited quantities, each with its limits.
    limits: dict[str, list[Limit]] = {}
    for limit in of_motion(problem):
        limits.setdefault(limit.quantity, []).append(limit)
    return limits


def _lengths(robot: PlatformRobot, current: StateLanes) -> tuple[list[Array], list[Array]]:
    # Return the lengths of the cables, and the distances from the spools to the mass centre.
    cables = cable_lanes(robot, current.position, current.rotation)
    offsets = [tuple(current.position[i] - robot.base_points[k, i] for i in range(3)) for k in range(CABLES)]
    rays, away = ([jnp.sqrt(dot(x, x)) for x in vectors] for vectors in (cables.rays, offsets))
    return rays, away


def _magnitude_bounds(problem: Problem, block: _Block, bounds: EllipseBounds, along: Array, lengths) -> list[Array]:
    # Bound the magnitudes of the values of `_values` on an ellipse, in the same order, by Hadamard's inequality:
    # moments are in platform axes, over the mean arm times the norm of the rotation.
    robot, squared, z0 = problem.robot, block.squared, block.z0
    arm_lengths = jnp.sqrt(jnp.sum(robot.platform_points**2, axis=1))
    arm, arms = jnp.sqrt(jnp.mean(arm_lengths**2)), [arm_lengths[k] for k in range(CABLES)]
    shift, rotated = along * bounds.speed, jnp.minimum(along * bounds.rotation_rate, bounds.rotation_norm + 1.0)
    moved = [shift + lever * rotated for lever in arms]
    rays = [ray + move for ray, move in zip(lengths[0], moved, strict=True)]
    columns = [
        jnp.sqrt(ray**2 + (lever / arm * (away + shift)) ** 2)
        for ray, lever, away in zip(rays, arms, lengths[1], strict=True)
    ]
    inertia = robot.inertia / robot.mass
    deviator = inertia - jnp.trace(inertia) / 3.0 * jnp.eye(3)
    acceleration_matrix = (
        jnp.sqrt(jnp.sum(inertia**2)) * bounds.angular_acceleration + jnp.sqrt(jnp.sum(deviator**2)) * bounds.omega**2
    )
    force = bounds.second_derivative / squared + robot.gravity
    wrench = jnp.sqrt(force**2 + (acceleration_matrix / squared / (arm * bounds.rotation_norm)) ** 2)
    full = (arm * bounds.rotation_norm) ** 3 / jnp.abs(block.regular) * math.prod(columns[1:], start=columns[0])
    kappa = [CABLES * z0 / robot.gravity * full * wrench / column for column in columns]
    ray_rates = [bounds.speed + lever * bounds.rotation_rate for lever in arms]
    ray_accelerations = [
        bounds.second_derivative + lever * bounds.rotation_norm * (bounds.angular_acceleration + bounds.omega**2)
        for lever in arms
    ]
    is_straight = [move < STRAIGHT * ray for ray, move in zip(lengths[0], moved, strict=True)]
    cable_bounds = CableEllipseBounds(
        kappa, rays, ray_rates, ray_accelerations, is_straight, squared, z0, bounds.speed, bounds.second_derivative
    )
    largest = [*kappa, full, jnp.zeros_like(full)]
    for quantity, limits in _quantities(problem).items():
        largest += QUANTITIES[quantity].bounds(cable_bounds, getattr(problem.limits, limits[0].name))
    return largest


def _bounds(problem: Problem, interpolated: _Interpolated) -> tuple[list[Array], list[Array]]:
    # Return the smallest slacks at the nodes, (m, n) each, rounded up, and their lower bounds, (n,) each.
    remainders, block = interpolated.remainders, interpolated.block
    values = interpolated.values[:, : len(remainders)]
    coefficients = _coefficients(values)

    def around(middle, off, part):
        return middle[:, part] - off[None, part], middle[:, part] + off[None, part]

    one = slice(REGULAR, REGULAR + 1)
    regular, fraction = around(coefficients, remainders, one), around(values, interpolated.rounding, one)
    # Quotients with the same denominator are smallest for the smallest numerator.
    minimum = minimum_of(coefficients[:, :CABLES] - remainders[None, :CABLES], axis=1, keepdims=True)
    doubt = maximum_of(interpolated.rounding[None, :CABLES], axis=1, keepdims=True)
    kappa = minimum_of(values[:, :CABLES], axis=1, keepdims=True) + doubt
    nodes = [at_most(kappa, fraction)[:, 0], fraction[1][:, 0]]
    bound = [minimum_of(ratio(minimum, regular), axis=(0, 1)), minimum_of(regular[0], axis=(0, 1))]
    scale = scales(CABLES, problem.robot.mass * problem.robot.gravity, block.z0)
    part, slacks = slice(0, REGULAR + 2), {}
    for quantity, limits in _quantities(problem).items():
        factor, unit = scale.get(quantity, (1.0, jnp.ones(())))
        part = slice(part.stop, part.stop + QUANTITIES[quantity].width)
        enclosed = Enclosed(
            around(coefficients, remainders, part), around(values, interpolated.rounding, part), regular, fraction
        )
        for limit in limits:
            allowed = getattr(problem.limits, limit.name) * (factor / unit)
            slacks[limit.name] = QUANTITIES[quantity].slacks(enclosed, allowed, limit.sense == "least")
    for limit in of_motion(problem):
        nodes.append(slacks[limit.name][0])
        bound.append(slacks[limit.name][1])
    return nodes, bound
