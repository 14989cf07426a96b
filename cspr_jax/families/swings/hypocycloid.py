"""The standard hypocycloid between two points, thesis chapter 2.

The effector swings in a plane through p0, the point below the centroid at depth z0. Its path is a
hypocycloid whose radius changes from r1 to r2; every arc ends in a cusp. With lambda = g / z0 the
end accelerations are those of a pendulum hung from the centroid.

There are two forms of the same motion. `motion` is the printed one, (2.32) to (2.48). `swing` is
the closed form: the hypocycloid is an ellipse, traversed p / 2 times, which slowly precesses by the
angle delta = psi (p even) or pi - psi (p odd). So only one sine and one cosine of p pi tau oscillate
fast, and they do not depend on the points. Both forms agree to 1e-12 (tests).

Degenerate cases. A rest end (a point at p0) makes the motion a straight line, delta = 0, and an odd
p is allowed: its first swing goes away from the target. If start and end lie on one line through p0
and the arcs still need a plane (psi = 0 with p odd, psi = pi with p even), it is the plane with the
smallest inclination to the spool plane. psi = 0 with p = 1 has no duration: (2.47) is 0.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.amplitudes import Amplitude, LawPiece, derivatives, law_pieces
from cspr_jax.motion.formulas import Expression, MotionPiece
from cspr_jax.motion.swing_plane import swing_formula, swing_plane
from cspr_jax.numerics.elementary import maximum_of, sincospi
from cspr_jax.numerics.shapes import Bool, Float, Num
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model import point_mass
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.state import State
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.amplitude_bounds import TimeBounds
from cspr_jax.verification.bounds.batch import MotionBatch
from cspr_jax.verification.bounds.swing_bounds import swing_bounds


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Segment:
    """Parameters of one segment, for one parity of the number of arcs.

    With c the position in the plane of the trajectory and d = c + c'' / lambda, the normalised
    pseudotension of cable k is 1 + tilt . c + coupling_k . d + twist_k (c x d).

    Fields:
        plane: (3, 2) unit vectors q_h1 and q_h2 of (2.30), as columns.
        center: (3,) the point p0, m.
        start_radius: () r1 of (2.39), m.
        end_radius: () r2, m.
        precession: () precession angle delta, in half turns, in [0, 1].
        sense: () +1 (p odd) or -1 (p even), the sign of theta_h, (2.34).
        rate: () lambda of (2.26), 1/s^2.
        end_curvature: () A''(1) of a transition of chapter 1; 0 for the functions of chapter 2, which meet (2.49).
        tilt: (2,) gradient of the plane: depth below the spools over z0 is 1 + tilt . c; 1/m.
        coupling: (n_cables, 2) coupling vector of each cable, 1/m.
        twist: (n_cables,) twist of each cable, 1/m^2.
    """

    plane: Array
    center: Array
    start_radius: Array
    end_radius: Array
    precession: Array
    sense: Array
    rate: Array
    end_curvature: Array
    tilt: Array
    coupling: Array
    twist: Array


def couplings(
    robot: PointMassRobot, center: Float[Array, "3"], axes: Float[Array, "3 n"]
) -> tuple[Float[Array, "n"], Float[Array, "n_cables n"], Float[Array, "n_cables"]]:
    """Coefficients that couple a motion p = p0 + axes c, in a plane or on a line through p0, to the pseudotensions.

    With d = c + c'' / lambda and lambda = gravity / z0, (2.12) to (2.14) divided by their value at rest in p0
    give cable k the normalised pseudotension 1 + tilt . c + coupling_k . d + twist_k (c x d).
    """
    if robot.n_cables > robot.dof:
        nothing = jnp.full((robot.n_cables, axes.shape[1]), jnp.nan)
        return point_mass.plane_normal(robot) @ axes / center[2], nothing, nothing[:, 0]
    if point_mass.is_planar(robot):
        half = robot.base_points[:, 0]
        tilt = axes[2] / center[2]
        return tilt, axes[:1] / half[:, None] - tilt[None], jnp.zeros_like(half)  # (1.15), (1.16)
    a = robot.base_points
    area = jnp.cross(a[0], a[1]) + jnp.cross(a[1], a[2]) + jnp.cross(a[2], a[0])
    scale = 3.0 / (area[2] * center[2])
    opposite = jnp.roll(a, -1, axis=0) - jnp.roll(a, -2, axis=0)  # a2 - a3, a3 - a1, a1 - a2
    tilt = point_mass.plane_normal(robot) @ axes / center[2]
    coupling = -scale * (jnp.cross(center, opposite) + area[None] / 3.0) @ axes
    twist = scale * (opposite @ jnp.cross(axes[:, 0], axes[:, -1]))
    return tilt, coupling, twist


@jax.jit
def segment(
    robot: PointMassRobot,
    start: Float[Array, "3"],
    end: Float[Array, "3"],
    z0: Float[Array, ""],
    *,
    odd: Bool[Array, ""],
) -> Segment:
    """The segment from one point to another."""
    center, radius = point_mass.rest_point(z0), point_mass.spool_radius(robot)
    plane, r1, r2, precession = swing_plane(start - center, end - center, radius, point_mass.plane_normal(robot), odd)
    tilt, coupling, twist = couplings(robot, center, plane)
    sense = jnp.where(odd, 1.0, -1.0).astype(r1.dtype)
    return Segment(
        plane, center, r1, r2, precession, sense, robot.gravity / z0, jnp.zeros_like(r1), tilt, coupling, twist
    )


class Oscillation(NamedTuple):
    """The fast part of a motion.

    Fields:
        ratio: () nu = delta / (pi p) of the axes of the ellipse.
        steady: () theta_h^2 (n_h - 1) of (2.47): T^2 times the square of the frequency at constant radius.
        period: () T^2 lambda: the same as `steady`, less A''(1) of a transition, (1.29).
    """

    ratio: Array
    steady: Array
    period: Array


def oscillation(segment: Segment, arcs: Num[Array, ""]) -> Oscillation:
    """The fast part of a segment."""
    ratio = segment.precession / arcs
    # 1 - ratio comes first, since it vanishes for p = 1 and psi -> 0.
    steady = (math.pi * arcs) ** 2 * (1.0 - ratio) * (1.0 + ratio)
    return Oscillation(ratio, steady, steady - segment.end_curvature)


def duration(segment: Segment, arcs: Num[Array, ""]) -> Float[Array, ""]:
    """Duration T of a segment, (2.47); of a transition (1.29)."""
    return jnp.sqrt(oscillation(segment, arcs).period / segment.rate)


@jax.jit
def swing(
    segment: Segment, amplitude_values: tuple[Float[Array, ""], ...], arcs: Num[Array, ""], tau: Float[Array, ""]
) -> tuple[Float[Array, "2"], Float[Array, "2"]]:
    """Closed form of the motion in the plane of the trajectory, at one time.

    In the frame e_r, e_t that precesses with the ellipse, with C, S the cosine and sine of the
    phase sense pi p tau and ' = d / dtau,

        c = r (C e_r + nu S e_t)
        d = c + c'' / lambda = [rho C - 2 g sense r' S / (pi p)] e_r + nu (rho + 2 g r) S e_t,

    rho = (r'' - A''(1) r) / (T^2 lambda) and g = (T^2 lambda + A''(1)) / (T^2 lambda), which is 1 in
    chapter 2; c'' here is the second derivative in time.
    """
    span = segment.end_radius - segment.start_radius
    r = segment.start_radius + span * amplitude_values[0]  # (2.48)
    ratio, steady, period = oscillation(segment, arcs)
    rho, gain = (span * amplitude_values[2] - segment.end_curvature * r) / period, steady / period
    sine, cosine = sincospi(segment.sense * arcs * tau)
    lateral, axial = sincospi(segment.sense * segment.precession * tau)
    c_r, c_t = r * cosine, ratio * r * sine
    d_r = rho * cosine - 2.0 * gain * segment.sense * span * amplitude_values[1] * sine / (math.pi * arcs)
    d_t = ratio * (rho + 2.0 * gain * r) * sine
    c = jnp.stack([axial * c_r + lateral * c_t, axial * c_t - lateral * c_r])
    d = jnp.stack([axial * d_r + lateral * d_t, axial * d_t - lateral * d_r])
    return c, d


def motion(
    segment: Segment, amplitude: Amplitude, arcs: Num[Array, ""], tau: Float[Array, ""]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    """Position, velocity and acceleration at one time, as printed in (2.31) to (2.48)."""
    theta = segment.sense * math.pi * (arcs - segment.precession)  # (2.34)
    n = 2.0 * math.pi * arcs / jnp.abs(theta)  # (2.35)
    slow, fast = theta * tau, (n - 1.0) * theta * tau
    u = (
        jnp.stack([(n - 1.0) * jnp.cos(slow) + jnp.cos(fast), (n - 1.0) * jnp.sin(slow) - jnp.sin(fast)]) / n
    )  # (2.32-33)
    u1 = theta * (n - 1.0) / n * jnp.stack([-jnp.sin(slow) - jnp.sin(fast), jnp.cos(slow) - jnp.cos(fast)])
    u2 = (
        theta**2
        * (n - 1.0)
        / n
        * jnp.stack([-jnp.cos(slow) - (n - 1.0) * jnp.cos(fast), -jnp.sin(slow) + (n - 1.0) * jnp.sin(fast)])
    )
    span = segment.end_radius - segment.start_radius
    a0, a1, a2 = derivatives(amplitude, tau, order=2)
    r, r1, r2 = segment.start_radius + span * a0, span * a1, span * a2  # (2.48)
    time = duration(segment, arcs)
    position = segment.center + segment.plane @ (r * u)  # (2.31), (2.38)
    velocity = segment.plane @ (r1 * u + r * u1) / time  # (2.42)
    acceleration = segment.plane @ (r2 * u + 2.0 * r1 * u1 + r * u2) / time**2  # (2.43)
    return position, velocity, acceleration


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Hypocycloid:
    """Motion along a hypocycloid, or a transition of chapter 1; see `Motion`.

    Fields:
        segment: segment of the parity of `arcs`.
        amplitude: amplitude function A.
        arcs: () number of arcs, a float.
    """

    segment: Segment
    amplitude: Amplitude
    arcs: Array

    @property
    def z0(self) -> Array:
        """Depth of P0 below the centroid of the spools, () m."""
        return self.segment.center[..., 2]

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return duration(self.segment, self.arcs)

    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""
        return State(*motion(self.segment, self.amplitude, self.arcs, jnp.asarray(tau, float)))

    def breaks(self) -> Array:
        """Knots of the amplitude function; see `Motion.breaks`."""
        return self.amplitude.knots

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states; see `BoundedMotion.bounds`."""
        return self.batch([self]).bounds(np.zeros(len(start), int), start, end)

    def formulas(self) -> list[MotionPiece]:
        """Formulas; see `motion.formulas.HasFormulas`."""
        segment = self.segment

        def curve(tau: Expression, laws: list[LawPiece]) -> tuple[list[Expression], None]:
            return swing_formula(segment, self.arcs, laws[0], tau, variable=False), None

        return law_pieces([self.amplitude], self.duration(), curve)

    @staticmethod
    def batch(motions: Sequence["Hypocycloid"]) -> MotionBatch:
        """A batch of motions of one `batch_key`, which proofs bound together."""
        return MotionBatch.of(motions, batch_bounds)


@persistent_jit(compiler_options=compile_options.proof_options())
def batch_bounds(cases: tuple[Segment, Array, TimeBounds]) -> StateBounds:
    """Bounds of the states of a batch of motions, each over one block."""
    return jax.vmap(_block_bounds)(*cases)


def _block_bounds(segment: Segment, arcs: Array, block: TimeBounds) -> StateBounds:
    return StateBounds(*swing_bounds(segment, arcs, duration(segment, arcs), block))


def feasibility_at_infinity(segment: Segment, amplitude: Amplitude) -> Float[Array, ""]:
    """Left-hand side of (2.55); if it is positive, enough arcs make the segment feasible."""
    span = segment.end_radius - segment.start_radius
    ends = segment.start_radius + span * jnp.stack([amplitude.lowest, amplitude.highest]).astype(span.dtype)
    return 1.0 - maximum_of(jnp.abs(ends)) * jnp.linalg.norm(segment.tilt)


def limit_of_many_arcs(segment: Segment, amplitude: Amplitude, tau: Float[Array, ""]) -> Float[Array, ""]:
    """Smallest normalised pseudotension as the number of arcs of this parity grows, at one time.

    It is 1 - r(tau) |tilt . e_r(tau)|, which is exact; (2.55) assumes the worst direction of the swing.
    """
    r = segment.start_radius + (segment.end_radius - segment.start_radius) * derivatives(amplitude, tau, order=0)[0]
    lateral, axial = sincospi(segment.sense * segment.precession * tau)
    return 1.0 - jnp.abs(r * (segment.tilt[0] * axial - segment.tilt[1] * lateral))
