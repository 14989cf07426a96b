"""Maps of every kind over parameters of the robot, beside the maps of each robot."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import cspr_jax
from cspr_jax.api.sweeps import checked_sweep
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.schema.map_kinds import MAP_KINDS

SWEEPS = Path(__file__).parents[2] / "sweeps"
FILES = {
    "attainability": "attainable",
    "ellipse": "ellipse",
    "feasible-acceleration": "feasible_acceleration",
    "launch-range": "launch_range",
    "least-time": "least_time",
    "minimum-arcs": "tolerances",
    "minimum-oscillations": "transition_planar",
    "orientation-workspace": "orientation_workspace",
    "orientations": "orientation_envelope",
    "poses": "orientations",
    "sensitivity": "launch_sensitivity",
    "swing-range": "swing_range",
    "transition-envelopes": "figure_1_4",
    "workspace": "workspace_static",
}
# Cables in pairs stay parallel.
IN_PAIRS = ("launch-range", "sensitivity")
VALUES = [1.0, 1.15]


def _points(axis):
    """One or two points of an axis, inside of its range."""
    points = np.linspace(axis["start"], axis["stop"], axis["count"]) if isinstance(axis, dict) else np.array(axis)
    return points[[len(points) // 3, -1 - len(points) // 4]].tolist() if len(points) > 3 else points[:1].tolist()


def _small(kind):
    """A small sweep of a kind, of a robot with a parameter."""
    path = SWEEPS / f"{FILES[kind]}.toml"
    spec = tomllib.loads(path.read_text())
    robot = resolve_robot(spec["robot"], path, SWEEPS).model_dump(mode="json", exclude_none=True)
    moves = {"mass": robot["mass"]} if kind in IN_PAIRS else {"scale": 1.0}
    robot["parameter"] = [{"name": "size", "value": 1, "lower": 0.5, "upper": 3, "moves": moves}]
    spec |= {"robot": robot, "axes": {name: _points(axis) for name, axis in spec["axes"].items()}}
    if "orientations" in spec:
        spec["orientations"] = {"divisions": 4}
    return spec


@pytest.mark.quick("workspace", "swing-range", "transition-envelopes")
@pytest.mark.parametrize("kind", FILES)
def test_maps_over_robots_are_the_maps_of_each_robot(kind):
    spec = _small(kind)
    assert spec["map"] == kind
    whole = cspr_jax.compute_sweep(spec | {"axes": {"parameter.size": VALUES} | spec["axes"]})
    for i, value in enumerate(VALUES):
        alone = cspr_jax.compute_sweep(spec | {"parameters": {"size": value}})
        for name, values in alone.data_vars.items():
            part = whole[name].isel({"parameter.size": i}).values
            if kind == "workspace" and part.dtype.kind == "f":  # robots are lanes
                np.testing.assert_allclose(part, values.values, rtol=1e-9, err_msg=name)
            else:
                np.testing.assert_array_equal(part, values.values, err_msg=name)


def test_every_kind_is_here():
    assert set(FILES) == set(MAP_KINDS)


PLANAR = {
    **{"name": "plane", "planar": True, "base_points": [[0.7, 0, 0], [-0.7, 0, 0]], "mass": 0.1},
    "parameter": [{"name": "size", "value": 1, "lower": 0.5, "upper": 3, "moves": {"scale": 1}}],
}
FORMS = {"least-time-paths": "least_time_paths", "least-time-free": "least_time_free"}
IN_A_PLANE = [name for name in (*FILES, *FORMS) if not name.startswith(("attain", "orient", "poses", "minimum-arcs"))]


@pytest.mark.parametrize("axes", [{}, {"parameter.size": VALUES}], ids=["one", "many"])
@pytest.mark.parametrize("kind", IN_A_PLANE)
def test_targets_of_planar_robots_lie_in_its_plane(kind, axes):
    spec = tomllib.loads((SWEEPS / f"{(FILES | FORMS)[kind]}.toml").read_text())
    spec |= {"robot": PLANAR, "axes": axes | {name: _points(axis) for name, axis in spec["axes"].items()} | {"y": [0]}}
    spec.pop("limits", None)
    spec.pop("run", None)
    assert checked_sweep(spec).robot.is_planar
    wrong = {"y": [0, 0.1]}, {"from_y": [0, 0.1], "from_x": [0.1], "from_z": [1.0]}
    for more in wrong if "axes.from_y" in MAP_KINDS[spec["map"]].of(_family(spec)).keys else wrong[:1]:
        changed = spec | {"axes": spec["axes"] | more}
        with pytest.raises(ConfigError) as error:
            checked_sweep(changed)
        assert str(error.value) == f"sweep: axes.{next(iter(more))}: must be [0] for a planar robot"
    polar = {name: points for name, points in spec["axes"].items() if name not in ("x", "y")}
    with pytest.raises(ConfigError, match=r"axes.y: must be \[0\] for a planar robot"):
        checked_sweep(spec | {"axes": {"radius": [0.5], "azimuth": [0.0]} | polar})


def _family(spec):
    return spec.get("trajectory", {}).get("family", "hypocycloid-standard")


def test_a_map_of_no_planar_robot_refuses_the_robot():
    spec = _small("minimum-arcs") | {"robot": PLANAR}
    with pytest.raises(ConfigError, match='robot "plane" is planar: must be one that moves in space in this map'):
        cspr_jax.compute_sweep(spec)
