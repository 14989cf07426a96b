"""Piecewise polynomial motion in Bernstein form: a table of samples or waypoints, interpolated."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.motion.formulas import Expression, MotionPiece, powers, rationals, rotated_by
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import cross, rotated
from cspr_jax.numerics.bounds.piecewise_bounds import overlaps, piecewise_bounds
from cspr_jax.numerics.bounds.rotation_bounds import rotation_bounds
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model.state import State
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

# Second derivatives that differ by less than this part of the largest one do not jump.
SAME = 1e-9
BATCH = 256  # number of parts of blocks whose rotations are bounded at a time
# The number of pieces is rounded up to one of these; longer tables stay, since copies cost more than compiling.
USUAL = (64, 256, 1024, 4096)


@dataclasses.dataclass(frozen=True)
class Spline:
    """Piecewise polynomial motion; see `motion.motion.Motion`.

    Fields:
        knots: (m + 1,) times between the m pieces, the first 0, increasing; s.
        position: (m, degree + 1, 3) Bernstein coefficients of each piece, m.
        quaternion: (m, degree + 1, 4) likewise, scalar first, continuous, of any norm but 0; None for a point mass.
        z0: () depth at which slacks are normalised, m.
        offset: (3,) from the point whose positions these are to the mass centre, platform axes, m; None: they coincide.
        interpolation: how its samples were joined, one of `curves.interpolation.INTERPOLATIONS`, or "pieces".
        ends: conditions at its ends, one of `curves.interpolation.ENDS`, or "".
    """

    knots: Array
    position: Array
    quaternion: Array | None
    z0: Any = dataclasses.field(default_factory=lambda: as_float64(1.0))
    offset: Array | None = None
    interpolation: str = "pieces"
    ends: str = ""

    def duration(self) -> Array:
        """Duration; see `Motion.duration`."""
        return self.knots[-1]

    def state(self, tau: Array) -> State:
        """State; see `Motion.state`."""
        knots = jnp.asarray(self.knots)
        t = tau * knots[-1]
        piece = jnp.clip(jnp.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
        width = knots[piece + 1] - knots[piece]
        fraction = (t - knots[piece]) / width
        quaternion = None if self.quaternion is None else jnp.asarray(self.quaternion)[piece]
        return piece_state(jnp.asarray(self.position)[piece], quaternion, fraction, width, self.offset)

    def padded(self) -> "Spline":
        """The same motion with its number of pieces rounded up, by copies of the first piece that last no time."""
        count = len(self.knots) - 1
        more = next((usual - count for usual in USUAL if usual >= count), 0)
        if more == 0:
            return self
        tables = {name: getattr(self, name) for name in ("knots", "position", "quaternion")}
        longer: dict[str, Any] = {
            name: as_float64(np.concatenate([np.repeat(np.asarray(table)[:1], more, axis=0), table]))
            for name, table in tables.items()
            if table is not None
        }
        return dataclasses.replace(self, **longer)

    def stretched(self, factor: float) -> "Spline":
        """The motion run more slowly, or faster."""
        return dataclasses.replace(self, knots=as_float64(np.asarray(self.knots) * factor))

    def breaks(self) -> Array:
        """Breaks; see `Motion.breaks`."""
        return self.knots[1:-1] / self.knots[-1]

    def jumps(self, fraction: float = SAME) -> Float[np.ndarray, "n"]:
        """Times at which the acceleration jumps."""
        width = np.diff(np.asarray(self.knots))[:, None]
        is_jump = np.zeros(len(width) - 1, bool)
        for table in (self.position, self.quaternion):
            degree = 0 if table is None else table.shape[1] - 1
            if table is not None and degree >= 2:
                second = np.diff(np.asarray(table), 2, axis=1) * (degree * (degree - 1)) / width[:, None] ** 2
                largest = np.abs(second).max(initial=0.0)
                is_jump |= (np.abs(second[1:, 0] - second[:-1, -1]) > fraction * largest).any(1)
        return np.asarray(self.knots)[1:-1][is_jump]

    def bounds(self, start: np.ndarray, end: np.ndarray) -> StateBounds:
        """Bounds of the states; see `BoundedMotion.bounds`."""
        quaternion = None if self.quaternion is None else np.asarray(self.quaternion)
        bounds = spline_bounds(np.asarray(self.knots), np.asarray(self.position), quaternion, start, end)
        return bounds if self.offset is None else moved(bounds, self.offset)

    def formulas(self) -> list[MotionPiece]:
        """Formulas; see `motion.formulas.HasFormulas`."""
        knots, tables = rationals(self.knots), [np.asarray(self.position)]
        tables += [] if self.quaternion is None else [np.asarray(self.quaternion)]
        offset = None if self.offset is None else rationals(self.offset)
        pieces = []
        for i, (start, end) in enumerate(itertools.pairwise(knots)):

            def curve(u: Expression, i: int = i, width: Fraction = end - start) -> Any:
                position, *turning = (_polynomials(rationals(table[i]), u / width) for table in tables)
                if not turning or offset is None:
                    return position, turning[0] if turning else None
                arm = rotated_by(turning[0], offset)
                return [x + y for x, y in zip(position, arm, strict=True)], turning[0]

            if start < end:
                pieces.append(MotionPiece(start, end, curve))
        return pieces


def _polynomials(table: list[list[Fraction]], x: Expression) -> list[Expression]:
    # Functions with these Bernstein coefficients (degree + 1, n).
    degree = len(table) - 1
    columns = []
    for column in zip(*table, strict=True):
        differences, row = list[Fraction](), list(column)
        while row:
            differences.append(row[0])
            row = [after - before for before, after in itertools.pairwise(row)]
        columns.append(powers([math.comb(degree, k) * c for k, c in enumerate(differences)], x))
    return columns


jax.tree_util.register_dataclass(
    Spline, ["knots", "position", "quaternion", "offset", "z0"], [], drop_fields=["interpolation", "ends"]
)


@persistent_jit
def moved(bounds: StateBounds, offset: Float[Array, "3"]) -> StateBounds:
    """Bounds of another point of a platform, over k blocks."""

    def one(state: StateBounds) -> StateBounds:
        arm = rotated(state.rotation, offset)
        turning = cross(state.angular_velocity, arm)
        relative = cross(state.angular_acceleration, arm) + cross(state.angular_velocity, turning)
        return state._replace(
            position=state.position + arm,
            velocity=state.velocity + turning,
            acceleration=state.acceleration + relative,
        )

    return jax.vmap(one)(bounds)


def part(spline: Spline, first: int, last: int) -> Spline:
    """Consecutive pieces of a spline, as a motion of its own."""
    knots = spline.knots[first : last + 1]
    turning = None if spline.quaternion is None else spline.quaternion[first:last]
    return dataclasses.replace(
        spline, knots=as_float64(knots - knots[0]), position=spline.position[first:last], quaternion=turning
    )


def chained(splines: Sequence[Spline]) -> Spline:
    """Consecutive splines as one motion."""
    ends = np.concatenate([[0.0], np.cumsum([spline.knots[-1] for spline in splines])])
    knots = [spline.knots[:-1] + start for spline, start in zip(splines, ends[:-1], strict=True)]
    tables: dict[str, Any] = {
        name: as_float64(np.concatenate([getattr(spline, name) for spline in splines]))
        for name in ("position", "quaternion")
        if getattr(splines[0], name) is not None
    }
    return dataclasses.replace(splines[0], knots=as_float64(np.append(np.concatenate(knots), ends[-1])), **tables)


def piece_state(
    position: Float[Array, "degree+1 3"],
    quaternion: Float[Array, "degree+1 4"] | None,
    fraction: Float[Array, ""],
    width: Float[Array, ""],
    offset: Array | None = None,
) -> State:
    """State on one piece of a spline."""
    point, velocity, acceleration = piece_values(position, fraction, width)
    if quaternion is None:
        return State(point, velocity, acceleration)
    rotation, angular_velocity, angular_acceleration, unit = turning_of(*piece_values(quaternion, fraction, width))
    if offset is not None:
        arm = rotation @ offset
        turning = jnp.cross(angular_velocity, arm)
        point, velocity = point + arm, velocity + turning
        acceleration = acceleration + jnp.cross(angular_acceleration, arm) + jnp.cross(angular_velocity, turning)
    return State(point, velocity, acceleration, rotation, angular_velocity, angular_acceleration, unit)


def piece_values(
    coefficients: Float[Array, "degree+1 n"], fraction: Float[Array, ""], width: Float[Array, ""]
) -> tuple[Float[Array, "n"], Float[Array, "n"], Float[Array, "n"]]:
    """Value and first two derivatives on one piece."""
    degree = coefficients.shape[0] - 1
    first = jnp.diff(coefficients, axis=0) * (degree / width)
    second = jnp.diff(first, axis=0) * (max(degree - 1, 0) / width)
    return _bernstein(coefficients, fraction), _bernstein(first, fraction), _bernstein(second, fraction)


def _bernstein(coefficients: Array, fraction: Array) -> Array:
    # By the steps of de Casteljau.
    while coefficients.shape[0] > 1:
        coefficients = coefficients[:-1] + fraction * jnp.diff(coefficients, axis=0)
    return coefficients.sum(0)


def turning_of(
    quaternion: Float[Array, "4"], first: Float[Array, "4"], second: Float[Array, "4"]
) -> tuple[Float[Array, "3 3"], Float[Array, "3"], Float[Array, "3"], Float[Array, "4"]]:
    """Rotation of a quaternion that is normalised afterwards; as in `numerics.bounds.rotation_bounds`."""
    square = jnp.dot(quaternion, quaternion)
    unit = quaternion / jnp.sqrt(square)
    rotation = rotations.matrix(unit)

    def across(f: Array) -> Array:
        turning = f[1:] * quaternion[0] - f[0] * quaternion[1:] - jnp.cross(f[1:], quaternion[1:])
        return 2.0 * turning / square

    angular_velocity = across(first)
    angular_acceleration = across(second) - angular_velocity * (2.0 * jnp.dot(quaternion, first) / square)
    return rotation, angular_velocity, angular_acceleration, unit


def spline_bounds(
    knots: np.ndarray,
    position: Float[np.ndarray, "m degree+1 3"],
    quaternion: Float[np.ndarray, "m degree+1 4"] | None,
    start: Float[np.ndarray, "k"],
    end: Float[np.ndarray, "k"],
    *,
    of_knots: np.ndarray | None = None,
    of_blocks: Int[np.ndarray, "k"] | None = None,
    parabolas: bool = False,
) -> StateBounds:
    """Bounds of the states over blocks of time, of one motion or of a batch, whose tables follow each other."""
    motions = (of_knots, of_blocks) if of_knots is not None and of_blocks is not None else None
    parts = overlaps(knots, start, end, motions)
    translation = piecewise_bounds(position, parts, parabolas=parabolas)
    if quaternion is None:
        return StateBounds(*translation)
    turning = piecewise_bounds(quaternion, parts, parabolas=parabolas)
    return StateBounds(*translation, *in_batches(_rotations, turning, batch_size=BATCH))


@persistent_jit(compiler_options=compile_options.proof_options())
def _rotations(quaternions):
    return jax.vmap(rotation_bounds)(*quaternions)


class SplineBatch:
    """Splines of one degree and any numbers of pieces; all of them have orientations, or none has."""

    def __init__(self, splines: Sequence[Spline]):
        """Join the tables."""
        self._offset = splines[0].offset
        if any(not np.array_equal(np.asarray(spline.offset), np.asarray(self._offset)) for spline in splines):
            raise ValueError("one offset of the mass centre")
        self._knots = np.concatenate([np.asarray(spline.knots) for spline in splines])
        self._of_knots = np.repeat(np.arange(len(splines)), [len(spline.knots) for spline in splines])
        turning = [spline.quaternion for spline in splines if spline.quaternion is not None]
        if len(turning) not in (0, len(splines)):
            raise ValueError("either all splines have orientations, or none")
        self._position = np.concatenate([np.asarray(spline.position) for spline in splines])
        self._quaternion = np.concatenate([np.asarray(table) for table in turning]) if turning else None
        self.durations = np.array([float(spline.knots[-1]) for spline in splines])
        self.jumps = [spline.jumps() for spline in splines]

    def bounds(
        self,
        motion: Int[np.ndarray, "k"],
        start: Float[np.ndarray, "k"],
        end: Float[np.ndarray, "k"],
        *,
        parabolas: bool = False,
    ) -> StateBounds:
        """Bounds of the states over blocks; see `motion.motion.BoundedMotion.bounds`."""
        bounds = spline_bounds(
            self._knots,
            self._position,
            self._quaternion,
            start,
            end,
            of_knots=self._of_knots,
            of_blocks=motion,
            parabolas=parabolas,
        )
        return bounds if self._offset is None else moved(bounds, self._offset)
