"""Maps of every kind over parameters of the robot, beside the maps of each robot."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import cspr_jax
from cspr_jax.config.robot import resolve_robot
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
