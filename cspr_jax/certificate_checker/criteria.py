"""The criteria of a statement: names, allowances, and functions that must not exceed limits."""

from collections import namedtuple
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from flint import arb, arb_series, fmpq, fmpq_mat

from cspr_jax.certificate_checker.reading import FLAGS, MOTORS, Fields, refuse
from cspr_jax.certificate_checker.series import Undefined, cross, dot, plus, term
from cspr_jax.certificate_checker.state import State

SINGULAR, STANDSTILL = fmpq(1, 10**9), fmpq(1, 10**6)  # smallest normalised determinant; speed of a motor, rad/s
# A slack: the limit, or that of the piece if None, minus the largest of the values, or minus the norm of their vector.
Criterion = namedtuple("Criterion", "limit allowance_squared values norm", defaults=[False])


def margins(criterion: Criterion, state: State, bound: Any) -> list[Any]:
    """Return functions that are all positive where a slack exceeds a bound, and one negative where it is less."""
    limit = state.piece.get("speed_max") if criterion.limit is None else criterion.limit
    if limit is None:
        return []
    rest, values = arb(limit) - bound, criterion.values(state)
    if not criterion.norm:
        return [rest - value for value in values]
    sign = 1 if limit >= 0 else -1  # a norm below the limit, or one above minus the limit
    return [arb_series([rest * sign]), (rest * rest - dot(values, values)) * sign]


def criteria(statement: Fields) -> Iterator[tuple[str, Criterion]]:
    """List the criteria by name; raises NotACertificate where one of them has no meaning for the robot."""
    robot, limits, sizes = statement["robot"], statement["limits"], statement["sizes"]
    square, touched = sizes["n"] == sizes["d"], limits["touched"]
    for name, flag in FLAGS.items():
        for i, limit in enumerate(limits.get(name, []) if square or not name.startswith("tension") else []):
            signed = -limit if name == "tension_min" else limit
            yield f"{flag}:{i}", Criterion(signed, (touched * limit) ** 2, partial(_cable_values, name=name, i=i))
    if not square:
        sides = [(i, -1, -limit) for i, limit in enumerate(limits["tension_min"])]
        sides += [(i, 1, limit) for i, limit in enumerate(limits.get("tension_max", []))]
        allowance_squared = (touched * min(limits["tension_min"])) ** 2
        outside = partial(lambda s, sides: [s.tensions[i] * side - limit for i, side, limit in sides], sides=sides)
        yield "wrench_infeasible", Criterion(0, allowance_squared, outside)
    for name, flag, body, values, norm in PER_EFFECTOR:
        if name in limits and (sizes["body"] or not body):
            size_squared = limits[name] ** 2 if norm else max(dot(point, point) for point in robot["base_points"])
            yield flag, Criterion(limits[name], touched**2 * size_squared, values, norm)
    if square and sizes["body"]:
        points, k = robot["platform_points"], sizes["d"] - len(robot["forces"])
        scale = arb((sum((dot(point, point) for point in points), fmpq(0)) / len(points)) ** k).sqrt()
        refuse(not scale > 0, "robot.platform_points: all zero")
        yield "singular", Criterion(-SINGULAR, 0, lambda s: [s.determinant / scale], norm=True)
    axes = robot["forces"], robot["moments"]
    if square and "line_axes" not in robot and axes in (([0, 1, 2], []), ([0, 1, 2], [0, 1, 2]), ([0, 2], [])):
        points = robot["base_points"] if axes[0] == [0, 1, 2] else [[1, 0, 0], [0, 1, 0]]
        rows = fmpq_mat([[x, y, 1][: 3 if len(points) == 3 else 2] for x, y, _ in points])  # for three with an offset
        squares = rows.transpose() * rows
        refuse(not squares.det(), "robot.base_points: their plane is vertical, or they lie on a line")
        p, q, *_ = squares.solve(rows.transpose() * fmpq_mat([[z] for _, _, z in points])).entries()
        yield "above_spools", Criterion(0, 0, lambda s: [dot([p, q, -1], s.position)])
    for k, pair in enumerate(statement["pairs"]):
        yield f"contact:{k}", Criterion(0, 0, partial(_contact, pair=pair, k=k))
    speeds = [piece["speed_max"] for piece in statement["pieces"] if "speed_max" in piece]
    if speeds:
        yield "over_feed", Criterion(None, (touched * min(speeds)) ** 2, lambda s: s.velocity, norm=True)


def _cable_values(state: State, name: str, i: int) -> list[Any]:
    """Return values of which the largest must not exceed a limit of a cable; raises Undefined at instants of doubt."""
    if name.startswith("tension"):
        return [state.tensions[i] * (-1 if name == "tension_min" else 1)]
    length = state.cables[i].length
    rate = length.derivative()
    if name == "cable_length_max":
        return [length]
    if name not in MOTORS:
        values = [rate if name == "cable_speed_max" else rate.derivative()]
    else:
        drive = {key: entry[i] for key, entry in state.robot["winches"].items()}
        speed = rate * (-drive["gear_ratio"] / drive["drum_radius"])
        torques = _torques(state, i, drive, speed) if name != "motor_speed_max" else []
        if name == "motor_load_max":
            stall, fastest = drive["stall_torque"], drive["no_load_speed"]
            values = [torque / stall + speed * (p / fastest) for torque in torques for p in (1, -1)]
        else:
            values = torques if name == "motor_torque_max" else [torque * speed for torque in torques] or [speed]
    return [*values, *(-value for value in values)]


def _torques(state: State, i: int, drive: Fields, speed: Any) -> list[Any]:
    """Return the torque of a motor with either friction that may count, the same for a state and its middle, N m."""
    if i not in state.frictions:
        balls = {p: term(speed) * p + STANDSTILL for p in (1, -1)}
        if not state.radius and not all(ball.abs_lower() > 0 for ball in balls.values()):
            raise Undefined("a case is not decided")
        state.frictions[i] = [p for p, ball in balls.items() if not ball < 0]
    turning = speed.derivative() * drive["motor_inertia"] + speed * drive["viscous_friction"]
    levers = {p: drive["drum_radius"] / (drive["gear_ratio"] * drive["efficiency"] ** p) for p in state.frictions[i]}
    return [state.tensions[i] * lever + turning + drive["friction"] * p for p, lever in levers.items()]


PER_EFFECTOR: list[tuple[str, str, bool, Callable[[State], list[Any]], bool]] = [  # of a body, values, a norm of them
    ("floor", "below_floor", False, lambda s: [s.position[2]], False),
    ("floor", "lowest_below_floor", True, lambda s: [point[2] for point in s.attachments + s.corners], False),
    ("speed_max", "too_fast", False, lambda s: s.velocity, True),
    ("acceleration_max", "over_acceleration", False, lambda s: s.acceleration, True),
]


def hull(state: State, body: Fields) -> list[list[Any]]:
    """Return the points whose convex hull a body is, in the order of the page, m; of a cone the corner and the rays."""
    if body["kind"] in ("points", "body"):
        return [[arb_series([entry]) for entry in point] for point in body.get("points", [])] or state.corners
    if body["kind"] == "cone":
        return [plus(state.position, state.turn(body["corner"])), *map(state.turn, body["cone"])]
    cable, end = state.cables[body[body["kind"]]], state.attachments[body[body["kind"]]]
    if "leave" in body:
        if not term(cable.free) > body["leave"]:
            raise Undefined("nothing is left of a cable")
        end = plus(end, cable.unit, body["leave"])
    points = [cable.leaving] if body["kind"] == "spool" else [cable.leaving, end]
    return [[x, y * (0 if body["flat"] else 1), z] for x, y, z in points]


def crossing(state: State, pair: list[Fields], rays: tuple[int, int]) -> list[Any]:
    """Return what is zero where two segments, or two rays and a spool, may touch, and what is negative if they do."""
    (p, *first), (q, *second) = sorted((hull(state, body) for body in pair), key=len, reverse=True)
    r = plus(q, p, -1)
    a, b = (plus(first[0], p, -1), plus(q, second[0], -1)) if second else (first[k] for k in rays)
    normal = cross(a, b)
    coordinates = [dot(cross(r, b), normal), dot(cross(a, r), normal)]  # r = s a + t b + ..., s and t times N . N
    beyond = [coordinate - dot(normal, normal) for coordinate in coordinates if second]
    return [dot(r, normal), *(-coordinate for coordinate in coordinates), *beyond]


def _contact(state: State, pair: list[Fields], k: int) -> list[Any]:
    """Return minus how much each point of the second body is beyond each of the first, radii counted, m."""
    axis = state.block["directions"][k]
    sides = [dot(axis, ray) * side for body, side in zip(pair, (-1, 1), strict=True) for ray in body.get("cone", [])]
    if any(side < 0 for side in sides):
        raise Undefined("a cone crosses the plane between the bodies")
    unit = [entry / arb(dot(axis, axis)).sqrt() for entry in axis]
    if any(body["turns"] for body in pair):
        unit = state.turn(unit)
    points = (hull(state, body)[: 1 if "cone" in body else None] for body in pair)
    first, second = ([dot(unit, point) for point in hull] for hull in points)
    return [pair[0]["radius"] + pair[1]["radius"] + before - beyond for beyond in second for before in first]
