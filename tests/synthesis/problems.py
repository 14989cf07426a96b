"""Ten problems of design, small enough for differential evolution: content of design files, by name."""

from __future__ import annotations

from typing import Any


def parameter(name: str, value: float, lower: float, upper: float, moves: dict[str, float]) -> dict[str, Any]:
    """A [[parameter]] table."""
    return {"name": name, "value": value, "lower": lower, "upper": upper, "moves": moves}


def axis(start: float, stop: float, count: int) -> dict[str, Any]:
    """An axis of a map."""
    return {"start": start, "stop": stop, "count": count}


def signed(key: str, factors: tuple[float, ...]) -> dict[str, float]:
    """Moves of one coordinate of several points, "points[{}][0]" by factors that are not 0."""
    return {key.format(i): factor for i, factor in enumerate(factors) if factor}


def workspace(axes: dict[str, Any], limits: dict[str, Any], **keys: Any) -> dict[str, Any]:
    """A map of a workspace."""
    return {
        "map": "workspace",
        "axes": axes,
        "limits": limits,
        "workspace": {"conditions": ["wrench-feasible"], **keys},
    }


def objective(of: str, quantity: str, goal: str, **keys: Any) -> dict[str, Any]:
    """An [[objective]] table."""
    return {"of": of, "quantity": quantity, "goal": goal, **keys}


FEASIBLE = {"of": "places", "quantity": "feasible"}
WIDTH = parameter("width", 2.0, 1.0, 8.0, {"base_points[0][0]": -0.5, "base_points[1][0]": 0.5})
PLANAR = {"name": "planar", "planar": True, "base_points": [[-1, 0, 0], [1, 0, 0]], "mass": 2.0, "parameter": [WIDTH]}
RECTANGLE = workspace(
    {"x": axis(-0.8, 0.8, 5), "y": [0], "z": axis(0.5, 1.5, 4)}, {"tension_min": 1, "tension_max": 30}
)
SIZE = parameter("size", 1.0, 0.2, 5.0, {"scale": 1})
TRIANGLE = {
    "name": "triangle",
    "base_points": [[0, 1, 0], [-(0.75**0.5), -0.5, 0], [0.75**0.5, -0.5, 0]],
    "mass": 1.0,
    "parameter": [SIZE],
}
CIRCLE = {
    "map": "workspace",
    "axes": {"radius": [0.7], "azimuth": axis(0.0, 5.497787143782138, 8), "z": [1.0, 1.3]},
    "workspace": {"conditions": ["static"]},
}
# The azimuths opposite to the spools of a triangle decide.
OPPOSITE = CIRCLE | {
    "axes": {"radius": [0.7], "azimuth": [0.5235987755982988, 2.6179938779914944, 4.71238898038469], "z": [1.0]}
}

THREE = {
    "name": "three",
    "base_points": [[0, 2, 0], [-2, -1, 0], [2, -1, 0]],
    "mass": 5.0,
    "parameter": [
        parameter("width", 4.0, 2.0, 8.0, {"base_points[1][0]": -0.5, "base_points[2][0]": 0.5}),
        parameter("back", 2.0, 1.0, 5.0, {"base_points[0][1]": 1}),
        parameter("tilt", 0.0, -1.0, 1.0, {"base_points[0][2]": 1}),
    ],
}
FOUR = {
    "name": "four",
    "base_points": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]],
    "mass": 5.0,
    "parameter": [
        parameter("width", 4.0, 2.0, 8.0, signed("base_points[{}][0]", (-0.5, 0.5, 0.5, -0.5))),
        parameter("depth", 4.0, 2.0, 8.0, signed("base_points[{}][1]", (-0.5, -0.5, 0.5, 0.5))),
        parameter("lift", 0.0, -1.0, 1.0, {"base_points[0][2]": 1, "base_points[2][2]": 1}),
        parameter("shift", 0.0, -1.0, 1.0, {"base_points[0][0]": 1, "base_points[2][0]": -1}),
    ],
}
BODY = {
    "name": "body",
    "pattern": "1R2T",
    "base_points": [[-2, 0, 0], [2, 0, 0], [2, 0, 3], [-2, 0, 3]],
    "platform_points": [[-0.2, 0, -0.1], [0.2, 0, -0.1], [0.2, 0, 0.1], [-0.2, 0, 0.1]],
    "mass": 3.0,
    "inertia": [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]],
    "parameter": [
        parameter("upper", 4.0, 2.0, 6.0, {"base_points[0][0]": -0.5, "base_points[1][0]": 0.5}),
        parameter("lower", 4.0, 2.0, 6.0, {"base_points[2][0]": 0.5, "base_points[3][0]": -0.5}),
        parameter("plate", 0.4, 0.1, 1.0, signed("platform_points[{}][0]", (-0.5, 0.5, 0.5, -0.5))),
    ],
}
SIX = {
    "name": "six",
    "base_points": [[0.3, 2, 0], [-0.3, 2, 0], [-2, -0.7, 0], [-1.7, -1.2, 0], [1.7, -1.2, 0], [2, -0.7, 0]],
    "platform_points": [
        [0.3, 0.2, 0],
        [-0.3, 0.2, 0],
        [-0.35, 0.1, 0],
        [-0.05, -0.35, 0],
        [0.05, -0.35, 0],
        [0.35, 0.1, 0],
    ],
    "mass": 4.0,
    "inertia": [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.2]],
    "parameter": [
        parameter("size", 1.0, 0.5, 2.0, {"scale": 1}),
        parameter("plate", 1.0, 0.4, 2.0, {"platform_scale": 1}),
    ],
}
EIGHT = {
    "name": "eight",
    "base_points": [[-3, -2, 0], [-3, -2, 0], [3, -2, 0], [3, -2, 0], [3, 2, 0], [3, 2, 0], [-3, 2, 0], [-3, 2, 0]],
    "platform_points": [
        [0.5, -0.5, 0.5],
        [-0.5, 0.5, -0.5],
        [-0.5, -0.5, -0.5],
        [0.5, 0.5, 0.5],
        [-0.5, 0.5, 0.5],
        [0.5, -0.5, -0.5],
        [0.5, 0.5, -0.5],
        [-0.5, -0.5, 0.5],
    ],
    "mass": 20.0,
    "inertia": [[3, 0, 0], [0, 3, 0], [0, 0, 3]],
    "parameter": [
        parameter("width", 6.0, 4.0, 10.0, signed("base_points[{}][0]", (-0.5, -0.5, 0.5, 0.5, 0.5, 0.5, -0.5, -0.5))),
        parameter("plate", 1.0, 0.4, 1.6, {"platform_scale": 1}),
        parameter("gap", 0.0, 0.0, 1.0, signed("base_points[{}][2]", (1, 0, 1, 0, 1, 0, 1))),
    ],
}
HELD = {"tension_min": 2, "tension_max": 120}
BOX = {"x": axis(-0.8, 0.8, 5), "y": axis(-0.8, 0.8, 5), "z": axis(1.0, 2.0, 3)}
LARGE_BOX = {"x": axis(-2, 2, 9), "y": axis(-2, 2, 9), "z": axis(1.0, 2.0, 3)}
LIFT = {
    "family": "s-curve",
    "max_acceleration": 0.4,
    "limits": {"speed_max": 0.6},
    "pose": [{"position": [-0.6, -0.4, 2.0]}, {"position": [0.6, -0.3, 1.2]}, {"position": [0.1, 0.6, 1.5]}],
}


def design(
    robot: dict[str, Any], goal: dict[str, Any], requirements: list[dict[str, Any]] | None = None, **keys: Any
) -> dict[str, Any]:
    """Content of a design file."""
    return {"schema": 1, "robot": robot, "objective": [goal], "requirement": requirements or [], **keys}


MARGIN = objective("places", "wrench_margin", "largest")
FRACTION = objective("places", "fraction", "largest")
VOLUME = objective("frame", "volume", "smallest")
POWER = objective("lift", "motor_power_max", "smallest")
WINCH = {"drum_radius": 0.05, "gear_ratio": 5.0, "motor_inertia": 4e-4, "efficiency": 0.9}
SECTION = {"x": axis(-0.5, 0.5, 5), "y": [0], "z": axis(1, 2, 4)}
LOW_BOX = {"x": axis(-1, 1, 3), "y": axis(-0.7, 0.7, 3), "z": axis(2, 3, 3)}
HIGH = {"of": "frame", "quantity": "extent_z", "lower": 0.1}


Content = dict[str, Any]


def placed(robot: Content, goal: Content, places: Content, *requirements: Content) -> Content:
    """Content of a design file with one map, `places`."""
    return design(robot, goal, list(requirements), maps={"places": places})


PROBLEMS: dict[str, dict[str, Any]] = {
    "planar width": placed(PLANAR, objective("frame", "extent_x", "smallest"), RECTANGLE, FEASIBLE),
    "planar margin": placed(PLANAR, MARGIN, RECTANGLE),
    "circle": placed(TRIANGLE, objective("parameters", "size", "smallest"), OPPOSITE, FEASIBLE),
    "three margin": placed(THREE, MARGIN, workspace(BOX, HELD)),
    "three volume": placed(THREE, VOLUME, workspace(BOX, {"tension_min": 2, "tension_max": 90}), FEASIBLE, HIGH),
    "three fraction": placed(THREE, FRACTION, workspace(LARGE_BOX, {"tension_min": 4, "tension_max": 60})),
    "four margin": placed(FOUR, MARGIN, workspace(BOX, HELD)),
    "body margin": placed(BODY, MARGIN, workspace(SECTION, {"tension_min": 2, "tension_max": 200})),
    "six fraction": placed(SIX, FRACTION, workspace(LARGE_BOX, {"tension_min": 1, "tension_max": 40})),
    "eight margin": placed(EIGHT, MARGIN, workspace(LOW_BOX, {"tension_min": 5, "tension_max": 400})),
    "least power": design(
        THREE | {"winch": WINCH, "tension_min": 2.0},
        POWER,
        [{"of": "lift", "quantity": "feasible"}],
        plans={"lift": LIFT},
    ),
}
