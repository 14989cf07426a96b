"""The fast form of the first look at a platform's motions: many segments of one number of arcs, instant by instant.

The same mechanics as `pose_segment.motion` and `wrenches.tensions_per_length` (tests compare them), written for
numbers instead of small vectors, so that XLA makes one loop over the segments of it. The balance (3.11) is solved by
adjugates, the cables in two groups of three, without a division but the last.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.amplitudes import Amplitude, derivatives
from cspr_jax.numerics import polynomial, sincospi
from cspr_jax.platforms import CABLES, PlatformRobot
from cspr_jax.trajectories.pose_segment import PoseSegment

Vector = Sequence[Array]
# Chebyshev fits on s in [0, 1] of W = arccos(s) / sqrt(1 - s^2): accurate to 1e-14 and, in its derivatives, to 1e-10.
_TERMS = 24


def _angle_ratio_coefficients() -> list[float]:
    # In powers of x = 1 - s, by a fit to the series, which is exact.
    terms = np.cumprod([1.0, *((k + 1.0) / (2.0 * k + 3.0) for k in range(120))])
    nodes = np.polynomial.chebyshev.chebpts1(64) * 0.5 + 0.5
    fit = np.polynomial.Chebyshev.fit(nodes, np.polynomial.polynomial.polyval(nodes, terms), _TERMS, domain=[0, 1])
    return [float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef]


_RATIO = _angle_ratio_coefficients()


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a: Vector, b: Vector) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _combined(terms: Sequence[tuple[Array, Vector]]) -> Vector:
    return tuple(sum((w * v[i] for w, v in terms[1:]), terms[0][0] * terms[0][1][i]) for i in range(3))


class _Instant(NamedTuple):
    # What all segments of one number of arcs share at one instant: A to A''', the phase, tau.
    a: Array
    a1: Array
    a2: Array
    a3: Array
    sine: Array
    cosine: Array
    tau: Array


def _place(segment: PoseSegment, omega: Array, arcs: Array, now: _Instant, *, variable: bool) -> tuple[Vector, Vector]:
    # Position from p0 and acceleration times T^2.
    span, nu = segment.end_radius - segment.start_radius, segment.precession / arcs
    r, r1, r2, r3 = segment.start_radius + span * now.a, span * now.a1, span * now.a2, span * now.a3
    steady = omega * omega * (1.0 - nu) * (1.0 + nu)
    lateral, axial = sincospi(segment.sense * segment.precession * now.tau)
    if variable:
        c = (r * now.cosine - r1 * now.sine / omega, nu * r * now.sine)
        w = (-(r * steady + r2) / omega, 2.0 * nu * r1)
        w1 = (2.0 * nu * nu * r1 * omega - (r1 * steady + r3) / omega, nu * (r * steady + 3.0 * r2))
        bend = (omega * now.cosine * w[0] + now.sine * w1[0], omega * now.cosine * w[1] + now.sine * w1[1])
    else:
        c = (r * now.cosine, nu * r * now.sine)
        bend = (
            (r2 - r * steady) * now.cosine - 2.0 * r1 * steady / omega * now.sine,
            nu * (r2 + r * steady) * now.sine,
        )
    found = []
    for x, y in (c, bend):
        along, across = axial * x + lateral * y, axial * y - lateral * x
        found.append(tuple(segment.plane[:, i, 0] * along + segment.plane[:, i, 1] * across for i in range(3)))
    return found[0], found[1]


def _orientation(segment: PoseSegment, arcs: Array, now: _Instant) -> tuple[Vector, Vector, Vector]:
    # The quaternion and its derivatives, as in `oscillating_slerp`.
    how, omega, nu = segment.turn, math.pi * arcs, segment.precession / arcs
    share = (1.0 - nu) * (1.0 + nu)
    sine = segment.sense * now.sine  # sin(pi p tau)
    sine3, cosine3 = sine * (3.0 - 4.0 * sine * sine), now.cosine * (4.0 * now.cosine * now.cosine - 3.0)
    slope = (how.end_bend - how.start_bend) * share
    h = how.start_bend * share + slope * now.tau
    b = ((9.0 + h) * now.cosine - (1.0 + h) * cosine3) * 0.125
    b1 = (slope * (now.cosine - cosine3) + omega * (3.0 * (1.0 + h) * sine3 - (9.0 + h) * sine)) * 0.125
    b2 = 0.125 * (
        2.0 * slope * omega * (3.0 * sine3 - sine)
        + omega * omega * (9.0 * (1.0 + h) * cosine3 - (9.0 + h) * now.cosine)
    )
    s, c = sincospi(how.angle * now.a / math.pi)
    rate, bend = how.angle * now.a1, how.angle * now.a2
    q = [how.start[:, i] * c + how.across[:, i] * s for i in range(4)]
    along = [how.across[:, i] * c - how.start[:, i] * s for i in range(4)]
    q1 = [x * rate for x in along]
    q2 = [x * bend - y * rate * rate for x, y in zip(along, q, strict=True)]
    x = 1.0 - q[0]
    w, w1, w2 = (polynomial([math.perm(k, j) * _RATIO[k] for k in range(j, _TERMS + 1)], x) for j in range(3))
    w1 = -w1
    u = _combined([(w, q[1:])])
    u1 = _combined([(w, q1[1:]), (w1 * q1[0], q[1:])])
    u2 = _combined([(w, q2[1:]), (2.0 * w1 * q1[0], q1[1:]), (w2 * q1[0] * q1[0] + w1 * q2[0], q[1:])])
    v = _combined([(b, u)])
    v1 = _combined([(b1, u), (b, u1)])
    v2 = _combined([(b2, u), (2.0 * b1, u1), (b, u2)])
    return v, v1, v2


def _spin(v: Vector, v1: Vector, v2: Vector) -> tuple[Sequence[Vector], Vector, Vector]:
    # Rotation matrix, angular velocity and acceleration (in tau) from half of the rotation vector.
    y, y1, y2 = _dot(v, v), 2.0 * _dot(v, v1), 2.0 * (_dot(v1, v1) + _dot(v, v2))
    root = jnp.sqrt(jnp.maximum(y, 1e-24))
    sine, cosine = sincospi(root / math.pi)
    is_small = y < 0.05
    large = jnp.where(is_small, 1.0, y)
    s = sine / root
    s1 = 0.5 * (cosine - s) / large
    s2 = -(0.5 * s + 3.0 * s1) / (2.0 * large)
    terms = [(-1.0) ** k / math.factorial(2 * k + 1) for k in range(9)]
    near1, near2 = (polynomial([math.perm(k, j) * terms[k] for k in range(j, 8)], y) for j in (1, 2))
    s1, s2 = jnp.where(is_small, near1, s1), jnp.where(is_small, near2, s2)
    q, q1 = (cosine, *_combined([(s, v)])), (-0.5 * s * y1, *_combined([(s, v1), (s1 * y1, v)]))
    q2 = (-0.5 * (s1 * y1 * y1 + s * y2), *_combined([(s, v2), (2.0 * s1 * y1, v1), (s2 * y1 * y1 + s1 * y2, v)]))

    def vector_part(left):  # of left times the conjugate of q, twice
        across = _cross(left[1:], q[1:])
        return tuple(2.0 * (q[0] * left[i + 1] - left[0] * q[i + 1] - across[i]) for i in range(3))

    w, x, yy, z = q
    turn = (
        (1.0 - 2.0 * (yy * yy + z * z), 2.0 * (x * yy - w * z), 2.0 * (x * z + w * yy)),
        (2.0 * (x * yy + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (yy * z - w * x)),
        (2.0 * (x * z - w * yy), 2.0 * (yy * z + w * x), 1.0 - 2.0 * (x * x + yy * yy)),
    )
    return turn, vector_part(q1), vector_part(q2)


def _balance(
    forces: Sequence[Vector], moments: Sequence[Vector], f: Vector, h: Vector
) -> tuple[list[Array], Array, Array]:
    # Numerators of the six unknowns, their common denominator, and a number with the sign of det J.
    first, second = range(0, CABLES, 2), range(1, CABLES, 2)
    a, b = [forces[k] for k in first], [forces[k] for k in second]
    adjugate = (_cross(a[1], a[2]), _cross(a[2], a[0]), _cross(a[0], a[1]))
    d = _dot(a[0], adjugate[0])
    g = [[_dot(row, column) for column in b] for row in adjugate]  # adj(A) B
    top = [_dot(row, f) for row in adjugate]
    c = [moments[k] for k in first]
    e = [
        tuple(d * moments[k][i] - sum(c[j][i] * g[j][n] for j in range(3)) for i in range(3))
        for n, k in enumerate(second)
    ]
    rest = tuple(d * h[i] - sum(c[j][i] * top[j] for j in range(3)) for i in range(3))
    inner = (_cross(e[1], e[2]), _cross(e[2], e[0]), _cross(e[0], e[1]))
    determinant = _dot(e[0], inner[0])
    odd = [_dot(row, rest) for row in inner]
    even = [top[j] * determinant - sum(g[j][n] * odd[n] for n in range(3)) for j in range(3)]
    numerators = [x for pair in zip(even, [d * x for x in odd], strict=True) for x in pair]
    # Taking the cables in two groups is an odd permutation.
    return numerators, d * determinant, -determinant


def _smallest(
    robot: PlatformRobot, sign: Array, segment: PoseSegment, arcs: Array, now: _Instant, *, variable: bool
) -> Array:
    # Smallest normalised tension at one instant of many segments; -inf beyond a singularity or above the spools.
    omega, eta = segment.sense * math.pi * arcs, segment.rate
    nu = segment.precession / arcs
    squared = (math.pi * arcs) ** 2 * (1.0 - nu) * (1.0 + nu) / segment.rate  # T^2
    place, bend = _place(segment, omega, arcs, now, variable=variable)
    turn, omega_vector, spin = _spin(*_orientation(segment, arcs, now))
    position = tuple(segment.hub[:, i] + place[i] for i in range(3))
    f = [bend[i] / squared for i in range(3)]
    f[2] = f[2] - robot.gravity
    inertia = robot.inertia / robot.mass

    def turned(vector):
        return tuple(sum(turn[i][j] * vector[j] for j in range(3)) for i in range(3))

    def back(vector):
        return tuple(sum(turn[j][i] * vector[j] for j in range(3)) for i in range(3))

    def weighted(vector):
        own = back(vector)
        return turned([sum(inertia[i, j] * own[j] for j in range(3)) for i in range(3)])

    gyration = _cross(omega_vector, weighted(omega_vector))
    h = tuple((x + y) / squared for x, y in zip(weighted(spin), gyration, strict=True))
    forces, moments = [], []
    for k in range(CABLES):
        arm = turned([robot.platform_points[k, j] for j in range(3)])
        force = tuple(robot.base_points[k, i] - position[i] - arm[i] for i in range(3))
        forces.append(force)
        moments.append(_cross(arm, force))
    numerators, denominator, determinant = _balance(forces, moments, f, h)
    lowest = jnp.min(jnp.stack([x * jnp.sign(denominator) for x in numerators]), axis=0)
    lowest = 6.0 / eta * lowest / jnp.abs(denominator)
    return jnp.where(determinant * sign > 0.0, lowest, -jnp.inf)


@partial(jax.jit, static_argnames="variable")
def smallest_tensions(
    robot: PlatformRobot,
    sign: Array,
    amplitude: Amplitude,
    arcs: Array,
    tau: Array,
    segments: PoseSegment,
    *,
    variable: bool = True,
) -> Array:
    """Smallest normalised tension of many segments over some instants.

    Args:
        robot: in its reference axes.
        sign: () +1 or -1 of det J of the reference pose.
        amplitude: A.
        arcs: () number of arcs, the same for all, a float.
        tau: (m,) instants.
        segments: leaves (n, ...), of the parity of `arcs`.
        variable: whether positions are hypocycloids of variable amplitude.

    Returns:
        (n,) 1 at rest in P0; -inf where the determinant has not the sign of the reference pose.
    """
    a, a1, a2, a3 = jax.vmap(lambda t: derivatives(amplitude, t, order=3))(tau)
    sine, cosine = sincospi(segments.sense[0] * arcs * tau)
    table = _Instant(a, a1, a2, a3, sine, cosine, tau)

    def step(lowest, now):
        return jnp.minimum(lowest, _smallest(robot, sign, segments, arcs, now, variable=variable)), None

    return lax.scan(step, jnp.full_like(segments.rate, jnp.inf), table)[0]
