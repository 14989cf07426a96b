"""A plan in MuJoCo's coordinates: what hangs on the cables, its motion, and the tensions that play it.

World axes have z up: they are the axes of the robot file, rotated by half a turn about x where its z points down.
Tensions are given at both ends and in the middle of each step, where the integrator, RK4, needs them. No step extends
across a time at which the acceleration, or its derivative, may jump.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cspr_jax.errors import ConfigError, shown
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.outputs.motion_files import LARGEST_ROWS, rows_at
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.pulleys import Pulleys
from cspr_jax.robots.model.shapes import Body, Obstacle, inward, rotated

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

STEP = 0.0005  # s, default of the longest step
# In normalised time:
BESIDE = 4e-15  # distance of the rows on both sides of a jump from the jump
ONE_JUMP = 1e-9  # jumps closer together than this are one
_SIGNS = {"up": (1.0, 1.0, 1.0), "down": (1.0, -1.0, -1.0)}


class Suspended(NamedTuple):
    """A robot in MuJoCo's axes.

    Fields:
        name: name, for texts.
        z_axis: direction of z in its file, "down" or "up".
        axes: axes of the slide joints of the effector, 0 to 2; empty: it has a free joint.
        mass: kg.
        inertia: (3, 3) about the mass centre, body axes, kg m^2; None: a point mass.
        gravity: m/s^2.
        spools: (n_cables, 3) m.
        points: (n_cables, 3) attachment points from the mass centre, body axes, m.
        tension_max: (n_cables,) N; infinite where no limit is given.
        cable_diameter: m; None: not known.
        obstacles: bodies fixed in space.
        body: shape of the platform in body axes, from the mass centre; None: not known.
        pulleys: pulleys, with MuJoCo's axes; None: cables leave from points.
        axial_stiffness: (n_cables,) EA of the cables, N; None: they do not stretch.
        axial_damping: tension over rate of strain, N s.
    """

    name: str
    z_axis: str
    axes: tuple[int, ...]
    mass: float
    inertia: np.ndarray | None
    gravity: float
    spools: np.ndarray
    points: np.ndarray
    tension_max: np.ndarray
    cable_diameter: float | None = None
    obstacles: tuple[Obstacle, ...] = ()
    body: Body | None = None
    pulleys: Pulleys | None = None
    axial_stiffness: np.ndarray | None = None
    axial_damping: float = 0.0

    @property
    def wheels(self) -> np.ndarray:
        """Indices of the cables that leave from pulleys with a radius above 0."""
        return np.empty(0, int) if self.pulleys is None else np.flatnonzero(np.asarray(self.pulleys.radius) > 0.0)


@dataclasses.dataclass(frozen=True)
class Played:
    """Motion and tensions at every half of a step, in MuJoCo's axes.

    Fields:
        time: (n,) time from the start of the plan, s; a time that occurs twice ends a run of steps and starts another.
        segment: (n,) numbers of the segments, from 1 on.
        tension: (n, n_cables) N.
        position: (n, 3) position of the mass centre, m.
        velocity: (n, 3) m/s.
        acceleration: (n, 3) m/s^2.
        rotation: n rotations from body to world axes; None for an effector that does not turn.
        omega: (n, 3) angular velocity in body axes, rad/s; None likewise.
        omega_dot: (n, 3) its derivative, rad/s^2; None likewise.
        length: (n, n_cables) lengths of the cables, m; None: not known.
    """

    time: np.ndarray
    segment: np.ndarray
    tension: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    rotation: "Rotation | None" = None
    omega: np.ndarray | None = None
    omega_dot: np.ndarray | None = None
    length: np.ndarray | None = None

    def runs(self) -> list[range]:
        """Runs of steps without a jump."""
        ends = np.flatnonzero(np.diff(self.time) == 0.0) + 1
        return [range(a, b) for a, b in itertools.pairwise([0, *ends.tolist(), len(self.time)])]

    def coordinates(
        self, axes: Sequence[int]
    ) -> tuple[Float[np.ndarray, "n nq"], Float[np.ndarray, "n nv"], Float[np.ndarray, "n nv"]]:
        """Coordinates of MuJoCo's joints, their velocities and accelerations."""
        if self.rotation is None or self.omega is None or self.omega_dot is None:
            chosen = list(axes)
            return self.position[:, chosen], self.velocity[:, chosen], self.acceleration[:, chosen]
        qpos = np.hstack([self.position, np.roll(self.rotation.as_quat(), 1, axis=1)])  # SciPy: scalar last
        return qpos, np.hstack([self.velocity, self.omega]), np.hstack([self.acceleration, self.omega_dot])


def upward(z_axis: str) -> Frame:
    """Axes of a robot file beside those of MuJoCo; the origin is the same."""
    return Frame(np.array(_SIGNS[z_axis]), np.zeros(3), np.zeros(3))


def suspended(plan: PlannedMotions) -> Suspended:
    """The robot of a plan for MuJoCo."""
    robot, written, world = plan.problem.robot, plan.robot_file.as_written, upward(plan.robot_file.z_axis)
    row, inertia = PATTERNS[robot.pattern], None
    points = np.zeros((len(written.base_points), 3))
    if plan.robot_file.pairs is not None:
        points = world.rotated(np.asarray(written.platform_points) - np.asarray(written.centre_of_mass or [0.0] * 3))
        inertia = world.rotated_tensor(np.asarray(written.inertia))
    elif row.is_body:
        points = world.rotated(plan.frame.rotated(np.asarray(robot.platform_points)))
        inertia = world.rotated_tensor(plan.frame.rotated_tensor(np.asarray(robot.inertia)))
    pulleys = robot.pulleys
    if pulleys is not None:
        pulleys = Pulleys(pulleys.radius, as_float64(world.rotated(plan.frame.rotated(np.asarray(pulleys.axes)))))
    limits = [getattr(spec, "tension_max", None) for spec in (plan.keys, written)]
    limit = next((value for value in limits if value is not None), np.inf)
    return Suspended(
        name=plan.robot_file.name,
        z_axis=plan.robot_file.z_axis,
        axes=() if row.is_body else row.forces,
        mass=float(robot.mass),
        inertia=inertia,
        gravity=float(robot.gravity),
        spools=world.inward(written.base_points),
        points=points,
        tension_max=np.broadcast_to(np.asarray(limit, float), len(points)),
        cable_diameter=None if robot.cable_diameter is None else float(robot.cable_diameter),
        pulleys=pulleys,
        axial_stiffness=None
        if written.axial_stiffness is None
        else np.broadcast_to(np.asarray(written.axial_stiffness, float), (len(points),)),
        axial_damping=written.axial_damping or 0.0,
        obstacles=tuple(inward(table.shape(), world) for table in plan.keys.obstacle or ()),
        body=_body(plan, points),
    )


def _body(plan: PlannedMotions, points: np.ndarray) -> Body | None:
    # Shape of the platform, rotated from the axes of the file together with its attachment points.
    written = plan.robot_file.as_written
    centre = np.asarray(written.centre_of_mass or [0.0] * 3, float)
    shape = plan.keys.body(centre.tolist(), written.platform_points or ())
    if shape is None:
        return None
    from scipy.spatial.transform import Rotation  # takes time, and plans import this file

    return rotated(shape, Rotation.align_vectors(points, np.asarray(written.platform_points) - centre)[0].as_matrix())


def attachments(body: Suspended, moved: Played) -> Float[np.ndarray, "n n_cables 3"]:
    """Points at which the cables are attached, at all rows."""
    arms = body.points[None]
    if moved.rotation is not None:
        arms = np.einsum("nij,kj->nki", moved.rotation.as_matrix(), body.points)
    return moved.position[:, None] + arms


def coordinates(
    body: Suspended, moved: Played
) -> tuple[Float[np.ndarray, "n nq"], Float[np.ndarray, "n nv"], Float[np.ndarray, "n nv"]]:
    """Coordinates of all of MuJoCo's joints, their velocities and accelerations."""
    qpos, rates, accelerations = moved.coordinates(body.axes)
    if body.pulleys is None or not len(body.wheels):
        return qpos, rates, accelerations
    speeds = np.repeat(moved.velocity[:, None], len(body.points), axis=1)
    if moved.rotation is not None and moved.omega is not None:
        swing = np.cross(moved.omega[:, None], body.points[None])
        speeds = speeds + np.einsum("nij,nkj->nki", moved.rotation.as_matrix(), swing)
    axes = np.asarray(body.pulleys.axes)[body.wheels]
    rays = (attachments(body, moved) - body.spools)[:, body.wheels]
    across = np.cross(axes, rays)
    first = across[0] / np.linalg.norm(across[0], axis=1, keepdims=True)
    angles = np.arctan2(-np.sum(across * np.cross(first, axes), axis=2), np.sum(across * first, axis=2))
    turning = np.sum(across * speeds[:, body.wheels], axis=2) / np.sum(across**2, axis=2)
    both = zip((qpos, rates, accelerations), (angles, turning, np.zeros_like(turning)), strict=True)
    return tuple(np.hstack(pair) for pair in both)  # type: ignore[return-value]


def played(plan: PlannedMotions, step: float = STEP) -> Played:
    """Motion and tensions of a plan at the times at which MuJoCo needs them."""
    if not 0.0 < step < math.inf:
        raise ConfigError("--step", f"{shown(step)}: must be a number > 0, in s")
    check_durations(plan)
    if 2.0 * plan.answers.duration.sum() / step > LARGEST_ROWS:
        raise ConfigError("--step", f"{step:g} s: must give at most {LARGEST_ROWS} rows, two a step")
    taus, times = _step_times(plan, step)
    columns, segment = rows_at(plan, taus), np.repeat(np.arange(1, len(taus) + 1), [len(tau) for tau in taus])
    columns |= {"t": times, "tension": columns["tension" if plan.robot_file.pairs is None else "tension_each"]}
    check_finite(columns)
    return in_world(columns, segment, plan.robot_file.z_axis)


def check_durations(plan: PlannedMotions) -> None:
    """Refuse segments without a motion."""
    if not np.isfinite(plan.answers.duration).all():
        raise ConfigError("plan", "cannot be played: a segment has no motion; see its verdict")


def check_finite(columns: Mapping[str, np.ndarray]) -> None:
    """Refuse motions and tensions that are not finite."""
    if not all(np.isfinite(columns[name]).all() for name in ("tension", "position", "acceleration")):
        raise ConfigError("plan", "cannot be played: its motion or its tensions are not finite; see its verdicts")


def in_world(columns: Mapping[str, np.ndarray], segment: Int[np.ndarray, "n"], z_axis: str) -> Played:
    """A motion in MuJoCo's axes."""
    world = upward(z_axis)
    moved: dict[str, Any] = {name: world.rotated(columns[name]) for name in ("position", "velocity", "acceleration")}
    if "quaternion" in columns:
        from scipy.spatial.transform import Rotation  # takes time, likewise

        # SciPy has the scalar last.
        rotation = Rotation.from_quat(np.roll(world.rotated_quaternions(columns["quaternion"]), -1, axis=1))
        back = rotation.inv()
        # The derivative of omega is the same in rotating axes, since omega x omega is zero.
        moved |= {name: back.apply(world.rotated(columns[name])) for name in ("omega", "omega_dot")}
        moved["rotation"] = rotation
    moved["length"] = columns.get("length")
    return Played(time=columns["t"], segment=segment, tension=columns["tension"], **moved)


def _step_times(plan: PlannedMotions, step: float) -> tuple[list[np.ndarray], np.ndarray]:
    # Normalised times of each segment, and all times; the rows on both sides of a jump have the same time.
    taus, times, start = [], [], 0.0
    for motion, length in zip(plan.motions, plan.answers.duration.tolist(), strict=True):
        knots, taus_of_motion = [0.0], []
        for knot in sorted(np.asarray(motion.breaks()).tolist()):
            knots += [knot] if knots[-1] + ONE_JUMP < knot < 1.0 - ONE_JUMP else []
        for first, last in itertools.pairwise([*knots, 1.0]):
            tau = np.linspace(first, last, 2 * math.ceil((last - first) * length / step) + 1)
            times.append(start + tau * length)
            taus_of_motion.append(np.clip(tau, first + BESIDE * (first > 0.0), last - BESIDE * (last < 1.0)))
        taus.append(np.concatenate(taus_of_motion))
        start += length
    return taus, np.concatenate(times)
