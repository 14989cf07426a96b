"""Maps of free motions: cells against plans of the same poses, independent times, symmetries, verdicts and refusals."""

import json

import numpy as np
import pytest
from oracles import free_motion_cases, free_motion_times
from support.free_motions import problem_of

from cspr_jax import compute_sweep, plan
from cspr_jax.errors import ConfigError
from cspr_jax.families.free.batch import free_motions
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.schema.verdicts import Verdict

# Splines of maps are coarser than those of plans, and searches begin from fewer starts.
SAME, MIRRORED = 0.01, 2e-3
PLANAR = {
    "schema": 1,
    "map": "least-time",
    "robot": {"name": "two", "planar": True, "base_points": [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "mass": 1.0},
    "axes": {"x": [-0.6, 0.0, 0.6], "y": [0.0], "z": [-0.5, 1.0, 1.5]},
    "trajectory": {"family": "free", "from": {"position": [0.0, 0.0, 1.0]}},
    "limits": {"tension_max": 15.0},
}


def cells_of(sweep):
    """Cells of a sweep, with their plans: None where they have none."""
    result = compute_sweep(sweep)
    settings, dims = json.loads(result.attrs["settings"]), list(result.sizes)
    for index in np.ndindex(*result.sizes.values()):
        place = {name: float(result[name].values[i]) for name, i in zip(dims, index, strict=True)}
        cell = {name: data.values[index].item() for name, data in result.data_vars.items()}
        yield place, cell, cell_plan(settings, place, cell)


def check_cell(cell, keys):
    planned = plan(keys)
    assert planned.feasible
    assert cell["verdict"] == 0
    assert cell["duration"] == pytest.approx(planned.to_dict()["segments"][0]["duration"], rel=SAME)
    assert cell["lower_bound"] == pytest.approx(planned.to_dict()["segments"][0]["lower_bound"], rel=1e-9)
    assert cell["lower_bound"] < cell["duration"]
    assert -15.0 * TOUCHED <= cell["tension_margin_bound"] <= cell["tension_margin"]


@pytest.mark.thorough
def test_targets():
    """Above the spools nothing is searched; the start is reached at once; mirror images take as long."""
    cells = {(place["x"], place["z"]): (cell, keys) for place, cell, keys in cells_of(PLANAR)}
    for x in PLANAR["axes"]["x"]:
        above = cells[x, -0.5][0]
        assert Verdict(above["verdict"]) == Verdict.ABOVE_SPOOLS and np.isnan(above["duration"])
    start, keys = cells[0.0, 1.0]
    assert keys is None
    assert start["verdict"] == start["duration"] == start["lower_bound"] == 0.0
    assert start["tension_margin"] > 0.0
    for z in (1.0, 1.5):
        left, right = (cells[x, z][0]["duration"] for x in (-0.6, 0.6))
        assert left == pytest.approx(right, rel=MIRRORED)
    check_cell(*cells[0.6, 1.5])


@pytest.mark.soak
def test_times_of_table_2_1():
    """A second optimiser finds the same times; an infeasible pair among them changes nothing."""
    names = [f"segment {number}" for number in range(1, 7)]
    references = [free_motion_times.reference(name) for name in names]
    with double_precision():
        problem, frame = problem_of(free_motion_cases.PROTOTYPE, free_motion_cases.LIMITS)
        pairs, still = [], np.zeros((2, 3))
        for case in [reference.case for reference in references]:
            places = np.asarray(frame.inward(np.array([case.start.position, case.end.position])))
            pairs.append(FreePoses(places, None, still, np.full((2, 3), np.nan), float(places[:, 2].mean())))
        far = FreePoses(np.array([[0.0, 0.0, 1.0], [40.0, 0.0, 0.5]]), None, still, np.full((2, 3), np.nan), 1.0)
        motions = free_motions(problem, None, [*pairs[:3], far, *pairs[3:]])
    assert motions.indices.tolist() == [0, 1, 2, 4, 5, 6]
    assert motions.answers.feasible.all()
    times = np.array([reference.time for reference in references])
    # The fifth one has several optima, of which starts in the plan find others, too.
    ratio = motions.answers.duration / times
    assert np.median(ratio) < 1.0 + SAME
    assert ratio.max() < 1.03
    assert ratio.min() > 0.995
    assert (motions.answers.duration > [reference.below for reference in references]).all()


@pytest.mark.thorough
def test_cells_in_space_are_what_plans_say():
    """From rest in P0, and from another position, around the ball that is checked and not avoided."""
    space = {"schema": 1, "map": "least-time", "robot": "prototype", "limits": {"tension_max": 3.0}}
    axes = {"x": [-0.5, 0.4], "y": [0.2], "z": [1.3], "z0": [1.5]}
    sweep = space | {"axes": axes, "trajectory": {"family": "free", "from": {"rest": True}}}
    for _, cell, keys in cells_of(sweep):
        check_cell(cell, keys)
        assert plan(keys).rows()["acceleration"][0] == pytest.approx([0.0] * 3, abs=1e-6)
    ball = {"kind": "sphere", "centre": [0.4, 0.2, 1.3], "radius": 0.05}
    started = {"family": "free", "from": {"position": [0.1, 0.0, 1.2]}}
    cells = list(cells_of(sweep | {"trajectory": started, "obstacle": [ball], "axes": axes | {"z0": [1.3]}}))
    check_cell(*cells[0][1:])
    assert Verdict(cells[1][1]["verdict"]) == Verdict.OBSTACLE and np.isnan(cells[1][1]["duration"])
    assert cells[0][1]["clearance"] > 0.0


@pytest.mark.thorough
def test_motions_lead_round_obstacles():
    """The fastest motions without the sphere pass through it, and both targets can be held beside it."""
    sweep = {
        "schema": 1,
        "map": "least-time",
        "robot": "prototype",
        "axes": {"x": [-0.4], "y": [-0.3, -0.17], "z": [1.3]},
        "trajectory": {"family": "free", "from": {"position": [0.4, 0.1, 1.2]}},
        "limits": {"tension_max": 4.0},
    }
    sphere = {"kind": "sphere", "centre": [0.045, -0.05, 0.85], "radius": 0.1}
    without, among = (compute_sweep(sweep | more) for more in ({}, {"obstacle": [sphere]}))
    assert not without["verdict"].any()
    assert not among["verdict"].any()
    assert (among["clearance"] > 0.0).all()
    assert (among["duration"] > 1.01 * without["duration"]).all()
    assert (among["duration"] < 1.5 * without["duration"]).all()


@pytest.mark.soak
def test_platforms_keep_their_orientation():
    turn = [0.995, 0.0, 0.0, 0.09987492177719089]
    sweep = {
        "schema": 1,
        "map": "least-time",
        "robot": "cogiro",
        "axes": {"x": [-2.0, 1.0], "y": [-1.0], "z": [1.2]},
        "trajectory": {"family": "free", "from": {"position": [-1.0, -1.0, 1.5], "quaternion": turn}},
        "limits": {"tension_min": 100.0, "tension_max": 5000.0},
    }
    for _, cell, keys in cells_of(sweep):
        # Searches of platforms often lead to nothing.
        assert cell["verdict"] in (0, Verdict.UNDECIDED)
        if cell["verdict"]:
            assert np.isnan(cell["duration"])
            continue
        planned = plan(keys)
        # Maps search from fewer starts, and with wider intervals.
        assert cell["duration"] == pytest.approx(planned.to_dict()["segments"][0]["duration"], rel=0.05)
        np.testing.assert_allclose(planned.rows()["quaternion"][[0, -1]], [turn, turn], atol=1e-9)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"limits": {"tension_min": 0.1}}, "tension_max = (missing): must be a number, N: without it the least time"),
        ({"trajectory": {"family": "free", "from": {"rest": True}}}, "axes.z0 is missing: depth of P0"),
        ({"trajectory": {"family": "free"}}, "trajectory.from is missing"),
        (
            {"trajectory": PLANAR["trajectory"] | {"path": {"lift": 0.1}}},
            'trajectory.path: must be absent with family = "free"',
        ),
        ({"trajectory": {"family": "bezier"}}, '"s-curve", "path" or "free" in this map'),
        ({"run": {"store": ["clearance"]}}, "run.store: clearance: must be absent without"),
        ({"axes": PLANAR["axes"] | {"z": [-0.5]}}, "above the spool plane"),
    ],
)
def test_bad_input_is_one_line(more, message):
    with pytest.raises(ConfigError) as caught:
        compute_sweep(PLANAR | more)
    text = str(caught.value)
    assert message in text and "\n" not in text
