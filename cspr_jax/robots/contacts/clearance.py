"""Clearance of many poses: signed distances of cables from each other, from obstacles and from their own platform.

Obstacles are in the axes of the robot; the shape of the platform is in platform axes, with the mass centre as origin.
Every kind of contact in a scene has a kernel of `clearance_kernels`, compiled once for each robot.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Literal, NamedTuple

import jax
import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.batches import device_batch_size, in_batches, in_parts, in_threads
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.contacts import clearance_kernels as kernels
from cspr_jax.robots.model.platform import PlatformRobot, separate_pairs
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.shapes import Body, Box, Cylinder, Hull, Obstacle, Sphere, hull, is_flat

# Number of poses of a batch on a CPU; rates are about the same from 16384 to 131072.
BATCH = 65_536
# Batch length for few poses, such as those of one step of a search.
FEW = 4096
# Length of a cable next to its attachment point on which contacts with the platform do not count: this many diameters,
# or this fraction of the extent of the platform's shape.
LEAVE_DIAMETERS = 10.0
LEAVE_FRACTION = 0.01
# Rounding error of a clearance over machine epsilon times the largest coordinate of pose, robot and obstacles; the
# largest value in tests was 2.2.
EPSILONS = 16.0

Kind = Literal["cables", "obstacle", "platform", "platform-obstacle"]


class ContactPair(NamedTuple):
    """Two bodies that can meet.

    Fields:
        kind: "cables": two cables; "obstacle": a cable and an obstacle; "platform": a cable and its own platform;
            "platform-obstacle": the platform and an obstacle.
        cable: index of the cable, of two cables the first; -1 for the platform.
        other: index of the other cable or of the obstacle; -1 for the platform.
    """

    kind: Kind
    cable: int
    other: int


@dataclasses.dataclass(frozen=True)
class Scene:
    """A robot among the bodies with which its cables can collide.

    Fields:
        base_points: (n_cables, 3) m.
        platform_points: (n_cables, 3) platform axes, from the mass centre, m; zero for a point mass.
        diameters: (n_cables,) m.
        pairs: cables that share neither spool nor platform point.
        obstacles: shapes fixed in space.
        body: shape of the platform in its axes, from the mass centre; None: contacts with the platform do not count.
        leave: length of each cable next to its attachment point on which contacts with the platform do not count, m.
    """

    base_points: np.ndarray
    platform_points: np.ndarray
    diameters: np.ndarray
    pairs: tuple[tuple[int, int], ...]
    obstacles: tuple[Obstacle, ...]
    body: Body | None
    leave: float

    @property
    def contact_pairs(self) -> tuple[ContactPair, ...]:
        """Pairs of bodies to which `Clearances.nearest` refers by index."""
        cables = range(len(self.base_points))
        pairs_of_bodies = [ContactPair("cables", i, j) for i, j in self.pairs]
        pairs_of_bodies += [ContactPair("obstacle", i, j) for j in range(len(self.obstacles)) for i in cables]
        if self.body is not None:
            pairs_of_bodies += [ContactPair("platform", i, -1) for i in cables]
            pairs_of_bodies += [ContactPair("platform-obstacle", -1, j) for j in range(len(self.obstacles))]
        return tuple(pairs_of_bodies)


class Clearances(NamedTuple):
    """Clearances of poses.

    Fields:
        clearance: (n,) the smallest of all clearances, m; negative where two bodies meet; inf where nothing can meet.
        nearest: (n,) index in `Scene.contact_pairs` of the two nearest bodies; -1 where nothing can meet.
        cables: (n,) the smallest clearance of two cables, m; inf where none can meet.
        obstacles: (n,) the smallest clearance of obstacles from cables and platform, m.
        platform: (n,) smallest clearance of cables from their own platform, m; at most `leave` for longer cables.
        is_open: (n,) whether the smallest clearance is within rounding of the threshold.
    """

    clearance: np.ndarray
    nearest: np.ndarray
    cables: np.ndarray
    obstacles: np.ndarray
    platform: np.ndarray
    is_open: np.ndarray


def scene(
    robot: PlatformRobot | PointMassRobot,
    *,
    diameter=0.0,
    obstacles: Sequence[Obstacle] = (),
    body: Body | None = None,
    leave: float | None = None,
) -> Scene:
    """Make a scene: a robot among the bodies with which its cables can collide."""
    base = np.asarray(robot.base_points, float)
    diameters = np.asarray(diameter, float)
    if (diameters.ndim and diameters.shape != (len(base),)) or not (np.isfinite(diameters) & (diameters >= 0.0)).all():
        raise InputError("diameter", diameter, f"one length, or {len(base)}, not negative")
    if body is not None and not isinstance(robot, PlatformRobot):
        raise InputError("body", None, "must be None", problem="a point mass has no shape")
    if leave is None:
        extent = 0.0 if body is None else float(np.ptp(_corners(body), axis=0).max())
        leave = max(LEAVE_DIAMETERS * float(diameters.max()), LEAVE_FRACTION * extent)
    if not 0.0 <= leave < np.inf:
        raise InputError("leave", leave, "a length, not negative")
    platform = np.asarray(robot.platform_points, float) if isinstance(robot, PlatformRobot) else np.zeros_like(base)
    pairs = separate_pairs(robot) if isinstance(robot, PlatformRobot) else ()
    return Scene(base, platform, np.broadcast_to(diameters, (len(base),)), pairs, tuple(obstacles), body, float(leave))


def attachment_hull(robot: PlatformRobot) -> Hull | None:
    """The convex hull of the points where cables are attached."""
    points = np.asarray(robot.platform_points, float)
    return None if is_flat(points) else hull(points, name="platform")


def clearances(
    scene: Scene,
    positions,
    quaternions=None,
    *,
    ends=None,
    threshold: float = 0.0,
    dtype: Literal["float64", "float32"] = "float64",
) -> Clearances:
    """Clearances of poses."""
    poses = _checked(scene, positions, quaternions, ends)
    if not len(poses.position):
        return _nothing(0)
    answers = _all(scene, poses, threshold, np.dtype(dtype))
    again = np.flatnonzero(answers.is_open)
    if dtype == "float32" and len(again):
        for old, new in zip(answers, _all(scene, poses.rows(again), threshold, np.dtype("float64")), strict=True):
            old[again] = new
    return answers


class _CheckedPoses(NamedTuple):
    position: np.ndarray  # (n, 3)
    quaternion: np.ndarray | None  # (n, 4)
    spools: np.ndarray | None  # (n, n_cables, 3)

    def rows(self, index) -> "_CheckedPoses":
        quaternion, spools = (None if x is None else x[index] for x in self[1:])
        return _CheckedPoses(self.position[index], quaternion, spools)

    def lanes(self, origin: np.ndarray, dtype: np.dtype) -> kernels.PoseLanes:
        def columns(array):
            return tuple(np.ascontiguousarray(column, dtype) for column in array.T)

        quaternion = None if self.quaternion is None else columns(self.quaternion)
        ends = None if self.spools is None else [columns(x) for x in np.swapaxes(self.spools - origin, 0, 1)]
        return kernels.PoseLanes(columns(self.position - origin), quaternion, ends)


def _checked(scene: Scene, positions, quaternions, ends) -> _CheckedPoses:
    points = np.asarray(positions, float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("positions", None, "must be (n, 3)", problem=f"an array of shape {points.shape}")

    def checked(name: str, values, shape: tuple[int, ...]) -> np.ndarray | None:
        array = None if values is None else np.asarray(values, float)
        if array is not None and array.shape != shape:
            raise InputError(name, None, f"must be {shape}", problem=f"an array of shape {array.shape}")
        return array

    quaternion = checked("quaternions", quaternions, (len(points), 4))
    return _CheckedPoses(points, quaternion, checked("ends", ends, (len(points), len(scene.base_points), 3)))


def _all(scene: Scene, all_poses: _CheckedPoses, threshold: float, dtype: np.dtype) -> Clearances:
    # Subtract the centroid of the spools, so that no digits of float32 are lost to a distant origin.
    origin = scene.base_points.mean(0)
    terms = list(_terms(scene, origin, dtype))
    extent = max(float(np.abs(x).max()) for x in (scene.base_points - origin, scene.platform_points))
    largest = max([extent] + [_largest_coordinate(shape, origin) for shape in scene.obstacles])
    bound, count = EPSILONS * float(np.finfo(dtype).eps), len(all_poses.position)
    length = FEW if count <= FEW else BATCH

    def one(part: slice) -> Clearances:
        poses = all_poses.rows(part).lanes(origin, dtype)
        answers = in_batches(lambda batch: tuple(term(batch) for _, _, term in terms), poses, batch_size=length)
        answer = _smallest([(kind, first, x) for (kind, first, _), x in zip(terms, answers, strict=True)])
        far = [np.abs(x) for x in poses.position]
        extents = np.maximum(np.maximum(np.maximum(far[0], far[1]), far[2]), largest)
        # NaN compares as false: such poses stay open.
        return answer._replace(is_open=~(np.abs(answer.clearance - threshold) > bound * extents))

    if not terms:
        return _nothing(count)
    parts = in_threads(one, [slice(count)]) if count <= FEW else in_parts(one, count, device_batch_size(BATCH))
    return Clearances(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _nothing(count: int) -> Clearances:
    far = np.full(count, np.inf)
    return Clearances(far, np.full(count, -1, np.int32), far, far, far, np.zeros(count, bool))


def _smallest(terms: Sequence[tuple[Kind, int, np.ndarray]]) -> Clearances:
    # Take the smallest of the distances from all kernels, in their dtype.
    _, first, distances = terms[0]
    clearance, nearest = distances.real.copy(), distances.imag.astype(np.int32) + np.int32(first)
    for _, first, distances in terms[1:]:
        # A pose with NaN has NaN in the first kernel already, and keeps it, since comparisons with NaN are false.
        is_less = distances.real < clearance
        np.copyto(clearance, distances.real, where=is_less)
        np.copyto(nearest, distances.imag.astype(np.int32) + np.int32(first), where=is_less)

    def smallest(*kinds: Kind) -> np.ndarray:
        values = [distances.real for kind, _, distances in terms if kind in kinds]
        return functools.reduce(np.minimum, values, np.full(len(clearance), np.inf, clearance.dtype)).astype(float)

    kinds = smallest("cables"), smallest("obstacle", "platform-obstacle"), smallest("platform")
    return Clearances(clearance.astype(float), nearest, *kinds, np.zeros(len(clearance), bool))


def _terms(scene: Scene, origin: np.ndarray, dtype: np.dtype):
    """Compiled functions of poses, each with its kind of contact and the index of its first pair."""
    count, first = len(scene.base_points), 0
    points = _cast(
        kernels.Points(*map(as_float64, (scene.base_points - origin, scene.platform_points, scene.diameters))), dtype
    )
    if scene.pairs:
        pairs = np.array(scene.pairs, np.int32)
        yield "cables", first, lambda poses: kernels.of_cables(points, poses, pairs)
        first += len(pairs)
    solids = [_cast(_solid(shape, origin), dtype) for shape in scene.obstacles]
    for solid in solids:
        yield "obstacle", first, lambda poses, solid=solid: kernels.of_obstacle(points, poses, solid)
        first += count
    if scene.body is None:
        return
    body, leave = _cast(_solid(scene.body, np.zeros(3)), dtype), _cast(np.asarray(scene.leave), dtype)
    yield "platform", first, lambda poses: kernels.of_platform(points, poses, body, leave)
    first += count
    of_brick = kernels.of_boxes if isinstance(body, kernels.Brick) else kernels.of_hull_box
    for solid in solids:
        of_both = of_brick if isinstance(solid, kernels.Brick) else kernels.of_body
        yield "platform-obstacle", first, lambda poses, solid=solid, of_both=of_both: of_both(poses, body, solid)
        first += 1


def _cast(tree, dtype: np.dtype):
    return jax.tree.map(lambda x: np.asarray(x, dtype), tree)


def _solid(shape: Obstacle | Hull, origin: np.ndarray):
    if isinstance(shape, Sphere):
        return kernels.Ball(*map(as_float64, (shape.centre - origin, shape.radius)))
    if isinstance(shape, Cylinder):
        return kernels.Rod(*map(as_float64, (shape.start - origin, shape.end - shape.start, shape.radius)))
    if isinstance(shape, Box):
        return kernels.Brick(*map(as_float64, (shape.centre - origin, shape.half, shape.rotation)))
    return kernels.Polyhedron(
        *map(as_float64, (shape.normals, shape.offsets, shape.triangles, shape.edges, shape.sides))
    )


def _corners(shape: Body) -> np.ndarray:
    if isinstance(shape, Hull):
        return shape.triangles.reshape(-1, 3)
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(-1, 3)
    return shape.centre + (signs * shape.half) @ shape.rotation.T


def _largest_coordinate(shape: Obstacle, origin: np.ndarray) -> float:
    # Return the largest coordinate.
    if isinstance(shape, Box):
        return float(np.abs(_corners(shape) - origin).max())
    ends = [shape.centre] if isinstance(shape, Sphere) else [shape.start, shape.end]
    return max(float(np.abs(end - origin).max()) for end in ends) + shape.radius
