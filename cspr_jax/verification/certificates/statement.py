"""Statement of a certificate: robot, limits, bodies and motion, in rational numbers (docs/certificates.md)."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np

from cspr_jax.errors import CsprError
from cspr_jax.motion.formulas import MotionPiece, program
from cspr_jax.motion.limits import limits_set, motor_limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import Bodies, bodies_of, contact_pairs, has_sectors
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot, across_line
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.verification.criteria import bounds_tensions
from cspr_jax.verification.exact.contacts import obstacle_points, sector_vectors

MOST_POINTS = 10_000  # of one body of a pair times those of the other, as the format allows
LONGEST_DECIMAL = 60  # digits of a number that is not written as a fraction
WINCH_NUMBERS = ("drum_radius", "gear_ratio", "motor_inertia", "friction", "viscous_friction", "efficiency")


class NoCertificateError(CsprError):
    """A certificate cannot hold a verdict."""


def texts(array: Any) -> Any:
    """Floating-point numbers of an array as texts of what they are, nested as they are: decimals that end."""
    return _decimals(np.asarray(array, float).tolist())


def _decimals(value: Any) -> Any:
    if isinstance(value, list):
        return [_decimals(each) for each in value]
    text = f"{Decimal(value):f}"
    return text if len(text) <= LONGEST_DECIMAL else str(Fraction(value))


def _text(value: Any) -> Any:
    return [_text(each) for each in value] if isinstance(value, list) else str(value)


def robot_statement(robot: AnyRobot) -> dict[str, Any]:
    """The robot of a certificate."""
    row = PATTERNS[robot.pattern]
    content: dict[str, Any] = {
        "base_points": texts(robot.base_points),
        "mass": texts(robot.mass),
        "gravity": texts(robot.gravity),
        "forces": list(row.forces),
        "moments": list(row.moments),
    }
    if isinstance(robot, PlatformRobot):
        content |= {"platform_points": texts(robot.platform_points), "inertia": texts(robot.inertia)}
        if row.along_line:
            content["line_axes"] = texts(np.asarray(across_line(robot)).T)
        if row.is_jointed and robot.centre_of_mass is not None:
            content["joint_arm"] = texts(robot.centre_of_mass)
    if robot.pulleys is not None:
        content["pulleys"] = {"radius": texts(robot.pulleys.radius), "axes": texts(robot.pulleys.axes)}
    if robot.winches is not None and robot.winches.layers is None:
        winches: Any = robot.winches
        content["winches"] = {name: texts(getattr(winches, name)) for name in WINCH_NUMBERS}
        if winches.stall_torque is not None:
            content["winches"] |= {name: texts(getattr(winches, name)) for name in ("stall_torque", "no_load_speed")}
    return content


def limits_statement(problem: Problem) -> dict[str, Any]:
    """The limits of a certificate."""
    robot, limits = problem.robot, problem.limits
    winches: Any = robot.winches
    motors = motor_limits_set(limits) if winches is not None else ()
    if limits.uncertainty is not None or (robot.winches is not None and limits.motor_torque_rms_max is not None):
        raise NoCertificateError("a certificate holds no uncertainty and no root mean squares of torques")
    if motors and (
        winches.layers is not None or (robot.n_cables > robot.dof and any(bounds_tensions(row) for row in motors))
    ):
        raise NoCertificateError("a certificate holds no layers of drums, and no torques of redundant cables")
    content = {
        "touched": str(TOUCHED),
        "tension_min": texts(np.broadcast_to(tension_range(robot, limits)[0], robot.n_cables)),
    }
    for row in (*limits_set(limits), *motors):
        if row.name != "tension_min":
            values = np.asarray(getattr(limits, row.name), float)
            content[row.name] = texts(np.broadcast_to(values, (robot.n_cables,)) if row.per_cable else values)
    return content


def scene_statement(robot: AnyRobot, scene: Scene) -> dict[str, Any] | None:
    """The bodies of a certificate that must not touch; None: there are no pairs."""
    bodies = bodies_of(robot, scene)
    pairs = [_pair(robot, scene, bodies, *each) for each in contact_pairs(robot, scene)]
    if not pairs:
        return None
    corners = [] if bodies.body is None else texts(bodies.body.corners)
    if any(_count(one, corners) * _count(two, corners) > MOST_POINTS for one, two in pairs):
        raise NoCertificateError(f"a certificate holds at most {MOST_POINTS} points of one body times those of another")
    return {"pairs": pairs} | ({"body": {"corners": corners}} if corners else {})


def _count(entry: dict[str, Any], corners: list) -> int:
    # Number of points of a body of a pair.
    points = corners if "body" in entry else entry.get("points", entry.get("cone"))
    return (1 if "spool" in entry else 2) if points is None else len(points)


def _pair(robot: AnyRobot, scene: Scene, bodies: Bodies, kind: str, cable: int, other: int) -> list[dict[str, Any]]:
    body = {"body": True, "radius": "0"}
    of_cable = {} if cable < 0 else {"cable": int(cable), "radius": texts(bodies.radii[cable])}
    if kind == "cables":
        return [of_cable, {"cable": int(other), "radius": texts(bodies.radii[other])}]
    if kind == "obstacle":
        return [of_cable, _obstacle(bodies, other)]
    if kind == "platform-obstacle":
        return [body, _obstacle(bodies, other)]
    if has_sectors(robot, scene):
        cone = {"cone": _text(sector_vectors(bodies, cable)), "corner": texts(bodies.points[cable])}
        return [cone, {"spool": int(cable), "radius": "0"}]
    return [body, of_cable | {"leave": texts(bodies.leave)}]


def _obstacle(bodies: Bodies, k: int) -> dict[str, Any]:
    points, radius = obstacle_points(bodies, k)
    return {"points": texts(points), "radius": texts(radius)}


def motion_statement(pieces: Sequence[MotionPiece], feeds: Sequence[float] | None = None) -> dict[str, Any]:
    """The motion of a certificate."""
    content = []
    for i, piece in enumerate(pieces):
        position, quaternion = piece.components
        steps, outputs = program([*position, *(quaternion or [])])
        entry: dict[str, Any] = {
            "start": str(piece.start),
            "end": str(piece.end),
            "program": [
                [name, [str(Fraction(c)) for c in operands]] if name == "poly" else [name, *operands]
                for name, operands in steps
            ],
            "position": outputs[:3],
        }
        if quaternion is not None:
            entry["quaternion"] = outputs[3:]
        if feeds is not None and np.isfinite(feeds[i]):
            entry["speed_max"] = texts(feeds[i])
        content.append(entry)
    return {"duration": str(pieces[-1].end), "pieces": content}
