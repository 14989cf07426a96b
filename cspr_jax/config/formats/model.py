"""Model that all formats are read into, one body on cables, and its conversion to the content of a robot file."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.spool_plane import SMALLEST_AREA_RATIO

# Rows are x, y and z of a robot file in the axes of the other file, by the plane or line of motion in that file.
SAME = np.eye(3)
OF_XY = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
OF_YZ = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
OF_X = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
NO_GRAVITY = 1e-9  # m/s^2; gravity of robots that move in a level plane
# Largest distance of the points of a planar robot from its plane, as a fraction of the robot's extent.
OUT_OF_PLANE = 1e-9
LARGEST = 1e9  # N; larger tensions stand for no limit
DIGITS = 15  # significant digits that sums are written with
LARGEST_NUMBER = 1e18  # in a file, in any unit, so that products of several numbers stay finite


@dataclasses.dataclass
class Cable:
    """A cable.

    Fields:
        base: (3,) point where it leaves its spool, or enters its pulley, m.
        platform: (3,) attachment point, from the origin of the platform frame, m.
        name: name in the file; empty: none.
        tension_min: N.
        tension_max: N; infinite: none.
        radius: radius of its pulley, m; 0: none.
        axis: (3,) swivel axis of the pulley, in the direction in which the cable enters.
    """

    base: list[float]
    platform: list[float]
    name: str = ""
    tension_min: float | None = None
    tension_max: float = math.inf
    radius: float = 0.0
    axis: list[float] = dataclasses.field(default_factory=lambda: [0.0, 0.0, 1.0])


@dataclasses.dataclass
class Body:
    """A robot of one body, z up, in the axes of its file.

    Fields:
        file: file that it was read from, named in errors.
        name: name of the robot.
        pattern: pattern of its motion, a row of `robots.model.patterns`.
        cables: cables in the order of the file.
        source: where the numbers come from.
        mass: kg; None: missing.
        centre: (3,) mass centre from the origin of the platform frame, m.
        inertia: (3, 3) about the mass centre, platform axes, kg m^2; None: missing.
        axes: (3, 3) rows x, y and z of a robot file in these axes.
        is_level: whether its plane is level, so that it feels no gravity.
        cable_diameter: m.
        warnings: items that were left out.
        notes: sentences that begin with "placeholder", about numbers that the file does not have.
    """

    file: object
    name: str
    pattern: str
    cables: list[Cable]
    source: str
    mass: float | None = None
    centre: list[float] = dataclasses.field(default_factory=lambda: [0.0, 0.0, 0.0])
    inertia: np.ndarray | None = None
    axes: np.ndarray = dataclasses.field(default_factory=lambda: SAME)
    is_level: bool = False
    cable_diameter: float | None = None
    warnings: list[str] = dataclasses.field(default_factory=list)
    notes: list[str] = dataclasses.field(default_factory=list)


def about_centre(tensor: Float[np.ndarray, "3 3"], mass: float, centre: list[float]) -> Float[np.ndarray, "3 3"]:
    """Inertia about the mass centre, from the inertia about the origin of the platform frame, by Steiner's theorem."""
    arm = np.asarray(centre)
    return tensor - mass * (float(arm @ arm) * np.eye(3) - np.outer(arm, arm))


def robot_spec(body: Body) -> dict[str, Any]:
    """Content of the robot file that a body becomes."""
    if not body.cables:
        raise ConfigError(body.file, "no cables: must be one or more")
    base = np.array([cable.base for cable in body.cables]) @ body.axes.T
    platform = np.array([cable.platform for cable in body.cables]) @ body.axes.T
    swivels = np.array([cable.axis for cable in body.cables]) @ body.axes.T
    pattern = _own_pattern(body, platform)
    row = PATTERNS[pattern]
    if row.is_planar:
        _check_plane(body, base, platform)
        base[:, 1] = platform[:, 1] = 0.0
        swivels = _in_plane(body, swivels)
    if not row.is_body:  # a point mass does not turn: only forces matter
        base, platform = base - platform, np.zeros_like(platform)
    notes = list(body.notes)
    spec: dict[str, Any] = {"name": body.name, "pattern": pattern, "z_axis": "up", "base_points": _rounded(base)}
    if row.is_body:
        spec["platform_points"] = _rounded(platform)
    spec["mass"] = body.mass if body.mass else 1.0
    if not body.mass:
        notes.append("placeholder mass of 1 kg")
    if row.is_body:
        spec |= _inertia(body, platform, spec["mass"], notes, is_planar=row.is_planar)
    if body.is_level:
        spec["gravity"] = NO_GRAVITY
    spec |= _of_cables(body, swivels)
    # Sources that begin with a note are shown as placeholders.
    spec["source"] = "; ".join([*notes, body.source])
    return spec


def _own_pattern(body: Body, platform: np.ndarray) -> str:
    # A spatial body is free to turn if attachment points and mass centre lie on one line, or at one point.
    if body.pattern != "3R3T":
        return body.pattern
    offsets = platform - body.axes @ np.asarray(body.centre)
    sizes = np.append(np.linalg.svd(offsets, compute_uv=False), [0.0, 0.0])
    if sizes[0] == 0.0:
        body.warnings.append('all cables are attached at its mass centre: pattern = "3T", a point mass')
        return "3T"
    if sizes[1] <= SMALLEST_AREA_RATIO * sizes[0] and np.ptp(platform, axis=0).any():
        body.warnings.append('all cables are attached on one line: pattern = "2R3T", a rod')
        return "2R3T"
    return body.pattern


def _check_plane(body: Body, base: np.ndarray, platform: np.ndarray) -> None:
    tolerance = OUT_OF_PLANE * float(np.ptp(base, axis=0).max())
    for k, cable in enumerate(body.cables):
        if abs(base[k, 1] - platform[k, 1]) > tolerance:
            words = f"cable {k + 1}" + f' ("{cable.name[:40]}")' * bool(cable.name)
            raise ConfigError(body.file, f"{words} leaves the plane of a planar robot: must lie in it")


def _in_plane(body: Body, swivels: np.ndarray) -> np.ndarray:
    # A pulley that swivels about another axis would take its cable out of the plane.
    for cable, axis in zip(body.cables, swivels, strict=True):
        if cable.radius > 0.0 and abs(axis[1]) > OUT_OF_PLANE:
            cable.radius = 0.0
            body.warnings.append("pulleys that swivel out of its plane are left out")
    body.warnings[:] = dict.fromkeys(body.warnings)
    return swivels * np.array([1.0, 0.0, 1.0])


def _inertia(body: Body, platform: np.ndarray, mass: float, notes: list[str], *, is_planar: bool) -> dict[str, Any]:
    centre = body.axes @ np.asarray(body.centre)
    if is_planar:
        centre[1] = 0.0
    tensor = None if body.inertia is None else body.axes @ np.asarray(body.inertia) @ body.axes.T
    if tensor is None or not _is_real(tensor, is_planar=is_planar):
        if tensor is not None:
            body.warnings.append("its inertia tensor is that of no real body: a placeholder stands for it")
        radius = float(np.linalg.norm(platform - centre, axis=1).max()) or 1.0
        tensor = 0.4 * mass * radius**2 * np.eye(3)
        notes.append("placeholder inertia of a uniform sphere of the platform's size")
    return {"inertia": _rounded(tensor), "centre_of_mass": _rounded(centre)}


def _is_real(tensor: np.ndarray, *, is_planar: bool) -> bool:
    if is_planar:
        return bool(tensor[1, 1] > 0.0)
    low, middle, high = np.linalg.eigvalsh(tensor)
    return bool(low > 0.0 and high <= (low + middle) * (1.0 + 1e-9))


def _of_cables(body: Body, swivels: np.ndarray) -> dict[str, Any]:
    cables, spec = body.cables, dict[str, Any]()
    minimum = [cable.tension_min for cable in cables]
    if any(low is not None for low in minimum):
        spec["tension_min"] = _one([low or 0.0 for low in minimum])
    maximum = [cable.tension_max if cable.tension_max <= LARGEST else math.inf for cable in cables]
    if any(math.isfinite(high) for high in maximum):
        spec["tension_max"] = _one(maximum)
    if body.cable_diameter:
        spec["cable_diameter"] = body.cable_diameter
    if any(cable.radius > 0.0 for cable in cables):
        spec["pulley_radius"] = _one([cable.radius for cable in cables])
        axes = _rounded(swivels)
        spec["pulley_axes"] = axes[0] if all(axis == axes[0] for axis in axes) else axes
    return spec


def _one(values: list[float]) -> Any:
    return values[0] if len(set(values)) == 1 else values


def _rounded(values: np.ndarray) -> Any:
    # Sums and rotated axes are written without the last digit, and without a negative zero.
    return [_rounded(row) for row in values] if values.ndim > 1 else [float(f"{x:.{DIGITS}g}") + 0.0 for x in values]
