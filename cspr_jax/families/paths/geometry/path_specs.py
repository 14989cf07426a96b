"""Paths between poses that tables of a plan describe: parts from stop to stop, with orientations at knots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from cspr_jax.config.keys.path import PathTable
from cspr_jax.config.motions.text import read
from cspr_jax.curves.interpolation import continuous
from cspr_jax.errors import InputError
from cspr_jax.families.paths.geometry.corners import Corners, position_paths_of
from cspr_jax.families.paths.geometry.elements import arc_of, elements_of
from cspr_jax.families.paths.geometry.section import PositionPath, Section, half_angles, section_of, turn
from cspr_jax.families.paths.geometry.through_points import chords, through_points
from cspr_jax.numerics.linear.rotations import products
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import UNIT_NORM

# A file must start within this distance of the pose before it, m.
MEETING = 1e-6


class PathEnds(NamedTuple):
    """Ends of a path; poses determine them, or the path itself.

    Fields:
        start: (3,) m; None: the path determines it.
        end: (3,) m; None: the path determines it.
        first: (4,) orientation at the start, a unit quaternion; None for a point mass.
        last: (4,) orientation at the end; None for a point mass.
    """

    start: np.ndarray | None
    end: np.ndarray | None
    first: np.ndarray | None = None
    last: np.ndarray | None = None


class FileAxes(NamedTuple):
    """Axes of a robot file.

    Fields:
        z_axis: "up" or "down".
        normal: (3,) axis of arcs that give none.
        turning: (4,) rotation from the reference axes of the platform to its axes in the file, a unit quaternion.
    """

    z_axis: str
    normal: np.ndarray
    turning: np.ndarray


class PathSpec(NamedTuple):
    """Consecutive paths; the motion is at rest between them.

    Fields:
        parts: the paths, at least one.
        quaternions: for each path the orientations at its knots, (k, 4) unit quaternions; empty for a point mass.
        is_planar: whether the points are from a file without y.
        feeds: words of G-code by speed; see `Section`.
        notes: lines for the user about the file.
    """

    parts: list[PositionPath]
    quaternions: list[np.ndarray]
    is_planar: bool = False
    feeds: Mapping[float, str] = MappingProxyType({})
    notes: Sequence[str] = ()

    def sections(self) -> list[Section]:
        """The paths with their orientations."""
        units = self.quaternions
        sections = [section_of(part, units[i] if units else None) for i, part in enumerate(self.parts)]
        return [section._replace(feeds=self.feeds) for section in sections]


def path_through(
    table: PathTable, points: Float[np.ndarray, "n 3"], quaternions: Float[np.ndarray, "n 4"] | None
) -> PathSpec:
    """Path of a table through given points."""
    closed = table.closed is True
    tolerance = table.blend_tolerance or 0.0
    parts = through_points(
        table.curve, points, quaternions, corner=table.corner or "stop", tolerance=tolerance, closed=closed
    )
    turnings, first = [], 0
    for part in parts:
        last = first + len(part.knots) - 1
        turnings.append(None if quaternions is None else quaternions[first : last + 1])
        first = last
    return PathSpec(parts, [turning for turning in turnings if turning is not None])


def path_of(table: PathTable, ends: PathEnds, folder: Path, axes: FileAxes) -> PathSpec:
    """Path of a table that has points of its own."""
    if table.points is not None or table.kind == "csv":
        return _through_own(table, ends, folder, axes)
    units = orientations(table, 1 if table.kind == "gcode" else 2)
    if units is not None:
        ends = ends._replace(first=units[0], last=units[-1])
    if table.kind == "gcode":
        start = None if ends.start is None else ends.start.tolist()
        rule: Corners = "blend" if table.corner == "blend" else "stop"
        from cspr_jax.config.gcode.reading import read_program

        moves, notes = read_program(folder / str(table.file), start)
        parts = position_paths_of(elements_of(moves), rule, table.blend_tolerance or 0.0)
        first = ends.first
        turnings = [] if first is None else [np.tile(first, (len(part.knots), 1)) for part in parts]
        return PathSpec(parts, turnings, feeds={move.speed: move.feed for move in moves}, notes=notes)
    axis = axes.normal if table.normal is None else np.asarray(table.normal)
    angle = 2.0 * np.pi if table.angle is None else table.angle
    start = np.asarray(table.start, float) if ends.start is None else ends.start
    parts = position_paths_of([arc_of(np.asarray(table.centre, float), start, axis, angle)])
    return PathSpec(parts, [] if ends.first is None or ends.last is None else [np.stack([ends.first, ends.last])])


def orientations(table: PathTable, count: int) -> Float[np.ndarray, "count 4"] | None:
    """Orientations that a table gives."""
    if table.orientations is None:
        return None
    units = np.asarray(table.orientations, float)
    if len(units) not in (1, count):
        allowed = f"must be one, or {count}" if count > 1 else "must be one"
        raise InputError("orientations", None, allowed, problem=f"{len(units)} of them")
    norms = np.linalg.norm(units, axis=1, keepdims=True)
    odd = np.flatnonzero(np.abs(norms[:, 0] - 1.0) > UNIT_NORM)
    if len(odd):
        i = int(odd[0])
        raise InputError(f"orientations[{i}]", units[i].tolist(), f"of length 1 (it has {float(norms[i, 0]):.7g})")
    return np.broadcast_to(units / norms, (count, 4))


def _through_own(table: PathTable, ends: PathEnds, folder: Path, axes: FileAxes) -> PathSpec:
    # Return the path through points of the table or of its file, and through the poses at its ends.
    units, is_planar, notes = None, False, list[str]()
    if table.kind == "csv":
        samples = read(folder / str(table.file), has_times=False).in_axes(axes.z_axis)
        points, units, is_planar = samples.positions, samples.quaternions, samples.is_planar
        notes = [f"{table.file}: {note}" for note in samples.notes]
        if units is not None:
            units = products(units, axes.turning[None])
    else:
        points = np.asarray(table.points, float)
    named = orientations(table, len(points))
    if units is not None and (named is not None or ends.first is None):
        allowed = "absent for a point mass" if ends.first is None else "absent beside orientations"
        raise InputError("file", table.file, f"a file without quaternions: must be {allowed}")
    units = named if units is None else units
    if table.kind == "csv":
        if ends.start is not None:
            _check_start(points[0], None if units is None else units[0], ends, table.file)
            points = np.concatenate([ends.start[None], points[1:]])
    else:
        points, units = _between_poses(points, units, ends)
    if table.closed and (points[-1] != points[0]).any():
        points = np.concatenate([points, points[:1]])
        units = None if units is None else np.concatenate([units, units[:1]])
    if units is None and ends.first is not None and ends.last is not None:
        s = np.concatenate([[0.0], np.cumsum(chords(points))])
        units = turn(continuous(np.stack([ends.first, ends.last])), s / s[-1])[0]
    return path_through(table, points, units)._replace(is_planar=is_planar, notes=notes)


def _check_start(position: np.ndarray, unit: np.ndarray | None, ends: PathEnds, file: str | None) -> None:
    # Refuse a file that does not start at the pose before it.
    if np.linalg.norm(position - ends.start) > MEETING:
        raise InputError("file", file, f"one that begins where the pose before is, not at {position.round(6).tolist()}")
    if (
        unit is not None
        and ends.first is not None
        and half_angles(continuous(np.stack([ends.first, unit])))[0] > MEETING
    ):
        raise InputError("file", file, "one that begins in the orientation of the pose before")


def _between_poses(
    points: np.ndarray, units: np.ndarray | None, ends: PathEnds
) -> tuple[np.ndarray, np.ndarray | None]:
    # Add positions and orientations of the poses at both ends to the points.
    for position, unit, before in ((ends.start, ends.first, True), (ends.end, ends.last, False)):
        if position is not None:
            points = np.concatenate([position[None], points] if before else [points, position[None]])
            if units is not None and unit is not None:
                units = np.concatenate([unit[None], units] if before else [units, unit[None]])
    return points, units
