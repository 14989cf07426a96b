"""Planes in the space of coordinates that keep bodies apart where a motion brings them too near.

The clearance of two bodies is linearised about the motion at each instant at which it is small; searched again within
these planes, the motion gives new ones. Clearances of solid bodies are negative inside. Cables without thickness, and
cables over a platform's face, have a side on which they are, that of the poses: the sign of the distance of their
lines, or of the height of the spool over the face.
"""

import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from cspr_jax.families.free.poses import quaternions_of
from cspr_jax.families.free.problem import FreeQuestion, more
from cspr_jax.families.free.search.instants import coordinates
from cspr_jax.families.free.search.interior_point import BARRIERS, Ending, OutOfTime, again, optima, started
from cspr_jax.families.free.search.starts import BENT, bulge, ways
from cspr_jax.families.free.search.tasks import OUTER, ClearancePlanes, Tasks, Unknowns
from cspr_jax.robots.contacts.clearance import ContactPair, Scene, clearances
from cspr_jax.robots.contacts.contact_bodies import bodies_of, contact_pairs, default_scene
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.verification.criteria import has_extent
from cspr_jax.verification.piece_slacks import PieceSlacks

# Over the size of the robot: clearance up to which bodies are kept apart, clearance that they keep, at least, and by
# how much more at most each time; step of difference quotients.
NEAR, APART, MOST, STEP = 0.1, 1e-4, 0.02, 1e-6
# By how much more than lines motions are bent round what is in their way, those of platforms, whose searches take long,
# once; how much slower they begin, the softness with which searches from them begin, and weight of barriers and
# softness with which they go on; how many each has.
WIDER, SLOWER, SOFTNESS, GO_ON, SEARCHES = (1.0, 2.0), 1.5, 10.0, (1e-3, 1e-1), 4


class _Gap(NamedTuple):
    # Clearance of two bodies in poses: a function of positions (k, 3) and quaternions (k, 4) or None, (k,) m, and
    # whether the bodies are near each other there; whether its sign is a side; what it must exceed, m.
    of_poses: Callable[[np.ndarray, np.ndarray | None], tuple[np.ndarray, np.ndarray]]
    has_sides: bool
    need: float


def apart(
    question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, slacks: PieceSlacks, number: int
) -> tuple[Tasks, Unknowns] | None:
    """Bounds that keep bodies apart where a motion brings them too near."""
    missed = -_clearances(question, slacks).min(0, initial=np.inf)
    if not (missed > 0.0).any():
        return None
    size = float(spool_radius(tasks.robot))
    minimum = {} if tasks.planes is None else dict(tasks.planes.least)
    for k in np.flatnonzero(missed > 0.0).tolist():
        minimum[k] = minimum.get(k, APART * size) + min(more(number) * float(missed[k]), MOST * size)
    return _parted(question, tasks, unknowns, minimum, NEAR * size)


def around(
    question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, slacks: PieceSlacks
) -> tuple[Tasks, Unknowns] | None:
    """The best motion of those that lead round the obstacles in the way of one, bent to all sides."""
    is_met, size = _clearances(question, slacks) < 0.0, float(spool_radius(tasks.robot))
    _, pairs = _bodies(question)
    if not any("obstacle" in pairs[k].kind for k in np.flatnonzero(is_met.any(axis=0))):
        return None
    segments = np.any(is_met.reshape(len(tasks.places[0]), -1), axis=1)
    minimum = dict.fromkeys(np.flatnonzero(is_met.any(axis=0)).tolist(), APART * size)
    deviation = Unknowns(*map(np.concatenate, zip(*_bent(tasks, unknowns, segments), strict=True)))
    return _clear(question, tasks.taken(np.zeros(len(deviation.duration), int)), deviation, minimum)


def _clear(
    question: FreeQuestion, tasks: Tasks, deviation: Unknowns, least: dict[int, float]
) -> tuple[Tasks, Unknowns] | None:
    # The best of the motions on the sides of bent ones, if one is clear at all instants: planes about one after the
    # other.
    within, begun = _parted(question, tasks, deviation, least, np.inf)
    begun = started(within, within.controls(begun), begun.duration)
    level, until = (BARRIERS[0], SOFTNESS), question.settings.until
    best, cost = None, np.inf
    for _ in range(SEARCHES):
        result = optima(within, begun, *level, Ending(until), keeps=True)
        if result.is_stopped and time.monotonic() <= until:
            raise KeyboardInterrupt
        is_kept = result.is_optimal & within.objective.keeps_limits(result.unknowns.level)
        within, unknowns = within.taken(is_kept), result.unknowns.taken(is_kept)
        if not is_kept.any():
            break
        further, begun = _parted(question, within, unknowns, least, np.inf)
        is_clear = np.all(begun.values[..., further.n_limited :] > 0.0, axis=(1, 2, 3, 4))
        costs = np.where(is_clear, within.cost(unknowns), np.inf)
        if costs.min() < cost:
            rows, cost = np.array([costs.argmin()]), costs.min()
            best = within.taken(rows), unknowns.taken(rows)
        if result.is_stopped or is_clear.all():
            break
        within, level = further.taken(~is_clear), GO_ON
        begun = again(within, begun.taken(~is_clear), level[0])
    if best is None and result.is_stopped:
        raise OutOfTime
    return best


def _clearances(question: FreeQuestion, slacks: PieceSlacks) -> np.ndarray:
    # Lower bounds (n_pieces, n_meetings), m.
    scene, pairs = _bodies(question)
    last = len(slacks.rows) - int(
        question.problem.limits.floor is not None and has_extent(question.problem.robot, scene)
    )
    return slacks.low[:, last - len(pairs) : last]


def _bodies(question: FreeQuestion) -> tuple[Scene, tuple[ContactPair, ...]]:
    # The robot among what it can meet, and which of these can meet.
    robot = question.problem.robot
    scene = question.scene or default_scene(robot)
    return scene, contact_pairs(robot, scene)


def _bent(tasks: Tasks, unknowns: Unknowns, segments: np.ndarray) -> Iterator[Unknowns]:
    # Motions that are bent along some of their segments (s,).
    (along, about), chords = coordinates(tasks.robot.pattern), tasks.places[0, :, 1] - tasks.places[0, :, 0]
    lengths = np.maximum(np.linalg.norm(chords[:, : len(along)], axis=1), NEAR * float(spool_radius(tasks.robot)))
    second_derivative = (
        BENT * (tasks.basis.fit @ bulge(tasks.basis.averages))[:, None] * (lengths * segments)[:, None, None]
    )
    for wider in WIDER[:1] if len(about) else WIDER:
        for directions in list(zip(*(ways(chord, along) for chord in chords), strict=True))[1:]:
            inner = unknowns.inner + wider * (second_derivative * np.array(directions)[:, None])[None, :, OUTER:-OUTER]
            yield unknowns._replace(inner=inner, duration=SLOWER * unknowns.duration)


def _parted(
    question: FreeQuestion, tasks: Tasks, unknowns: Unknowns, least: dict[int, float], near: float
) -> tuple[Tasks, Unknowns]:
    # Planes about a motion where clearances are below `near`, m, by the clearances that meetings keep, m.
    (scene, pairs), size = _bodies(question), float(spool_radius(tasks.robot))
    places = tasks.basis.places(tasks.controls(unknowns))[..., 0, :]
    linear = [_linear(tasks, places, _gap(question, scene, pairs[k])) for k in least]
    values, slopes = np.stack([one[0] for one in linear], axis=-1), np.stack([one[1] for one in linear], axis=-2)
    is_near = values < near
    slopes, values = np.where(is_near[..., None], slopes, 0.0) / size, np.where(is_near, values, 0.0) / size
    planes = ClearancePlanes(slopes, values - np.sum(slopes * places[..., None, :], axis=-1), tuple(least.items()))
    low = np.where(is_near, np.array(list(least.values())) / size, -np.inf)
    return tasks.within(planes, low), tasks.beside(unknowns, values)


def _linear(tasks: Tasks, places: np.ndarray, gap: _Gap) -> tuple[np.ndarray, np.ndarray]:
    # Clearances (l, s, m, n), m, and their slopes (l, s, m, n, d), by the coordinates; NaN where they say nothing.
    def values(where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        quaternions = quaternions_of(tasks, where)
        flat = where.reshape(-1, where.shape[-1])
        positions = np.zeros((len(flat), 3))
        along = np.array(PATTERNS[tasks.robot.pattern].forces, int)
        positions[:, along] = flat[:, : len(along)]
        rotated = None if quaternions is None else quaternions.reshape(-1, 4)
        value, is_near = gap.of_poses(positions, rotated)
        return value.reshape(where.shape[:-1]), is_near.reshape(where.shape[:-1])

    (middle, is_near), steps = values(places), STEP * np.eye(places.shape[-1])
    slopes = [(values(places + step)[0] - values(places - step)[0]) / (2.0 * STEP) for step in steps]
    side = np.ones((*places.shape[:2], 1, 1))
    if gap.has_sides:
        ends = np.sign(values(tasks.places)[0])
        is_kept = (ends[..., 0] == ends[..., 1]) & (ends[..., 0] != 0.0)
        side = np.where(is_kept, ends[..., 0], np.nan)[..., None, None]
    return np.where(is_near, side * middle - gap.need, np.nan), side[..., None] * np.stack(slopes, axis=-1)


def _gap(question: FreeQuestion, scene: Scene, meeting: ContactPair) -> _Gap:
    kind, k, other = meeting
    if kind == "cables":
        return _Gap(_between_lines(scene, k, other), True, 0.5 * float(scene.diameters[[k, other]].sum()))
    if kind == "platform" and scene.body is None:
        return _Gap(_over_face(question, scene, k), True, 0.0)
    # A scene in which nothing else can meet.
    rows = [max(k, 0)]
    alone = dataclasses.replace(
        scene,
        base_points=scene.base_points[rows],
        platform_points=scene.platform_points[rows],
        diameters=scene.diameters[rows],
        pairs=(),
        obstacles=() if kind == "platform" else (scene.obstacles[other],),
        body=None if kind == "obstacle" else scene.body,
    )
    field = "platform" if kind == "platform" else "obstacles"
    return _Gap(lambda p, q: (getattr(clearances(alone, p, q), field), np.ones(len(p), bool)), False, 0.0)


def _rays(scene: Scene, k: int, positions: np.ndarray, turns: np.ndarray) -> np.ndarray:
    # From the spool to the platform, (n, 3).
    return positions + turns @ scene.platform_points[k] - scene.base_points[k]


def _turns(positions: np.ndarray, quaternions: np.ndarray | None) -> np.ndarray:
    if quaternions is None:
        return np.broadcast_to(np.eye(3), (len(positions), 3, 3))
    from scipy.spatial.transform import Rotation  # takes time, and few motions need it

    return Rotation.from_quat(quaternions, scalar_first=True).as_matrix()


def _between_lines(scene: Scene, k: int, other: int) -> Callable:
    # Distance of the lines of two cables, with the sign of the volume, where they are nearest inside of both.
    start = scene.base_points[other] - scene.base_points[k]

    def distance(positions: np.ndarray, quaternions: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        turns = _turns(positions, quaternions)
        u, v = (_rays(scene, i, positions, turns) for i in (k, other))
        normal = np.cross(u, v)
        square = np.sum(normal**2, axis=1)
        shares = [np.sum(np.cross(start, ray) * normal, axis=1) for ray in (v, u)]
        is_inside = (square > 0.0) & np.all([(fraction > 0.0) & (fraction < square) for fraction in shares], axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return normal @ start / np.sqrt(square), is_inside

    return distance


def _over_face(question: FreeQuestion, scene: Scene, k: int) -> Callable:
    # Height of a spool over the platform's face, where the cable is over the sector of its corner.
    sides, normal = (np.asarray(part) for part in bodies_of(question.problem.robot, scene).sectors)
    across = np.cross(normal, sides[k, 1]), -np.cross(normal, sides[k, 0])

    def height(positions: np.ndarray, quaternions: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        turns = _turns(positions, quaternions)
        seen = -(turns.transpose(0, 2, 1) @ _rays(scene, k, positions, turns)[..., None])[..., 0]
        is_over = np.all([seen @ one > 0.0 for one in across], axis=0) | (sides[k] == 0.0).all()
        return seen @ normal, is_over

    return height
