"""Cheap test of many motions of a platform: a few samples refute most of them.

Samples are computed in float32, at half the cost; the one with the smallest tension is computed again in float64. So
the screen refutes nothing that float64 would not refute; motions that pass in float32 are checked in full anyway.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.platforms.from_rest_lanes import rest_table, swing, swings
from cspr_jax.families.platforms.platform_segment import PlatformSegment, take_segments
from cspr_jax.families.platforms.platform_segment_lanes import phase_lanes
from cspr_jax.families.platforms.six_cable_proof.slacks import certain_tension, lowest_tension
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.numerics.batches import device_batch_size, in_batches, row_by_row
from cspr_jax.numerics.linear.lanes import cross, dot
from cspr_jax.numerics.shapes import Bool, Float, Int, Num
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.wrench_lanes import balance, cable_lanes
from cspr_jax.runtime.persistent_jit import persistent_jit

CHUNK = 8  # number of samples in one call
FIRST = 2  # number of motions screened at a time over the number checked at a time
FEWER = 8  # motions count as few if they are at most a batch divided by this


@persistent_jit(static_argnames=("kind", "single_precision"))
def smallest_tensions(
    robot: PlatformRobot,
    amplitude: Amplitude,
    arcs: Num[Array, ""],
    tau: Float[Array, "m"],
    segments: PlatformSegment,
    *,
    kind: PlatformMotionKind,
    single_precision: bool = False,
) -> tuple[Float[Array, "n"], Int[Array, "n"]]:
    """Smallest normalised tension over some samples, for many segments."""
    if single_precision:
        robot, segments = _in_units_of_spread(robot, segments)
    cast = partial(jax.tree.map, lambda x: jnp.asarray(x, jnp.float32 if single_precision else x.dtype))
    robot, segments, number = cast((robot, segments, jnp.asarray(arcs)))
    if kind.from_rest:
        at, table = _from_rest(robot, segments), cast(rest_table(amplitude, arcs, tau, kind))
    else:
        table = cast(jax.vmap(lambda t: phase_lanes(amplitude, segments.sense[0].astype(tau.dtype), arcs, t))(tau))

        def at(phase):
            return lowest_tension(robot, segments, number, phase, kind)

    # Return one number from the loop: with several, XLA would compute the tension once for each.
    values = row_by_row(at, table)
    lowest = values.min(0)
    return lowest, jnp.where(values == lowest[None], jnp.arange(len(tau))[:, None], len(tau)).min(0)


def _in_units_of_spread(robot: PlatformRobot, segments: PlatformSegment) -> tuple[PlatformRobot, PlatformSegment]:
    # Take the spread of the spools as unit of length: determinants are of ninth order in lengths, and products of them
    # of eighteenth order, which overflow float32. Tensions over their value at rest do not depend on the unit.
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
        center=segments.center / unit,
        start_radius=segments.start_radius / unit,
        end_radius=segments.end_radius / unit,
        regular=jnp.sign(segments.regular),
    )


def _from_rest(robot: PlatformRobot, segments: PlatformSegment):
    motions, inertia = swings(segments), robot.inertia / robot.mass
    # The rotation does not change its axis e, so e, and with it I e, always has the same components in platform axes.
    axis_inertia = tuple(dot([inertia[i, j] for j in range(3)], motions.axis) for i in range(3))

    def at(row):
        current = swing(motions, row)
        cables = cable_lanes(robot, current.position, current.rotation)
        weight = tuple(dot(line, axis_inertia) for line in current.rotation)
        acceleration_matrix = cross(motions.axis, weight)
        moment = tuple(
            current.angular_acceleration * a + current.squared_speed * b
            for a, b in zip(weight, acceleration_matrix, strict=True)
        )
        force = (current.acceleration[0], current.acceleration[1], current.acceleration[2] - robot.gravity)
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
    # Compute `smallest_tensions` in float32, then the smallest tension again in float64, (n,) each.
    lowest, when = smallest_tensions(robot, amplitude, arcs, tau, segments, kind=kind, single_precision=True)
    when = jnp.minimum(when, len(tau) - 1)  # there is no smallest sample if all tensions are NaN
    if kind.from_rest:
        return lowest, _from_rest(robot, segments)(rest_table(amplitude, arcs, tau, kind).T[:, when])
    phase = phase_lanes(amplitude, segments.sense, arcs, tau[when])
    return lowest, lowest_tension(robot, segments, arcs, phase, kind)


class TensionScreen(NamedTuple):
    """Screen of motions of one robot, by their tensions at a few samples.

    Fields:
        robot: the robot.
        amplitude: amplitude function A.
        kind: kind of the motions.
        threshold: largest tension that refutes a motion.
        batch: number of motions computed in one call.
        count_samples: called with the number of computed samples.
    """

    robot: PlatformRobot
    amplitude: Amplitude
    kind: PlatformMotionKind
    threshold: float
    batch: int
    count_samples: Callable[[int], None]

    def lowest(self, segments: PlatformSegment, arcs: int, tau: Float[np.ndarray, "m"]) -> Float[np.ndarray, "n"]:
        """Smallest tension over some samples."""
        lowest = np.full(len(segments.rate), np.inf)
        for chunk in _chunks(tau):
            lowest = np.minimum(lowest, self._lowest(segments, arcs, chunk))
        return np.where(np.isnan(lowest), -np.inf, lowest)

    def refuted(
        self, segments: PlatformSegment, arcs: int, tau: Float[np.ndarray, "m"], *, limits: bool = True
    ) -> Bool[np.ndarray, "n"]:
        """Tell which motions some samples refute."""
        del limits
        is_refuted = np.zeros(len(segments.rate), bool)
        for chunk in _chunks(tau):
            alive = np.flatnonzero(~is_refuted)
            if not len(alive):
                break
            remaining = segments if len(alive) == len(is_refuted) else take_segments(segments, alive)
            if len(alive) <= device_batch_size(self.batch // FEWER):  # too few for two passes
                is_refuted[alive] = ~(self._lowest(remaining, arcs, chunk) > self.threshold)
                continue
            self.count_samples(len(alive) * (len(chunk) + 1))
            kernel = partial(_rough_and_certain, self.robot, self.amplitude, float(arcs), chunk, kind=self.kind)
            lowest, certain = in_batches(kernel, remaining, batch_size=self.batch)
            is_refuted[alive] = (lowest < 0.0) & ~(certain > self.threshold)
        return is_refuted

    def _lowest(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        # Screen a few motions in float64.
        self.count_samples(len(segments.rate) * len(tau))
        kernel = partial(smallest_tensions, self.robot, self.amplitude, float(arcs), tau, kind=self.kind)
        return in_batches(kernel, segments, batch_size=self.batch // FEWER)[0]


def _chunks(tau: np.ndarray) -> np.ndarray:
    # Repeat the last sample, so that all chunks have the same shape.
    length = -(-len(tau) // CHUNK) * CHUNK
    return np.pad(tau, (0, length - len(tau)), mode="edge").reshape(-1, CHUNK)
