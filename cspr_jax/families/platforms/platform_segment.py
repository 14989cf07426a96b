"""Point-to-point motions of a platform, thesis chapter 3: position and orientation together.

The position is a hypocycloid of variable amplitude (3.44), or the standard one of chapter 2; the orientation is an
oscillating SLERP in phase with it. In the precessing frame of `hypocycloid`, with s the sense, nu the ratio of the
ellipse's axes, S = theta_h^2 (n_h - 1) = T^2 lambda, C and S_ the cosine and sine of Phi = s pi p tau,

    c  = (r C - s r' S_ / (pi p)) e_r + nu r S_ e_t
    c' = S_ [-(r S + r'') s / (pi p) e_r + 2 nu r' e_t]

so the platform is at rest at every cusp, and not only at the ends as with the standard hypocycloid.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.platforms.oscillating_slerp import Slerp, orientation, rates, rotation_law, slerp_between
from cspr_jax.families.platforms.slerp_bounds import orientation_bounds, rotation_law_bounds
from cspr_jax.families.platforms.slerp_formulas import orientation_formula, rotation_law_formula
from cspr_jax.motion.amplitudes import Amplitude, LawPiece, derivatives, law_pieces
from cspr_jax.motion.formulas import Expression, MotionPiece, rational
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.motion.swing_plane import swing_formula, swing_plane
from cspr_jax.numerics.bounds.rotation_bounds import unit_rotation_bounds
from cspr_jax.numerics.elementary import sincospi
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.shapes import Bool, Float, Num
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import rest_point, spool_radius
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.wrench_balance import normalised_determinant
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.amplitude_bounds import TimeBounds
from cspr_jax.verification.bounds.batch import MotionBatch
from cspr_jax.verification.bounds.swing_bounds import swing_bounds


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class PlatformSegment:
    """Parameters of one segment between two poses, for one parity of the number of arcs.

    Fields:
        plane: (3, 2) q_h1 and q_h2 of (3.42), as columns.
        center: (3,) the point p0, m.
        start_radius: () r1 of (3.46), m.
        end_radius: () r2, m.
        precession: () angle by which the ellipse precesses, in half turns, in [0, 1].
        sense: () +1 (p odd) or -1 (p even).
        rate: () lambda of (3.50), 1/s^2.
        slerp: oscillating SLERP of the orientation.
        regular: () determinant (`wrench_balance.normalised_determinant`) at rest in P0, whose sign must not change; 1
            on more than six cables, where there is no determinant.
    """

    plane: Array
    center: Array
    start_radius: Array
    end_radius: Array
    precession: Array
    sense: Array
    rate: Array
    slerp: Slerp
    regular: Array


def pose_segment(
    robot: PlatformRobot,
    start: tuple[Float[Array, "3"], Float[Array, "4"]],
    end: tuple[Float[Array, "3"], Float[Array, "4"]],
    z0: Float[Array, ""],
    beta_hats: tuple[Float[Array, ""], Float[Array, ""]],
    *,
    odd: Bool[Array, ""],
) -> PlatformSegment:
    """The segment from one pose to another."""
    center = rest_point(z0)
    upright = jnp.zeros_like(center).at[2].set(1.0)
    plane, r1, r2, precession = swing_plane(start[0] - center, end[0] - center, spool_radius(robot), upright, odd)
    sense = jnp.where(odd, 1.0, -1.0).astype(r1.dtype)
    slerp = slerp_between(start[1], end[1], *beta_hats, odd=odd)
    is_determined = robot.n_cables == robot.dof
    one = jnp.eye(3, dtype=center.dtype)
    regular = normalised_determinant(robot, center, one) if is_determined else one[0, 0]
    return PlatformSegment(plane, center, r1, r2, precession, sense, robot.gravity / z0, slerp, regular)


def duration(segment: PlatformSegment, arcs: Num[Array, ""]) -> Float[Array, ""]:
    """Duration T of a segment, (3.77)."""
    return math.pi * arcs * jnp.sqrt(_rate_fraction(segment, arcs) / segment.rate)


def _rate_fraction(segment: PlatformSegment, arcs: Array) -> Array:
    # Return theta_h^2 (n_h - 1) over (pi p)^2. For p = 1 and psi -> 0 the factor 1 - ratio vanishes.
    ratio = segment.precession / arcs
    return (1.0 - ratio) * (1.0 + ratio)


@persistent_jit(static_argnames="kind")
def motion(
    segment: PlatformSegment,
    amplitude: Amplitude,
    arcs: Num[Array, ""],
    tau: Float[Array, ""],
    *,
    kind: PlatformMotionKind = USUAL,
) -> State:
    """The state of the platform at one time."""
    values = derivatives(amplitude, tau, order=3)
    time = duration(segment, arcs)
    c, c1, c2 = _swing(segment, values, arcs, tau, variable=kind.variable)
    quaternions = _quaternions(segment, values, arcs, tau, kind)
    omega, omega1 = rates(quaternions)
    return State(
        segment.center + segment.plane @ c,  # (3.43)
        segment.plane @ c1 / time,
        segment.plane @ c2 / time**2,
        rotations.matrix(quaternions[0]),
        omega / time,
        omega1 / time**2,
    )


def quaternion_at(
    segment: PlatformSegment,
    amplitude: Amplitude,
    arcs: Num[Array, ""],
    tau: Float[Array, ""],
    *,
    kind: PlatformMotionKind = USUAL,
) -> Float[Array, "4"]:
    """The orientation at one time."""
    return _quaternions(segment, derivatives(amplitude, tau, order=3), arcs, tau, kind)[0]


def _quaternions(
    segment: PlatformSegment, values: tuple[Array, ...], arcs: Array, tau: Array, kind: PlatformMotionKind
) -> tuple[Array, Array, Array]:
    fraction = _rate_fraction(segment, arcs)
    return orientation(segment.slerp, values, rotation_law(*_beta_hats(segment, fraction, kind), fraction, arcs, tau))


def _beta_hats(segment: PlatformSegment, fraction: Array, kind: PlatformMotionKind) -> tuple[Array, Array]:
    slerp = segment.slerp
    return (-1.0 / fraction, -1.0 / fraction) if kind.plain else (slerp.start_beta_hat, slerp.end_beta_hat)


def _swing(
    segment: PlatformSegment, values: tuple[Array, ...], arcs: Array, tau: Array, *, variable: bool
) -> tuple[Array, Array, Array]:
    # Return c, c' and c'' in the plane of the segment, derivatives by tau.
    span = segment.end_radius - segment.start_radius
    r, r1, r2, r3 = segment.start_radius + span * values[0], span * values[1], span * values[2], span * values[3]
    omega, nu = segment.sense * math.pi * arcs, segment.precession / arcs
    steady = (math.pi * arcs) ** 2 * _rate_fraction(segment, arcs)
    sine, cosine = sincospi(segment.sense * arcs * tau)
    lateral, axial = sincospi(segment.sense * segment.precession * tau)
    if variable:
        position = (r * cosine - r1 * sine / omega, nu * r * sine)
        w = (-(r * steady + r2) / omega, 2.0 * nu * r1)
        w1 = (2.0 * nu**2 * r1 * omega - (r1 * steady + r3) / omega, nu * (r * steady + 3.0 * r2))
        velocity = (sine * w[0], sine * w[1])
        acceleration = (omega * cosine * w[0] + sine * w1[0], omega * cosine * w[1] + sine * w1[1])
    else:
        position = (r * cosine, nu * r * sine)
        velocity = (r1 * cosine - r * steady / omega * sine, nu * r1 * sine)
        acceleration = (
            (r2 - r * steady) * cosine - 2.0 * r1 * steady / omega * sine,
            nu * (r2 + r * steady) * sine,
        )

    def rotated(vector):
        return jnp.stack([axial * vector[0] + lateral * vector[1], axial * vector[1] - lateral * vector[0]])

    return rotated(position), rotated(velocity), rotated(acceleration)


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class PlatformMotion:
    """Motion of a platform between two poses; see `Motion`.

    Fields:
        segment: segment of the parity of `arcs`.
        amplitude: amplitude function A.
        arcs: () number of arcs, a float.
        kind: kind of the motion; static when functions are compiled.
    """

    segment: PlatformSegment
    amplitude: Amplitude
    arcs: Array
    kind: PlatformMotionKind = dataclasses.field(default=USUAL, metadata={"static": True})

    @property
    def z0(self) -> Array:
        """Depth of P0 below the centroid of the spools, () m."""
        return self.segment.center[..., 2]

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return duration(self.segment, self.arcs)

    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""
        tau = jnp.asarray(tau, float)
        quaternion = quaternion_at(self.segment, self.amplitude, self.arcs, tau, kind=self.kind)
        state = motion(self.segment, self.amplitude, self.arcs, tau, kind=self.kind)
        return state._replace(quaternion=quaternion)

    def breaks(self) -> Array:
        """Knots of the amplitude function; see `Motion.breaks`."""
        return self.amplitude.knots

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states; see `BoundedMotion.bounds`."""
        return self.batch([self]).bounds(np.zeros(len(start), int), start, end)

    def formulas(self) -> list[MotionPiece]:
        """Formulas; see `motion.formulas.HasFormulas`."""
        segment, kind = self.segment, self.kind
        fraction = _rate_fraction(segment, self.arcs)
        betas = [rational(x) for x in (*_beta_hats(segment, fraction, kind), fraction, self.arcs)]

        def curve(tau: Expression, laws: list[LawPiece]) -> tuple[list[Expression], list[Expression]]:
            position = swing_formula(segment, self.arcs, laws[0], tau, variable=kind.variable)
            return position, orientation_formula(segment.slerp, laws[0].at(tau), rotation_law_formula(betas, tau))

        return law_pieces([self.amplitude], self.duration(), curve)

    @staticmethod
    def batch(motions: Sequence["PlatformMotion"]) -> MotionBatch:
        """A batch of motions of one `batch_key`, which proofs bound together."""
        return MotionBatch.of(motions, partial(batch_bounds, kind=motions[0].kind), orders=4)


@persistent_jit(static_argnames="kind", compiler_options=compile_options.proof_options())
def batch_bounds(cases: tuple[PlatformSegment, Array, TimeBounds], *, kind: PlatformMotionKind) -> StateBounds:
    """Bounds of the states of a batch of motions, each over one block."""
    return jax.vmap(partial(_block_bounds, kind))(*cases)


def _block_bounds(kind: PlatformMotionKind, segment: PlatformSegment, arcs: Array, block: TimeBounds) -> StateBounds:
    time, fraction = duration(segment, arcs), _rate_fraction(segment, arcs)
    translation = swing_bounds(segment, arcs, time, block, variable=kind.variable)
    betas = rotation_law_bounds(*_beta_hats(segment, fraction, kind), fraction, arcs, block.tau)
    q, q1, q2 = orientation_bounds(segment.slerp, block.values, betas)
    return StateBounds(*translation, *unit_rotation_bounds(q, q1 * (1.0 / time), q2 * (1.0 / time**2)))


def take_segments(segments: PlatformSegment, index: np.ndarray) -> PlatformSegment:
    """Segments selected from a batch."""
    # `take` is four times as fast as indexing unless the array is a vector.
    index = np.flatnonzero(index) if np.asarray(index).dtype == bool else index
    return jax.tree.map(lambda x: np.asarray(x).take(index, axis=0), segments)


class Motions(NamedTuple):
    """Motions of a platform.

    Fields:
        segments: arrays (n, ...), each of the parity of `arcs`.
        arcs: (n,) number of arcs of each.
    """

    segments: PlatformSegment
    arcs: np.ndarray

    def take(self, index: np.ndarray) -> "Motions":
        """Motions selected by indices, or by a mask (n,)."""
        return Motions(take_segments(self.segments, index), self.arcs[index])

    def items(self, index: Float[np.ndarray, "m"]) -> tuple[PlatformSegment, np.ndarray]:
        """Selected motions in the form for kernels."""
        return take_segments(self.segments, index), self.arcs[index].astype(float)
