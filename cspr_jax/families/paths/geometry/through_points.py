"""Paths through points: straight lines between them, or C2 and C4 splines over the lengths of their chords."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.interpolate import BPoly

from cspr_jax.curves.interpolation import continuous, interpolated
from cspr_jax.errors import InputError
from cspr_jax.families.paths.geometry.corners import Corners, position_paths_of
from cspr_jax.families.paths.geometry.elements import SAME_PLACE, Straight
from cspr_jax.families.paths.geometry.section import SAME_ORIENTATION, PositionPath, half_angles
from cspr_jax.numerics.shapes import Float

STANDING = 1e-6  # a spline stops if its speed over that along the chords is below this
SAMPLES = 32  # samples of each piece of a spline, to find where it stops
# Smallest ratio of the shortest to the longest chord of a spline; pieces of shorter ones have too few digits.
SMALLEST_CHORD = 1e-6


def chords(
    points: Float[np.ndarray, "n 3"], quaternions: Float[np.ndarray, "n 4"] | None = None
) -> Float[np.ndarray, "n-1"]:
    """Distances between consecutive points; where only the orientation changes, its angle."""
    if len(points) < 2:
        raise InputError("points", None, "must be two or more", problem=f"{len(points)} of them")
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if quaternions is not None:
        halves = half_angles(continuous(quaternions))
        lengths = np.where((lengths <= SAME_PLACE) & (halves > SAME_ORIENTATION), 2.0 * halves, lengths)
    same = np.flatnonzero(lengths <= SAME_PLACE)
    if len(same):
        raise InputError("points", points[same[0] + 1].tolist(), "another place than the point before it")
    return lengths


def through_points(
    kind: str,
    points: Float[np.ndarray, "n 3"],
    quaternions: Float[np.ndarray, "n 4"] | None = None,
    *,
    corner: str = "stop",
    tolerance: float = 0.0,
    closed: bool = False,
) -> list[PositionPath]:
    """Paths through points; each knot is at a point, or at the blended corner at it."""
    lengths = chords(points, quaternions)
    if kind in ("line", "polyline") or len(points) == 2:
        lines = [Straight(a, b, turn) for a, b, turn in zip(points, points[1:], lengths.tolist(), strict=False)]
        rule: Corners = "every" if kind == "line" else "blend" if corner == "blend" else "stop"
        return position_paths_of(lines, rule, tolerance)
    close = np.flatnonzero(lengths < SMALLEST_CHORD * lengths.max())
    if len(close):
        allowed = f"at least {SMALLEST_CHORD:g} of the longest step from the point before it, {lengths.max():.3g} m"
        raise InputError(f"points[{close[0] + 1}]", points[close[0] + 1].tolist(), allowed)
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    curve = interpolated(s, points, interpolation=kind, ends="periodic" if closed else "natural")
    values = BPoly(np.moveaxis(np.asarray(curve.position), 1, 0), s)
    position, first, second = (values(s, order) for order in range(3))
    # Take the last value from the last piece, so that the second derivative of a natural spline is 0 there, too.
    fine = np.concatenate([np.linspace(*ends, SAMPLES, endpoint=False) for ends in itertools.pairwise(s)])
    speeds = np.linalg.norm(values(fine, 1), axis=1)
    if speeds.min() <= STANDING and (np.diff(points, axis=0) != 0.0).any():
        i = int(np.argmin(speeds)) // SAMPLES
        raise InputError("points", None, "must make a curve that turns back nowhere", problem=f"behind points[{i}]")
    return [PositionPath(s, position, first, second, np.full(len(lengths), np.inf), s)]
