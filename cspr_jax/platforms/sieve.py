"""The first look at many motions of a platform: instants that refute most of them.

In float32, where a sample costs half; the instant with the smallest tension is then looked at in float64. So the first
look refutes nothing that float64 would not refute, and a motion that float32 passes is checked in full anyway.
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic.batches import in_batches, room, row_by_row
from cspr_jax.arithmetic.lanes import cross, dot
from cspr_jax.motions.amplitudes import Amplitude
from cspr_jax.motions.platform_kind import PlatformMotionKind
from cspr_jax.platforms.from_rest_lanes import rest_table, swing, swings
from cspr_jax.platforms.motions import rows
from cspr_jax.platforms.platform_segment import PlatformSegment
from cspr_jax.platforms.platform_segment_lanes import instant_lanes
from cspr_jax.platforms.slack_lanes import certain_tension, lowest_tension
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.wrench_lanes import balance, cable_lanes

# Instants of one call; how many more motions are looked at than checked at a time, and what part of them is few.
CHUNK, FIRST, FEWER = 8, 2, 8


@partial(jax.jit, static_argnames=("kind", "single_precision"))
def smallest_tensions(
    robot: PlatformRobot,
    amplitude: Amplitude,
    arcs: Array,
    tau: Array,
    segments: PlatformSegment,
    *,
    kind: PlatformMotionKind,
    single_precision: bool = False,
) -> tuple[Array, Array]:
    """Smallest normalised tension of many segments over some instants.

    Args:
        robot: in its reference axes.
        arcs: () number of arcs, the same for all, a float.
        tau: (m,) instants.
        segments: leaves (n, ...), of the parity of `arcs`.
        single_precision: whether in float32.

    Returns:
        (n,) of `slack_lanes.certain_tension`; and which instant it belongs to, (n,) from 0 on.
    """
    if single_precision:
        robot, segments = _of_one_size(robot, segments)
    cast = partial(jax.tree.map, lambda x: jnp.asarray(x, jnp.float32 if single_precision else x.dtype))
    robot, segments, number = cast((robot, segments, jnp.asarray(arcs)))
    if kind.from_rest:
        at, table = _from_rest(robot, segments), cast(rest_table(amplitude, arcs, tau, kind))
    else:
        table = cast(jax.vmap(lambda t: instant_lanes(amplitude, segments.sense[0].astype(tau.dtype), arcs, t))(tau))

        def at(instant_lanes):
            return lowest_tension(robot, segments, number, instant_lanes, kind)

    # One number a loop: XLA would compute the tension once for each of several.
    values = row_by_row(at, table)
    lowest = values.min(0)
    return lowest, jnp.where(values == lowest[None], jnp.arange(len(tau))[:, None], len(tau)).min(0)


def _of_one_size(robot: PlatformRobot, segments: PlatformSegment) -> tuple[PlatformRobot, PlatformSegment]:
    # Take the spread of the spools as unit of length: determinants are of ninth order in lengths, their products of
    # eighteenth, which float32 has no room for. Tensions over their value at rest do not depend on the unit.
    unit = jnp.sqrt(jnp.mean(robot.base_points**2))
    smaller = dataclasses.replace(
        robot,
        base_points=robot.base_points / unit,
        platform_points=robot.platform_points / unit,
        inertia=robot.inertia / unit**2,
        gravity=robot.gravity / unit,
    )
    return smaller, dataclasses.replace(
        segments,
        hub=segments.hub / unit,
        start_radius=segments.start_radius / unit,
        end_radius=segments.end_radius / unit,
        regular=jnp.sign(segments.regular),
    )


def _from_rest(robot: PlatformRobot, segments: PlatformSegment):
    motions, inertia = swings(segments), robot.inertia / robot.mass
    # I e has the same direction in platform axes as about the fixed ones before the turn, which leaves the axis alone.
    axis_inertia = tuple(dot([inertia[i, j] for j in range(3)], motions.axis) for i in range(3))

    def at(row):
        here = swing(motions, row)
        cables = cable_lanes(robot, here.position, here.rotation)
        weight = tuple(dot(line, axis_inertia) for line in here.rotation)
        whirl = cross(motions.axis, weight)
        moment = tuple(
            here.angular_acceleration * a + here.squared_speed * b for a, b in zip(weight, whirl, strict=True)
        )
        force = (here.acceleration[0], here.acceleration[1], here.acceleration[2] - robot.gravity)
        return certain_tension(motions.rate, segments.regular, cables, balance(cables, force, moment))

    return at


@partial(jax.jit, static_argnames="kind")
def _rough_and_certain(
    robot: PlatformRobot,
    amplitude: Amplitude,
    arcs: Array,
    tau: Array,
    segments: PlatformSegment,
    *,
    kind: PlatformMotionKind,
) -> tuple[Array, Array]:
    # Compute `smallest_tensions` in float32, and the tension at its instant in float64, (n,) each.
    lowest, when = smallest_tensions(robot, amplitude, arcs, tau, segments, kind=kind, single_precision=True)
    when = jnp.minimum(when, len(tau) - 1)  # there is none where all are NaN
    if kind.from_rest:
        return lowest, _from_rest(robot, segments)(rest_table(amplitude, arcs, tau, kind).T[:, when])
    instant = instant_lanes(amplitude, segments.sense, arcs, tau[when])
    return lowest, lowest_tension(robot, segments, arcs, instant, kind)


class TensionSieve(NamedTuple):
    """Sieve of motions of one robot, by their tensions at a few instants.

    Fields:
        robot: the robot.
        amplitude: A.
        kind: of the motions.
        least: a tension no larger than that refutes.
        size: how many are looked at in one call.
        count_instants: is told how many.
    """

    robot: PlatformRobot
    amplitude: Amplitude
    kind: PlatformMotionKind
    least: float
    size: int
    count_instants: Callable[[int], None]

    def lowest(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        """Smallest tension over some instants.

        Args:
            segments: leaves (n, ...), all of this number of arcs.
            arcs: the number.
            tau: (m,) instants.

        Returns:
            (n,) of `smallest_tensions`; -inf where not finite.
        """
        lowest = np.full(len(segments.rate), np.inf)
        for chunk in _chunks(tau):
            lowest = np.minimum(lowest, self._lowest(segments, arcs, chunk))
        return np.where(np.isnan(lowest), -np.inf, lowest)

    def refuted(self, segments: PlatformSegment, arcs: int, tau: np.ndarray, *, limits: bool = True) -> np.ndarray:
        """Motions that some instants refute.

        Args:
            segments: leaves (n, ...), all of this number of arcs.
            arcs: the number.
            tau: (m,) instants, the most telling ones first.
            limits: whether limits may refute them, which are not looked at here.

        Returns:
            (n,) where a tension is, or is none, or the determinant has changed its sign.
        """
        del limits
        is_refuted = np.zeros(len(segments.rate), bool)
        for chunk in _chunks(tau):
            alive = np.flatnonzero(~is_refuted)
            if not len(alive):
                break
            remaining = segments if len(alive) == len(is_refuted) else rows(segments, alive)
            if len(alive) <= room(self.size // FEWER):  # not worth two looks
                is_refuted[alive] = ~(self._lowest(remaining, arcs, chunk) > self.least)
                continue
            self.count_instants(len(alive) * (len(chunk) + 1))
            kernel = partial(_rough_and_certain, self.robot, self.amplitude, float(arcs), chunk, kind=self.kind)
            lowest, certain = in_batches(kernel, remaining, size=self.size)
            is_refuted[alive] = (lowest < 0.0) & ~(certain > self.least)
        return is_refuted

    def _lowest(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        # Look at few motions, in float64.
        self.count_instants(len(segments.rate) * len(tau))
        kernel = partial(smallest_tensions, self.robot, self.amplitude, float(arcs), tau, kind=self.kind)
        return in_batches(kernel, segments, size=self.size // FEWER)[0]


def _chunks(tau: np.ndarray) -> np.ndarray:
    # One shape for all: the last instant is repeated.
    length = -(-len(tau) // CHUNK) * CHUNK
    return np.pad(tau, (0, length - len(tau)), mode="edge").reshape(-1, CHUNK)
