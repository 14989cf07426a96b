"""A section of a path on its grid: half-planes at both sides of all cells, with margins, in the form for solvers."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.constraints import HalfPlanes, face_count
from cspr_jax.families.paths.least_time.multipliers import SideHalfPlanes
from cspr_jax.families.paths.least_time.nodes import PathGrid, PathSpeeds, grid_of, side_half_planes
from cspr_jax.families.paths.least_time.smooth import NodeHalfPlanes
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.cables import AnyRobot

# Path speeds are at most this multiple of that of a fall along the path.
FASTER = 1e2
# Coefficients of x on both sides of a node count as equal if they differ by less.
SAME = 1e-6


class GridMargins(NamedTuple):
    """Margins that half-planes must keep in each cell, (n_cells,) each.

    Fields:
        tension: distance of every tension from both ends of its range, N.
        acceleration: fraction of each limit of an acceleration.
        speed: fraction of each limit of a speed.
    """

    tension: np.ndarray
    acceleration: np.ndarray
    speed: np.ndarray

    def at_nodes(self) -> "GridMargins":
        """Margins at nodes: the larger of those of the two adjacent cells."""
        return GridMargins(*(np.fmax(np.append(x, x[-1]), np.insert(x, 0, x[0])) for x in self))


@dataclasses.dataclass(frozen=True)
class Discrete:
    """A section on its grid.

    Fields:
        section: the section, with NumPy leaves.
        grid: nodes, and limits of speeds.
        start: half-planes at the starts of the cells, (n_cells, n_rows).
        end: half-planes at the ends of the cells.
        is_tension: (n_rows,) whether half-planes bound tensions; margins of others are fractions of their limits.
        ends: x at the start and at the end of the section.
        largest: upper bound of all x.
    """

    section: Section
    grid: PathGrid
    start: HalfPlanes
    end: HalfPlanes
    is_tension: np.ndarray
    ends: tuple[float, float]
    largest: float

    @property
    def no_margins(self) -> GridMargins:
        """Margins of zero."""
        return GridMargins(*np.zeros((3, len(self.grid.width))))

    def can_rest(self) -> tuple[bool, bool]:
        """Tell whether the effector can rest at the start, and at the end."""
        first, last = ((half_planes.bound[k] >= 0.0).all() for half_planes, k in ((self.start, 0), (self.end, -1)))
        return bool(first), bool(last)

    def with_margins(self, margins: GridMargins) -> "Discrete":
        """The same section with tighter half-planes and caps."""
        nodes = margins.at_nodes()

        def tighter(half_planes: HalfPlanes, part: slice) -> HalfPlanes:
            lost = np.where(self.is_tension, nodes.tension[part, None], nodes.acceleration[part, None])
            return half_planes._replace(
                bound=half_planes.bound - half_planes.margin_loss * lost,
                cap=half_planes.cap * (1.0 - nodes.speed[part]) ** 2,
            )

        first, last = tighter(self.start, slice(None, -1)), tighter(self.end, slice(1, None))
        return dataclasses.replace(self, start=first, end=last)

    def cap(self) -> Float[np.ndarray, "n_cells+1"]:
        """Largest x at the nodes."""
        both = np.append(self.start.cap, np.inf), np.insert(self.end.cap, 0, np.inf)
        return np.minimum(np.minimum(*both), self.largest)

    def node_half_planes(self) -> NodeHalfPlanes:
        """Half-planes at the nodes; all of them where the two sides of a node differ."""
        sides = [np.concatenate([s, e[-1:]]).T for s, e in zip(self.start[:3], self.end[:3], strict=True)]
        jump = np.abs(self.start.x[1:] - self.end.x[:-1]).max(initial=0.0)
        if jump > SAME * np.abs(self.start.x).max():
            before = [np.concatenate([s[:1], e]).T for s, e in zip(self.start[:3], self.end[:3], strict=True)]
            sides = [np.concatenate(pair) for pair in zip(sides, before, strict=True)]
        u, x, maximum = sides
        return NodeHalfPlanes(u, x, maximum, self.cap(), self.grid.width)

    def dual_half_planes(self) -> SideHalfPlanes:
        """Half-planes of the dual problem."""
        start, end = self.start, self.end
        return SideHalfPlanes(
            u=np.concatenate([start.u, end.u[-1:]]).T,
            before=np.concatenate([start.x[:1], end.x]).T,
            after=np.concatenate([start.x, end.x[-1:]]).T,
            bound=np.concatenate([start.bound, end.bound[-1:]]).T,
            cap=np.minimum(0.5 * (start.cap + end.cap), self.largest),
            width=self.grid.width,
        )


def discretes(
    problem: Problem,
    sections: Sequence[Section],
    settings: Sequence[SectionSettings],
    references: Sequence[PathSpeeds | None] | None = None,
) -> list[Discrete]:
    """Sections on their grids, with references with limits of motors near these."""
    robot = problem.robot
    speed_max = np.inf if problem.limits.speed_max is None else float(problem.limits.speed_max)
    grids = [
        grid_of(section, each.grid, (each.start_speed == 0.0, each.end_speed == 0.0), speed_max)
        for section, each in zip(sections, settings, strict=True)
    ]
    near = references or [None] * len(sections)
    sides = side_half_planes(robot, problem.limits, [section.curve for section in sections], grids, near)
    is_tension = _of_tensions(robot, sides[0][0].bound.shape[1], near[0] is not None)
    paths = []
    for section, each, grid, (start, end) in zip(sections, settings, grids, sides, strict=True):
        speeds = zip((each.start_speed, each.end_speed), _steepness(section.curve), strict=True)
        first, last = ((speed / steepness) ** 2 if speed else 0.0 for speed, steepness in speeds)
        largest = FASTER**2 * float(robot.gravity) * float(section.curve.knots[-1])
        paths.append(Discrete(section, grid, start, end, is_tension, (first, last), largest))
    return paths


def _of_tensions(robot: AnyRobot, n_rows: int, has_motors: bool) -> Bool[np.ndarray, "n_rows"]:
    # Tell which half-planes bound tensions: the first ones and, of motors of redundant cables, the last ones.
    count, number = face_count(robot), np.arange(n_rows)
    return (number < count) | (has_motors & (robot.n_cables > robot.dof) & (number >= n_rows - count))


def _steepness(curve: Spline) -> tuple[float, float]:
    # Return lengths of the path per unit of s, at both ends.
    points, knots = np.asarray(curve.position), np.asarray(curve.knots)
    steps = (points[0, 1] - points[0, 0], knots[1] - knots[0]), (points[-1, -1] - points[-1, -2], knots[-1] - knots[-2])
    first, last = ((points.shape[1] - 1) * float(np.linalg.norm(step)) / float(width) for step, width in steps)
    return first, last
