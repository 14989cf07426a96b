"""Trajectories of CASPR: NAME_trajectories.xml, poses of the one joint of a model over time, metres, z up.

Formulas are those of CASPR (github.com/darwinlau/CASPR, src/Model/Bodies/Trajectory/JointTrajectory.m, src/Util/
Mathematics/Geometry/Spline.m, and Trigonometry/Quaternion.m there). Between two points a joint coordinate is a line, a
cubic, a quintic, or a line between two parabolas. The orientation of a spherical joint turns about a fixed axis from
one point to the next, by an angle that follows the same law from rest to rest; CASPR itself refuses rates of such
joints. This module makes quintic pieces of quaternions, as many as needed to come within `TURN_ERROR`.
"""

import dataclasses
import math
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from cspr_jax.config.formats.caspr import joint_position
from cspr_jax.config.formats.xml_text import child, number, read_xml, text_of
from cspr_jax.config.motions.table import MotionPieces
from cspr_jax.config.wording import either
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.errors.suggestions import did_you_mean

ENDING = "_trajectories.xml"
TURN_ERROR = 1e-11  # largest error of the components of quaternions
MAX_PARTS = 1024  # largest number of parts of a piece
MAX_PIECES = 100_000  # largest number of pieces of a trajectory
MAX_TURNS = 300  # largest number of turns of a coordinate
LONGEST_LINE = 600  # letters
_AVERAGE, _BLEND = "cubic_spline_average_velocity_trajectory", "parabolic_blend_trajectory"
# Tags of the derivatives that the points of each kind of trajectory have.
_KINDS = {
    "linear_spline_trajectory": ("q",),
    "cubic_spline_trajectory": ("q", "q_dot"),
    _AVERAGE: ("q",),
    "quintic_spline_trajectory": ("q", "q_dot", "q_ddot"),
    _BLEND: ("q",),
}


@dataclasses.dataclass(frozen=True)
class _Coordinates:
    # Axes of the coordinates that move the joint, which come first, then of those that turn it. The order of several
    # turns is in the letters of scipy: capitals are axes of the body.
    moves: tuple[int, ...] = ()
    turns: tuple[int, ...] = ()
    order: str = ""


_COORDINATES = {
    "SPATIAL_EULER_XYZ": _Coordinates((0, 1, 2), (0, 1, 2), "XYZ"),
    "S_EULER_XYZ": _Coordinates((), (0, 1, 2), "XYZ"),
    "S_FIXED_XYZ": _Coordinates((), (0, 1, 2), "xyz"),
    "T_XYZ": _Coordinates((0, 1, 2)),
    "PLANAR_XZ": _Coordinates((0, 2), (1,)),
    "PLANAR_YZ": _Coordinates((1, 2), (0,)),
    "PLANAR_XY": _Coordinates((0, 1), (2,)),
    "P_XZ": _Coordinates((0, 2)),
    "P_YZ": _Coordinates((1, 2)),
    "P_XY": _Coordinates((0, 1)),
}


def read(path: Path, name: str | None = None, bodies: Path | None = None) -> MotionPieces:
    """A trajectory of CASPR, in the axes of the robot file that `config.formats.caspr` makes of its model."""
    element = _chosen(path, name)
    label = f'trajectory "{element.get("id", "")[:40]}"'
    if element.tag not in _KINDS:
        raise ConfigError(path, f"{label}: <{element.tag}>: must be {either(_KINDS)}"[:400])
    kind, axes, start = joint_position(_bodies(path, bodies))
    coordinates = _COORDINATES[kind]
    count = len(coordinates.moves) + len(coordinates.turns)
    points = [point for point in child(element, "points", path, label) if isinstance(point.tag, str)]
    if len(points) < 2:
        raise ConfigError(path, f"{label}: {len(points)} points: must be two or more")
    times = _times(element, points, path, label)
    values = [_values(points, tag, count, path, label) for tag in _KINDS[str(element.tag)]]
    if element.tag == _AVERAGE:
        values.append(_average(points, times, values[0], path, label))
    if len(coordinates.turns) == 3 and any(rates[:, -3:].any() for rates in values[1:]):
        raise ConfigError(path, f"{label}: rates of angles: must be 0, as CASPR demands of joints that turn in space")
    knots, table, law = (_blends if element.tag == _BLEND else _curves)(element, points, times, values, path, label)
    position = np.zeros((*table.shape[:2], 3))
    position[:, :, coordinates.moves] = table[:, :, : len(coordinates.moves)]
    quaternion = None
    if coordinates.turns:
        _check_turns(values[0][:, len(coordinates.moves) :], path, label)
        try:
            knots, position, quaternion = _rotating_pieces(coordinates, knots, position, table, law, values[0])
        except InputError as error:
            raise ConfigError(path, f"{label}: {error}") from error
        quaternion[:, :, 1:] = quaternion[:, :, 1:] @ axes.T
    return MotionPieces(knots, (position + start) @ axes.T, quaternion, "up", "origin")


def _chosen(path: Path, name: str | None) -> Element:
    root = read_xml(path)
    if root.tag != "trajectories":
        raise ConfigError(path, f"<{root.tag}>: must be <trajectories>, a file of CASPR")
    tags = [element for element in child(root, "joint_trajectories", path) if isinstance(element.tag, str)]
    elements = {element.get("id", ""): element for element in tags}
    if not elements:
        raise ConfigError(path, "no trajectories: must have one of joint coordinates")
    if name is None and len(elements) == 1:
        return tags[0]
    if name is None or name not in elements:
        question = "" if name is None else did_you_mean(name, elements)
        line = f"trajectory = {shown(name)}: {question}must be {either(elements)}"
        raise ConfigError(path, line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 3]}...")
    return elements[name]


def _bodies(path: Path, bodies: Path | None) -> Path:
    file = path.with_name(path.name.removesuffix(ENDING) + "_bodies.xml") if bodies is None else bodies
    if file == path or not file.is_file():
        raise ConfigError(path, f"no such file beside it: {file.name}: must be there, since it says what q is")
    return file


def _attribute(element: Element, key: str, path: Path, label: str) -> float:
    return number(element.get(key, ""), path, f"{label}.{key}")


def _times(element: Element, points: list[Element], path: Path, label: str) -> np.ndarray:
    definition = element.get("time_definition", "")
    if definition not in ("relative", "absolute"):
        raise ConfigError(path, f'{label}.time_definition = {shown(definition)}: must be "relative" or "absolute"')
    stated = [_attribute(point, "time", path, f"{label}, point {k + 2}") for k, point in enumerate(points[1:])]
    times = np.append(0.0, np.cumsum(stated) if definition == "relative" else stated)
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        k = int(late[0])
        allowed = "greater than 0" if definition == "relative" else f"greater than {times[k]:g}"
        raise ConfigError(path, f"{label}, point {k + 2}.time = {stated[k]:g}: must be {allowed}")
    return times


def _values(points: list[Element], tag: str, count: int, path: Path, label: str) -> np.ndarray:
    return np.array([_vector(point, tag, count, path, f"{label}, point {k + 1}") for k, point in enumerate(points)])


def _vector(point: Element, tag: str, count: int, path: Path, label: str) -> list[float]:
    words = text_of(child(point, tag, path, label)).split()
    if len(words) != count:
        raise ConfigError(path, f"{label}.{tag}: {len(words)} numbers: must be {count}, as the joint has coordinates")
    return [number(word, path, f"{label}.{tag}") for word in words]


def _average(points: list[Element], times: np.ndarray, values: np.ndarray, path: Path, label: str) -> np.ndarray:
    # Rates at the points: first and last from the file, the others as mean of the slopes on both sides.
    means = np.diff(values, axis=0) / np.diff(times)[:, None]
    ends = [
        _vector(points[k], "q_dot", values.shape[1], path, f"{label}, point {k % len(points) + 1}") for k in (0, -1)
    ]
    return np.vstack([ends[0], (means[1:] + means[:-1]) / 2.0, ends[1]])


def _check_turns(angles: np.ndarray, path: Path, name: str) -> None:
    largest = 2.0 * math.pi * MAX_TURNS
    far = np.flatnonzero((np.abs(angles) > largest).any(axis=1))
    if len(far):
        angle = float(np.abs(angles[far[0]]).max())
        allowed = f"at most {MAX_TURNS} turns, {largest:.6g} rad"
        raise ConfigError(path, f"{name}, point {far[0] + 1}.q: an angle of {angle:g} rad: must be {allowed}")


def _curves(
    element: Element, points: list[Element], times: np.ndarray, values: list[np.ndarray], path: Path, label: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # Knots, Bernstein coefficients (m, degree + 1, coordinates), and those of the law from rest to rest (m, degree +
    # 1): half of them 0, half of them 1.
    from scipy.interpolate import BPoly  # takes time

    table = np.moveaxis(BPoly.from_derivatives(times, np.stack(values, axis=1)).c, 0, 1)
    law = np.repeat([0.0, 1.0], len(values))
    return times, table, np.tile(law, (len(table), 1))


def _blends(
    element: Element, points: list[Element], times: np.ndarray, values: list[np.ndarray], path: Path, label: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # Like `_curves`, for a parabola, a line, and a parabola from rest to rest.
    knots, law = [0.0], []
    for k, point in enumerate(points[1:]):
        key, holder = ("blend_time", point) if point.get("blend_time") else ("blend_time_default", element)
        blend, width = _attribute(holder, key, path, f"{label}, point {k + 2}"), times[k + 1] - times[k]
        if not 0.0 < 2.0 * blend < width:
            raise ConfigError(
                path, f"{label}, point {k + 2}.{key} = {blend:g}: must be greater than 0, and less than {width / 2:g}"
            )
        fraction = blend / (2.0 * (width - blend))
        knots += [times[k] + blend, times[k + 1] - blend, times[k + 1]]
        law += [[0.0, 0.0, fraction], [fraction, 0.5, 1.0 - fraction], [1.0 - fraction, 1.0, 1.0]]
    laws, starts = np.array(law), np.repeat(values[0][:-1], 3, axis=0)
    steps = np.repeat(np.diff(values[0], axis=0), 3, axis=0)
    return np.array(knots), starts[:, None] + laws[:, :, None] * steps[:, None], laws


def _rotating_pieces(
    coordinates: _Coordinates,
    knots: np.ndarray,
    position: np.ndarray,
    table: np.ndarray,
    law: np.ndarray,
    values: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # Return knots, positions and quaternions, with pieces divided until quaternions are accurate.
    from scipy.spatial.transform import Rotation  # takes time

    if len(coordinates.turns) == 1:
        start, axis = Rotation.identity(len(table)), np.tile(np.eye(3)[coordinates.turns[0]], (len(table), 1))
        half = table[:, :, -1] / 2.0
    else:
        orientations = Rotation.from_euler(coordinates.order, values[:, -3:])
        repeats = len(table) // (len(values) - 1)
        vectors = np.repeat((orientations[:-1].inv() * orientations[1:]).as_rotvec(), repeats, axis=0)
        angle = np.linalg.norm(vectors, axis=1, keepdims=True)
        start, axis = (
            orientations[np.repeat(np.arange(len(values) - 1), repeats)],
            vectors / np.where(angle > 0.0, angle, 1.0),
        )
        half = law * angle / 2.0
    parts = 4
    while True:
        width = np.repeat(np.diff(knots) / parts, parts)
        curve = _split(half[:, :, None], parts)[:, :, 0]
        pieces, error = _pieces(curve, np.repeat(axis, parts, axis=0), width)
        if error <= TURN_ERROR:
            break
        parts *= 2
        if parts > MAX_PARTS or parts * len(table) > MAX_PIECES:
            allowed = f"must turn by less from point to point, so that {MAX_PIECES} polynomial pieces are enough"
            raise InputError("points", None, allowed, problem=f"{len(values)} of them")
    before = np.repeat(start.as_quat(scalar_first=True), parts, axis=0)[:, None]
    fine = (knots[:-1, None] + np.diff(knots)[:, None] * np.arange(parts) / parts).ravel()
    return np.append(fine, knots[-1]), _split(position, parts), _product(before, pieces)


def _pieces(half: np.ndarray, axis: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, float]:
    # Quintic pieces (m, 6, 4) of the quaternions of rotations about axes (m, 3) by twice the angles `half`, given by
    # Bernstein coefficients (m, degree + 1); and their errors in the middle.
    degree = half.shape[1] - 1

    def unit(angle: np.ndarray) -> np.ndarray:
        return np.concatenate([np.cos(angle)[:, None], np.sin(angle)[:, None] * axis], axis=1)

    ends = []
    for c in (half, half[:, ::-1]):  # derivatives with respect to the fraction of the piece, at either end
        first = degree * (c[:, 1] - c[:, 0])
        second = degree * (degree - 1) * (c[:, min(2, degree)] - 2.0 * c[:, 1] + c[:, 0])
        value, across = unit(c[:, 0]), unit(c[:, 0] + math.pi / 2.0)
        derivative = first[:, None] * across
        second_derivative = second[:, None] * across - (first**2)[:, None] * value
        ends.append([value, value + derivative / 5.0, value + 2.0 * derivative / 5.0 + second_derivative / 20.0])
    pieces = np.stack([*ends[0], *reversed(ends[1])], axis=1)
    binomials = np.array([1.0, 5.0, 10.0, 10.0, 5.0, 1.0]) / 32.0
    middle = np.array([math.comb(degree, k) for k in range(degree + 1)]) / 2.0**degree
    return pieces, float(np.abs(binomials @ pieces - unit(half @ middle)).max())


def _split(coefficients: np.ndarray, parts: int) -> np.ndarray:
    # Divide pieces (m, degree + 1, n) into equal parts: Bernstein coefficients (m parts, degree + 1, n).
    degree = coefficients.shape[1] - 1
    nodes = np.arange(degree + 1) / degree

    def basis(fraction: np.ndarray) -> np.ndarray:
        k = np.arange(degree + 1)
        binomials = np.array([math.comb(degree, j) for j in k])
        return binomials * fraction[..., None] ** k * (1.0 - fraction[..., None]) ** (degree - k)

    matrices = np.linalg.solve(basis(nodes), basis((np.arange(parts)[:, None] + nodes) / parts))
    return np.einsum("jab,mbn->mjan", matrices, coefficients).reshape(-1, degree + 1, coefficients.shape[2])


def _product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    # Products of quaternions (..., 4), scalar first.
    scalar = left[..., :1] * right[..., :1] - (left[..., 1:] * right[..., 1:]).sum(-1, keepdims=True)
    vector = left[..., :1] * right[..., 1:] + right[..., :1] * left[..., 1:] + np.cross(left[..., 1:], right[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)
