"""Planes in coordinate space that separate bodies where a motion brings them too near to each other.

The clearance of two bodies is linearised about the motion at each sample at which it is small. A search within these
planes gives a new motion, which gives new planes. Clearances of solid bodies are negative inside. For two cables, and
for a cable over a platform's face, clearances have a sign instead, which must stay that of the poses: the sign of the
volume that the lines of the cables span, or of the height of the spool over the face.
"""

import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from cspr_jax.families.free.poses import quaternions_of
from cspr_jax.families.free.problem import FreeQuestion, more
from cspr_jax.families.free.search.equations import coordinates
from cspr_jax.families.free.search.interior_point import BARRIERS, Ending, OutOfTime, again, optima, started
from cspr_jax.families.free.search.starts import DEFLECTION, deflection_profile, deflections
from cspr_jax.families.free.search.tasks import OUTER, ClearancePlanes, Tasks, Unknowns
from cspr_jax.robots.contacts.clearance import ContactPair, Scene, clearances
from cspr_jax.robots.contacts.contact_bodies import bodies_of, contact_pairs, default_scene
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.verification.criteria import has_extent
from cspr_jax.verification.piece_slacks import PieceSlacks

# Clearances below are relative to the robot's radius.
NEAR = 0.1  # clearance below which bodies are separated by planes
MIN_CLEARANCE, MAX_INCREASE = 1e-4, 0.02  # smallest clearance that planes keep, and its largest increase per search
STEP = 1e-6  # step of the coordinates in difference quotients
# Searches round obstacles start from motions deflected by these multiples of the deflection of lines; searches for
# platforms take long, and use the first multiple alone.
WIDER = (1.0, 2.0)
SLOWER = 1.5  # durations of these starts over those of the motion that meets an obstacle
SOFTNESS = 10.0  # softness of the first search
GO_ON = (1e-3, 1e-1)  # weight of the barriers, and softness, of further searches
SEARCHES = 4  # largest number of searches from each start; those from all starts run together


class _Gap(NamedTuple):
    # Clearance of two bodies. `of_poses` maps positions (k, 3) and quaternions (k, 4) or None to clearances (k,), m,
    # and to whether the bodies are near; `has_sides` tells whether the sign must stay; `need` is the least clearance.
    of_poses: Callable[[np.ndarray, np.ndarray | None], tuple[np.ndarray, np.ndarray]]
    has_sides: bool
    need: float


def separated(
    question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, slacks: PieceSlacks, number: int
) -> tuple[Tasks, Unknowns] | None:
    """Tasks with bounds that separate bodies which a motion brings too near, and unknowns; None if it brings none."""
    missed = -_clearances(question, slacks).min(0, initial=np.inf)
    if not (missed > 0.0).any():
        return None
    radius = float(spool_radius(tasks.robot))
    minimum = {} if tasks.planes is None else dict(tasks.planes.minimum)
    for k in np.flatnonzero(missed > 0.0).tolist():
        minimum[k] = minimum.get(k, MIN_CLEARANCE * radius) + min(
            more(number) * float(missed[k]), MAX_INCREASE * radius
        )
    return _parted(question, tasks, unknowns, minimum, NEAR * radius)


def around(
    question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, slacks: PieceSlacks
) -> tuple[Tasks, Unknowns] | None:
    """The best of motions round the obstacles that a motion meets; searches start from deflections to all sides."""
    is_met, radius = _clearances(question, slacks) < 0.0, float(spool_radius(tasks.robot))
    _, pairs = _bodies(question)
    if not any("obstacle" in pairs[k].kind for k in np.flatnonzero(is_met.any(axis=0))):
        return None
    segments = np.any(is_met.reshape(len(tasks.ends[0]), -1), axis=1)
    minimum = dict.fromkeys(np.flatnonzero(is_met.any(axis=0)).tolist(), MIN_CLEARANCE * radius)
    deviation = Unknowns(*map(np.concatenate, zip(*_deflected(tasks, unknowns, segments), strict=True)))
    return _clear(question, tasks.take(np.zeros(len(deviation.duration), int)), deviation, minimum)


def _clear(
    question: FreeQuestion, tasks: Tasks, deviation: Unknowns, minimum: dict[int, float]
) -> tuple[Tasks, Unknowns] | None:
    # Search from deflected motions, first with planes about them, then with planes about what was found; return the
    # best motion that is clear of obstacles at all samples.
    within, begun = _parted(question, tasks, deviation, minimum, np.inf)
    begun = started(within, within.controls(begun), begun.duration)
    level, until = (BARRIERS[0], SOFTNESS), question.settings.until
    best, cost = None, np.inf
    for _ in range(SEARCHES):
        result = optima(within, begun, *level, Ending(until), keeps=True)
        if result.is_stopped and time.monotonic() <= until:
            raise KeyboardInterrupt
        is_kept = result.is_optimal & within.objective.keeps_limits(result.unknowns.level)
        within, unknowns = within.take(is_kept), result.unknowns.take(is_kept)
        if not is_kept.any():
            break
        further, begun = _parted(question, within, unknowns, minimum, np.inf)
        is_clear = np.all(begun.values[..., further.n_limited :] > 0.0, axis=(1, 2, 3, 4))
        costs = np.where(is_clear, within.cost(unknowns), np.inf)
        if costs.min() < cost:
            cheapest, cost = np.array([costs.argmin()]), costs.min()
            best = within.take(cheapest), unknowns.take(cheapest)
        if result.is_stopped or is_clear.all():
            break
        within, level = further.take(~is_clear), GO_ON
        begun = again(within, begun.take(~is_clear), level[0])
    if best is None and result.is_stopped:
        raise OutOfTime
    return best


def _clearances(question: FreeQuestion, slacks: PieceSlacks) -> np.ndarray:
    # Return lower bounds of clearances, (n_pieces, n_pairs), m.
    scene, pairs = _bodies(question)
    last = len(slacks.rows) - int(
        question.problem.limits.floor is not None and has_extent(question.problem.robot, scene)
    )
    return slacks.low[:, last - len(pairs) : last]


def _bodies(question: FreeQuestion) -> tuple[Scene, tuple[ContactPair, ...]]:
    # Return the robot among the bodies that it can touch, and the pairs of bodies that can touch.
    robot = question.problem.robot
    scene = question.scene or default_scene(robot)
    return scene, contact_pairs(robot, scene)


def _deflected(tasks: Tasks, unknowns: Unknowns, segments: np.ndarray) -> Iterator[Unknowns]:
    # Return motions that are deflected along some of their segments (s,).
    (along, about), chords = coordinates(tasks.robot.pattern), tasks.ends[0, :, 1] - tasks.ends[0, :, 0]
    lengths = np.maximum(np.linalg.norm(chords[:, : len(along)], axis=1), NEAR * float(spool_radius(tasks.robot)))
    second_derivative = (
        DEFLECTION
        * (tasks.basis.fit @ deflection_profile(tasks.basis.averages))[:, None]
        * (lengths * segments)[:, None, None]
    )
    for wider in WIDER[:1] if len(about) else WIDER:
        for directions in list(zip(*(deflections(chord, along) for chord in chords), strict=True))[1:]:
            inner = unknowns.inner + wider * (second_derivative * np.array(directions)[:, None])[None, :, OUTER:-OUTER]
            yield unknowns._replace(inner=inner, duration=SLOWER * unknowns.duration)


def _parted(
    question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, minimum: dict[int, float], near: float
) -> tuple[Tasks, Unknowns]:
    # Return planes about a motion where clearances are below `near`, m, so that pairs of bodies keep given clearances.
    (scene, pairs), radius = _bodies(question), float(spool_radius(tasks.robot))
    samples = tasks.basis.evaluate(tasks.controls(unknowns))[..., 0, :]
    linear = [_linear(tasks, samples, _gap(question, scene, pairs[k])) for k in minimum]
    values, gradients = np.stack([one[0] for one in linear], axis=-1), np.stack([one[1] for one in linear], axis=-2)
    is_near = values < near
    gradients, values = np.where(is_near[..., None], gradients, 0.0) / radius, np.where(is_near, values, 0.0) / radius
    planes = ClearancePlanes(
        gradients, values - np.sum(gradients * samples[..., None, :], axis=-1), tuple(minimum.items())
    )
    low = np.where(is_near, np.array(list(minimum.values())) / radius, -np.inf)
    return tasks.within(planes, low), tasks.beside(unknowns, values)


def _linear(tasks: Tasks, samples: np.ndarray, gap: _Gap) -> tuple[np.ndarray, np.ndarray]:
    # Return clearances (l, s, m, n), m, and their gradients (l, s, m, n, d) by the coordinates. Clearances are NaN for
    # bodies apart, and where the poses at both ends do not have the same sign.
    def values(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        quaternions = quaternions_of(tasks, points)
        flat = points.reshape(-1, points.shape[-1])
        positions = np.zeros((len(flat), 3))
        along = np.array(PATTERNS[tasks.robot.pattern].forces, int)
        positions[:, along] = flat[:, : len(along)]
        rotated = None if quaternions is None else quaternions.reshape(-1, 4)
        value, is_near = gap.of_poses(positions, rotated)
        return value.reshape(points.shape[:-1]), is_near.reshape(points.shape[:-1])

    (middle, is_near), steps = values(samples), STEP * np.eye(samples.shape[-1])
    gradients = [(values(samples + step)[0] - values(samples - step)[0]) / (2.0 * STEP) for step in steps]
    side = np.ones((*samples.shape[:2], 1, 1))
    if gap.has_sides:
        ends = np.sign(values(tasks.ends)[0])
        is_kept = (ends[..., 0] == ends[..., 1]) & (ends[..., 0] != 0.0)
        side = np.where(is_kept, ends[..., 0], np.nan)[..., None, None]
    return np.where(is_near, side * middle - gap.need, np.nan), side[..., None] * np.stack(gradients, axis=-1)


def _gap(question: FreeQuestion, scene: Scene, pair: ContactPair) -> _Gap:
    kind, k, other = pair
    if kind == "cables":
        return _Gap(_between_lines(scene, k, other), True, 0.5 * float(scene.diameters[[k, other]].sum()))
    if kind == "platform" and scene.body is None:
        return _Gap(_over_face(question, scene, k), True, 0.0)
    # Make a scene in which only this pair can touch.
    cable = [max(k, 0)]
    alone = dataclasses.replace(
        scene,
        base_points=scene.base_points[cable],
        platform_points=scene.platform_points[cable],
        diameters=scene.diameters[cable],
        pairs=(),
        obstacles=() if kind == "platform" else (scene.obstacles[other],),
        body=None if kind == "obstacle" else scene.body,
    )
    field = "platform" if kind == "platform" else "obstacles"
    return _Gap(lambda p, q: (getattr(clearances(alone, p, q), field), np.ones(len(p), bool)), False, 0.0)


def _rays(scene: Scene, k: int, positions: np.ndarray, turns: np.ndarray) -> np.ndarray:
    # Return vectors from the spool to the attachment point on the platform, (n, 3).
    return positions + turns @ scene.platform_points[k] - scene.base_points[k]


def _turns(positions: np.ndarray, quaternions: np.ndarray | None) -> np.ndarray:
    if quaternions is None:
        return np.broadcast_to(np.eye(3), (len(positions), 3, 3))
    from scipy.spatial.transform import Rotation  # slow to import, and few motions need it

    return Rotation.from_quat(quaternions, scalar_first=True).as_matrix()


def _between_lines(scene: Scene, k: int, other: int) -> Callable:
    # Return the distance of the lines of two cables, signed by the volume, where they are nearest inside both cables.
    start = scene.base_points[other] - scene.base_points[k]

    def distance(positions: np.ndarray, quaternions: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        turns = _turns(positions, quaternions)
        u, v = (_rays(scene, i, positions, turns) for i in (k, other))
        normal = np.cross(u, v)
        square = np.sum(normal**2, axis=1)
        fractions = [np.sum(np.cross(start, ray) * normal, axis=1) for ray in (v, u)]
        is_inside = (square > 0.0) & np.all([(fraction > 0.0) & (fraction < square) for fraction in fractions], axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return normal @ start / np.sqrt(square), is_inside

    return distance


def _over_face(question: FreeQuestion, scene: Scene, k: int) -> Callable:
    # Return the height of a spool over the platform's face, if the cable is over the sector of its corner.
    sides, normal = (np.asarray(part) for part in bodies_of(question.problem.robot, scene).sectors)
    across = np.cross(normal, sides[k, 1]), -np.cross(normal, sides[k, 0])

    def height(positions: np.ndarray, quaternions: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        turns = _turns(positions, quaternions)
        seen = -(turns.transpose(0, 2, 1) @ _rays(scene, k, positions, turns)[..., None])[..., 0]
        is_over = np.all([seen @ one > 0.0 for one in across], axis=0) | (sides[k] == 0.0).all()
        return seen @ normal, is_over

    return height
