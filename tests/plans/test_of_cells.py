"""Plans of single cells of maps: they are the motions whose numbers the cells hold."""

import json

import numpy as np
import pytest

from cspr_jax import compute_sweep, plan
from cspr_jax.plans.cell_plan import cell_plan

POSES = {
    "map": "poses",
    "robot": "laval-mssm",
    "axes": {"x": [0.9, -0.4], "y": [0.3], "z": [1.7], "tilt": [0.0, 0.3], "tilt_azimuth": [0.5], "z0": [1.7]},
    "trajectory": {
        "family": "hypocycloid",
        "amplitude": {"name": "effective-c3", "epsilon": 0.15},
        "max_arcs": 20,
        "from": {"rest": True},
    },
}
SWEEPS = {
    "arcs": {
        "map": "minimum-arcs",
        "robot": "prototype",
        "axes": {"radius": [0.2, 0.9], "azimuth": [0.4, 4.0], "z": [1.2], "z0": [1.0, 1.7]},
        "trajectory": {"family": "hypocycloid-standard", "from": {"rest": True}, "amplitude": "quintic"},
        "limits": {"tension_max": 3.0},
    },
    "starts": {
        "map": "minimum-arcs",
        "robot": "prototype",
        "axes": {"x": [0.4], "y": [0.1, 0.6], "z": [1.2], "from_x": [0.3, -0.2], "from_y": [0.0], "from_z": [1.0]}
        | {"z0": [1.2]},
        "trajectory": {"family": "hypocycloid-standard"},
    },
    "oscillations": {
        "map": "minimum-oscillations",
        "robot": "prototype",
        "axes": {"x": [0.2, 0.6, -0.9], "y": [0.3], "z": [1.0]},
        "trajectory": {"family": "transition", "inclination": "best", "amplitude": "quintic"},
    },
    "lines": {
        "map": "least-time",
        "robot": "boralugoda-rectangle",
        "axes": {"x": [3.0, 30.0], "y": [12.0], "z": [3.0, 12.0]},
        "trajectory": {"family": "s-curve", "max_acceleration": 10.0, "from": {"position": [1.0, 20.0, 7.0]}},
    },
    "redundant arcs": {
        "map": "minimum-arcs",
        "robot": "boralugoda-rectangle",
        "axes": {"x": [24.0, 50.0], "y": [18.0], "z": [8.0], "z0": [20.0]},
        "trajectory": {"family": "hypocycloid-standard", "from": {"rest": True}, "max_arcs": 4},
    },
    "redundant oscillations": {
        "map": "minimum-oscillations",
        "robot": "boralugoda-planar-three",
        "axes": {"x": [24.0, 80.0], "y": [0.0], "z": [5.0]},
        "trajectory": {"family": "transition", "inclination": "best", "amplitude": "quintic", "max_arcs": 6},
    },
}
THOROUGH = ("lines", "redundant arcs", "redundant oscillations")


def cells_of(result):
    values = {name: data.values for name, data in result.data_vars.items()}
    names = list(result.dims)
    for index in np.ndindex(*(result.sizes[name] for name in names)):
        place = {name: float(result[name].values[i]) for name, i in zip(names, index, strict=True)}
        yield place, {name: data[index] for name, data in values.items()}


@pytest.mark.quick("starts")
@pytest.mark.parametrize(
    "sweep",
    [
        *(
            pytest.param(own, marks=[pytest.mark.thorough] * (name in THOROUGH), id=name)
            for name, own in SWEEPS.items()
        ),
        pytest.param(POSES, marks=pytest.mark.thorough, id="poses"),
    ],
)
def test_the_plan_of_a_cell_has_its_numbers(sweep):
    result = compute_sweep({"schema": 1, **sweep})
    settings = json.loads(result.attrs["settings"])
    feasible = 0
    for place, values in cells_of(result):
        if values["verdict"] != 0 or not np.isfinite(values["duration"]):
            continue
        planned = plan(cell_plan(settings, place, values))
        found = planned.to_dict()["segments"][0]
        feasible += 1
        assert planned.feasible
        assert found["duration"] == pytest.approx(values["duration"], rel=1e-9)
        if "margin" in values:
            # Those of platforms are narrowed down from other samples.
            assert found["margin"] == pytest.approx(values["margin"], rel=1e-3 if sweep is POSES else 1e-6, abs=1e-9)
    assert feasible > 1


def test_cells_that_are_no_motions_have_no_plan():
    sweep = {"map": "workspace", "robot": {"base_points": [[0.0, 0.0, 0.0]] * 3}}
    assert cell_plan(sweep, {"x": 0.0, "y": 0.0, "z": 1.0}, {}) is None
