"""A plan for MuJoCo as files: a model of its robot (MJCF), and the tensions that play the plan in it, open-loop.

These files are written without MuJoCo. The control file has the rows of `outputs.mujoco.motion.Played`: two for each
step, and one more with the time of the row before where the acceleration jumps.
"""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jax
import numpy as np
from scipy.spatial.transform import Rotation

from cspr_jax import __version__
from cspr_jax.errors import ConfigError, printable
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.mujoco.motion import STEP, Played, Suspended, attachments, coordinates, played, suspended
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots.elasticity.springs import unstretched_lengths
from cspr_jax.robots.model.pulleys import exits
from cspr_jax.robots.model.shapes import Body, Box, Cylinder, Hull, Obstacle, Sphere
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish

_EXITS = jax.jit(jax.vmap(exits, in_axes=(None, None, None, 0)))
KEYFRAME = "start"
# Sizes of what is drawn, over the diagonal of the box around spools and path.
MASS_RADIUS = 0.012
SPOOL_RADIUS = 0.006
POINT_RADIUS = 0.004
CABLE_RADIUS = 0.002
ROD_RADIUS = 0.003
THINNEST = 1e-4  # cables of a known diameter are drawn thicker than this
# Numbers for pulleys:
LEAD = 0.5  # length of cable below the entry point, over the radius
WHEEL_WIDTH = 0.15  # half width of the wheel, over the radius
SWIVEL_INERTIA = 1e-9  # over mass and squared extent of the robot: the smallest with which MuJoCo works well
FOLLOWING = 0.1  # distance of the points that keep a pulley in the plane of its cable, over the extent of the robot
SMALLEST_GAP = 0.01  # rad, between start and end of a tendon around a pulley
LYING = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)  # quaternion of the rotation from z to -y
CLEAR = (0.0, 0.0, 0.0, 0.0)
DARK = (0.2, 0.2, 0.2, 1.0)
BLUE = (0.1, 0.3, 0.6, 1.0)
ORANGE = (0.85, 0.45, 0.1, 1.0)
BROWN = (0.36, 0.24, 0.18, 0.6)
GLASS = (0.85, 0.45, 0.1, 0.35)
HULL = "platform_hull"
SPRINGS = "the control file has unstretched lengths, m, for tendon_lengthspring, and EA / length is tendon_stiffness"
LED = " (on pulleys springlength also has what lies before them, half a radius)"


def model_xml(
    body: Suspended, moved: Played, step: float = STEP, control_file: str = "", note: str = "", *, elastic: bool = False
) -> str:
    """A model of a robot for MuJoCo; elastic cables are springs, whose unstretched lengths are those of the start."""
    root = ElementTree.Element("mujoco", model=printable(body.name))
    rotated = "" if body.z_axis == "up" else ", turned by half a turn about x: (x, -y, -z) of the robot file"
    words = f"World axes are those of the robot file{rotated}; z is up. A control is the tension of a cable, N"
    words += f", beside that of its spring: {SPRINGS}{LED * bool(len(body.wheels))}." if elastic else "."
    root.append(ElementTree.Comment(f" Written by cspr_jax {__version__}. SI units. {words}{note} "))
    _add(root, "compiler", angle="radian", inertiafromgeom="false")
    # Make the Jacobian of the tendons dense, with a row for each cable. Constraints make pulleys follow their cables.
    gravity = [0.0, 0.0, -body.gravity]
    solver = {"tolerance": 1e-14} if len(body.wheels) else {}
    _add(root, "option", timestep=step, gravity=gravity, integrator="RK4", jacobian="dense", **solver)
    if control_file:
        _add(_add(root, "custom"), "text", name="control_file", data=control_file)
    points = np.vstack([body.spools, moved.position])
    low, high = points.min(0), points.max(0)
    extent = float(np.linalg.norm(high - low))
    _add(root, "statistic", center=0.5 * (low + high), extent=extent)
    _add(_add(root, "visual"), "headlight", ambient=[0.4] * 3, diffuse=[0.5] * 3, specular=[0.1] * 3)
    sky = {"type": "skybox", "builtin": "gradient", "width": "64", "height": "64"}
    _add(assets := _add(root, "asset"), "texture", **sky, rgb1=[1.0] * 3, rgb2=[0.8, 0.85, 0.9])
    if isinstance(body.body, Hull):
        _add(assets, "mesh", name=HULL, vertex=np.unique(body.body.triangles.reshape(-1, 3), axis=0))
    _world(_add(root, "worldbody"), body, moved, extent)
    tendons = _add(root, "tendon")
    _cables(tendons, body, extent, _springs(body, moved) if elastic else None)
    if len(body.wheels):
        _followers(tendons, _add(root, "equality"), body, step)
    _motors(_add(root, "actuator"), body, moved)
    qpos, qvel, _ = (rows[0] for rows in coordinates(body, moved))
    _add(_add(root, "keyframe"), "key", name=KEYFRAME, qpos=qpos, qvel=qvel, ctrl=moved.tension[0] * (not elastic))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _add(parent: ElementTree.Element, tag: str, **attributes) -> ElementTree.Element:
    # Words are written unchanged, numbers with all their digits but without -0.
    text = {
        name: value if isinstance(value, str) else " ".join(repr(float(x) + 0.0) for x in np.ravel(value))
        for name, value in attributes.items()
    }
    return ElementTree.SubElement(parent, tag, text)


def _world(world: ElementTree.Element, body: Suspended, moved: Played, extent: float) -> None:
    spools = body.spools.copy()
    if body.pulleys is not None:
        spools -= LEAD * (np.asarray(body.pulleys.radius)[:, None] * np.asarray(body.pulleys.axes))
    for k, spool in enumerate(spools, 1):
        _add(world, "site", name=f"spool_{k}", pos=spool, size=SPOOL_RADIUS * extent, rgba=DARK)
    drawn = {"contype": "0", "conaffinity": "0"}
    for number, obstacle in enumerate(body.obstacles, 1):
        _add(world, "geom", name=f"obstacle_{number}", rgba=BROWN, **drawn, **_geom(obstacle))
    start = moved.position[0]
    if body.axes:
        effector = _add(world, "body", name="effector", pos=start)
        for axis in body.axes:  # coordinates are positions, not displacements from the start
            _add(effector, "joint", name="xyz"[axis], type="slide", axis=np.eye(3)[axis], ref=start[axis])
    else:
        effector = _add(world, "body", name="effector", pos=start, quat=moved.coordinates(())[0][0, 3:7])
        _add(effector, "freejoint", name="pose")
    radius = MASS_RADIUS * extent
    # An effector that does not turn may have any inertia, but MuJoCo requires one.
    moments, axes = _principal(0.4 * body.mass * radius**2 * np.eye(3) if body.inertia is None else body.inertia)
    quaternion = np.roll(axes.as_quat(), 1)
    _add(effector, "inertial", pos=np.zeros(3), mass=body.mass, diaginertia=moments, quat=quaternion)
    # Drawn bodies have neither weight nor contacts.
    drawn["rgba"] = ORANGE  # type: ignore[assignment]
    if body.body is not None:
        _add(effector, "geom", name="platform", **(drawn | {"rgba": GLASS}), **_geom(body.body))
    _add(effector, "geom", type="sphere", size=radius, **drawn)
    for point in np.unique(body.points, axis=0):
        if np.linalg.norm(point) > radius:
            rod = np.concatenate([np.zeros(3), point])
            _add(effector, "geom", type="capsule", fromto=rod, size=ROD_RADIUS * extent, **drawn)
    for k, point in enumerate(body.points, 1):
        _add(effector, "site", name=f"point_{k}", pos=point, size=POINT_RADIUS * extent, rgba=ORANGE)
    # Pulleys come after the effector, so that the effector's coordinates are the first ones.
    if len(body.wheels):
        _pulleys(world, body, moved, extent)


def _pulleys(world: ElementTree.Element, body: Suspended, moved: Played, extent: float) -> None:
    # Each pulley swivels about its axis at the entry point; the x axis of its body points to its centre.
    axes, radii = np.asarray(body.pulleys.axes), np.asarray(body.pulleys.radius)  # type: ignore[union-attr]
    points, middles = attachments(body, moved)[0], _sides(body, moved)
    inertia = np.full(3, SWIVEL_INERTIA * body.mass * extent**2)
    for k, middle in zip(body.wheels.tolist(), middles.tolist(), strict=True):
        across = np.cross(axes[k], points[k] - body.spools[k])
        across = across / np.linalg.norm(across)
        matrix = np.stack([np.cross(across, axes[k]), across, axes[k]], axis=1)
        quaternion, centre = np.roll(Rotation.from_matrix(matrix).as_quat(), 1), np.array([radii[k], 0.0, 0.0])
        pulley = _add(world, "body", name=f"pulley_{k + 1}", pos=body.spools[k], quat=quaternion)
        _add(pulley, "joint", name=f"swivel_{k + 1}", type="hinge", axis=[0.0, 0.0, 1.0])
        _add(pulley, "inertial", pos=np.zeros(3), mass=SWIVEL_INERTIA * body.mass, diaginertia=inertia)
        wheel = {"type": "cylinder", "size": [radii[k], WHEEL_WIDTH * radii[k]], "quat": LYING, "rgba": DARK}
        _add(pulley, "geom", name=f"wheel_{k + 1}", pos=centre, contype="0", conaffinity="0", **wheel)
        side = 2.0 * radii[k] * np.array([-np.cos(middle), 0.0, np.sin(middle)])
        _add(pulley, "site", name=f"side_{k + 1}", pos=centre + side, size=THINNEST * extent, rgba=CLEAR)
        for name, side_sign in (("left", 1.0), ("right", -1.0)):
            arm = [0.0, side_sign * FOLLOWING * extent, 0.0]
            _add(pulley, "site", name=f"{name}_{k + 1}", pos=arm, size=THINNEST * extent, rgba=CLEAR)


def _sides(body: Suspended, moved: Played) -> np.ndarray:
    # Angles from the entry points, in rad, of sites by which MuJoCo wraps tendons around the right side of pulleys:
    # less than half a turn behind the start of the tendon, and before its end, in all rows.
    axes, radii = (np.asarray(x)[body.wheels] for x in (body.pulleys.axes, body.pulleys.radius))  # type: ignore[union-attr]
    with double_precision():
        exits_of_cables = _EXITS(body.spools[body.wheels], axes, radii, attachments(body, moved)[:, body.wheels])
    start, end = (
        -np.arctan(LEAD),
        np.max(np.asarray(exits_of_cables.wrapped) / radii + np.arctan2(exits_of_cables.free, radii), axis=0),
    )
    lost = np.flatnonzero(~(end - start < 2.0 * np.pi - SMALLEST_GAP))
    if len(lost):
        error = f"MuJoCo cannot wrap cable {int(body.wheels[lost[0]]) + 1} around its pulley all along its motion"
        raise ConfigError("plan", f"has no model for MuJoCo: {error}")
    return 0.5 * (start + end)


def _geom(shape: Obstacle | Body) -> dict[str, Any]:
    if isinstance(shape, Box):
        quaternion = np.roll(Rotation.from_matrix(shape.rotation).as_quat(), 1)
        return {"type": "box", "pos": shape.centre, "size": np.maximum(shape.half, THINNEST), "quat": quaternion}
    if isinstance(shape, Sphere):
        return {"type": "sphere", "pos": shape.centre, "size": shape.radius}
    if isinstance(shape, Cylinder):
        if (shape.start == shape.end).all():
            return {"type": "sphere", "pos": shape.start, "size": shape.radius}
        return {"type": "capsule", "fromto": np.concatenate([shape.start, shape.end]), "size": shape.radius}
    return {"type": "mesh", "mesh": HULL}


def _principal(inertia: np.ndarray) -> tuple[np.ndarray, Rotation]:
    # MuJoCo computes principal axes to 6e-7 only, and refuses a body whose largest moment exceeds the sum of the
    # others, even by rounding.
    moments, axes = np.linalg.eigh(inertia)
    moments[2] = min(moments[2], moments[0] + moments[1])
    return moments, Rotation.from_matrix(axes * np.linalg.det(axes))


def _springs(body: Suspended, moved: Played) -> list[dict[str, Any]]:
    # Attributes of tendons: without force where they are shorter than unstretched.
    unstretched = unstretched_of(body, moved)[0]
    stiffness, damping = body.axial_stiffness / unstretched, body.axial_damping / unstretched
    longest = unstretched + leads(body)
    return [
        {"stiffness": k, "damping": c, "springlength": [0.0, end]}
        for k, c, end in zip(stiffness, damping, longest, strict=True)
    ]


def _cables(tendons: ElementTree.Element, body: Suspended, extent: float, springs: list[dict[str, Any]] | None) -> None:
    diameter = body.cable_diameter
    radius = CABLE_RADIUS * extent if diameter is None else max(0.5 * diameter, THINNEST * extent)
    for k in range(1, len(body.spools) + 1):
        spring = {} if springs is None else springs[k - 1]
        cable = _add(tendons, "spatial", name=f"cable_{k}", width=radius, rgba=BLUE, **spring)
        _add(cable, "site", site=f"spool_{k}")
        if k - 1 in body.wheels:
            _add(cable, "geom", geom=f"wheel_{k}", sidesite=f"side_{k}")
        _add(cable, "site", site=f"point_{k}")


def _followers(tendons: ElementTree.Element, equality: ElementTree.Element, body: Suspended, step: float) -> None:
    # A pulley is in the plane of its cable if two points on either side are equally far from the attachment point.
    for k in (body.wheels + 1).tolist():
        for name in ("left", "right"):
            tendon = _add(tendons, "spatial", name=f"{name}_{k}", width=THINNEST, rgba=CLEAR)
            _add(tendon, "site", site=f"{name}_{k}")
            _add(tendon, "site", site=f"point_{k}")
        hard = {"solref": [4.0 * step, 1.0], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0]}
        _add(equality, "tendon", name=f"follow_{k}", tendon1=f"left_{k}", tendon2=f"right_{k}", **hard)


def _motors(actuators: ElementTree.Element, body: Suspended, moved: Played) -> None:
    # A positive control shortens the cable; no cable can push. Without a limit, leave a reserve for a controller.
    maximum = np.maximum(moved.tension.max(0), 0.0)
    largest = np.maximum(np.where(np.isfinite(body.tension_max), body.tension_max, 2.0 * maximum.max()), maximum)
    for k, tension in enumerate(largest.tolist(), 1):
        limits = {"ctrllimited": "true", "ctrlrange": [0.0, tension]}
        _add(actuators, "motor", name=f"tension_{k}", tendon=f"cable_{k}", gear=-1.0, **limits)


def leads(body: Suspended) -> Float[np.ndarray, "n_cables"]:
    """Lengths of MuJoCo's tendons before the points at which cables enter their pulleys, m."""
    none = np.zeros(len(body.spools))
    return none if body.pulleys is None else LEAD * np.asarray(body.pulleys.radius)


def unstretched_of(body: Suspended, moved: Played) -> Float[np.ndarray, "n n_cables"]:
    """Unstretched lengths of elastic cables, from lengths and tensions of a motion, m."""
    return np.asarray(unstretched_lengths(moved.length, moved.tension, body.axial_stiffness))  # type: ignore[arg-type]


def control_file_of(path: Path) -> Path:
    """Control file beside a model."""
    return path.with_name(f"{path.stem}_control.csv")


def write_mjcf(plan: PlannedMotions, path: Path, step: float = STEP, *, elastic: bool = False) -> None:
    """Write a model of a plan's robot, and beside it the control file that plays the plan."""
    body = suspended(plan)
    if elastic:
        check_elastic(plan, body)
    moved, beside = played(plan, step), control_file_of(path)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    name, values = ("length", unstretched_of(body, moved)) if elastic else ("tension", moved.tension)
    writer.writerow(["t", *(f"{name}_{k + 1}" for k in range(values.shape[1]))])
    writer.writerows([map(repr, row) for row in np.column_stack([moved.time, values]).tolist()])
    note = "" if plan.feasible else " The plan is NOT PROVED FEASIBLE; no cable of the model pushes."
    # Write the control file before the model that names it.
    publish(Disk(), beside, text.getvalue().encode())
    publish(Disk(), path, model_xml(body, moved, step, beside.name, note, elastic=elastic).encode())


def check_elastic(plan: PlannedMotions, body: Suspended) -> None:
    """Refuse robots whose cables do not stretch, or turn the effector although it only translates here."""
    if body.axial_stiffness is None:
        raise ConfigError("--elastic", "must be absent for a robot without axial_stiffness")
    if plan.robot_file.pairs is not None:
        raise ConfigError("--elastic", "must be absent for a platform that only translates: elastic cables let it turn")
