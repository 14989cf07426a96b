"""Maps of least times along paths: cells are what plans say of the same paths."""

import json

import numpy as np
import pytest

from cspr_jax import compute_sweep, plan
from cspr_jax.errors import ConfigError
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.schema.verdicts import Verdict

START = {"position": [0.1, 0.05, 1.2]}
STORED = ["verdict", "duration", "lower_bound", "tension_margin", "tension_margin_bound"]
# The last target is the start, the first one out of reach.
LINES = {
    "schema": 1,
    "map": "least-time",
    "robot": "prototype",
    "axes": {"x": [-0.9, 0.0, 0.1], "y": [0.05], "z": [1.2]},
    "trajectory": {"family": "path", "from": START, "path": {"grid": 60}},
    "limits": {"tension_max": 3.0},
}
LIFTS = LINES | {
    "trajectory": LINES["trajectory"] | {"path": {"grid": 60, "lift": 0.08, "blend_tolerance": 0.02, "ramp_time": 0.0}}
}
BALL = {"kind": "sphere", "centre": [0.05, 0.05, 1.2], "radius": 0.02, "name": "ball"}
PLATFORM = LINES | {
    "robot": "cogiro",
    "axes": {"x": [-2.0, 2.0, 9.0], "y": [-1.0], "from_x": [-3.0], "from_z": [1.0], "z": [1.2]},
    "trajectory": LINES["trajectory"]
    | {"from": {"position": [0.0, -1.0, 0.0], "quaternion": [0.995, 0.0, 0.0, 0.09987492177719089]}},
    "limits": {},
}


def cells_of(sweep):
    """Cells of a sweep, with the segments of their plans: None where they have none."""
    result = compute_sweep(sweep)
    settings, dims = json.loads(result.attrs["settings"]), list(result.sizes)
    for index in np.ndindex(*result.sizes.values()):
        place = {name: float(result[name].values[i]) for name, i in zip(dims, index, strict=True)}
        cell = {name: data.values[index].item() for name, data in result.data_vars.items()}
        keys = cell_plan(settings, place, cell)
        yield place, cell, None if keys is None else plan(keys)


def check_cell(cell, planned):
    answers = planned.legs[0].answers
    assert cell["verdict"] == answers.verdict[0]
    # Sections that are computed together differ from single ones by rounding. The margin of a plan is refined; that of
    # a map is a bound of the proof, as close as its text says.
    assert cell["tension_margin_bound"] == pytest.approx(answers.margin_bound[0], rel=1e-6, abs=1e-10)
    rounding = 1e-6 * abs(cell["tension_margin"]) + 1e-10
    assert cell["tension_margin_bound"] - rounding <= answers.margin[0] <= cell["tension_margin"] + rounding
    usual = np.median(np.abs(planned.rows()["tension"]), axis=0).max()
    assert cell["tension_margin"] - answers.margin[0] <= 0.002 * max(abs(answers.margin[0]), 0.1 * usual) + rounding
    duration = answers.duration[0] if planned.feasible else np.nan
    assert cell["duration"] == pytest.approx(duration, rel=1e-9, nan_ok=True)
    bound = answers.details(0)["lower_bound"]
    assert cell["lower_bound"] == pytest.approx(bound, rel=1e-9, nan_ok=True)
    assert not planned.feasible or not cell["lower_bound"] > cell["duration"]


@pytest.mark.thorough
@pytest.mark.parametrize("sweep", [pytest.param(LINES, id="lines"), pytest.param(LIFTS, id="lifts")])
def test_cells_are_what_plans_say(sweep):
    verdicts = []
    for place, cell, planned in cells_of(sweep):
        verdicts.append(Verdict(cell["verdict"]))
        if planned is None:
            assert sweep is LINES and place["x"] == START["position"][0]
            assert cell["duration"] == cell["lower_bound"] == 0.0 and cell["tension_margin"] > 0.0
            continue
        check_cell(cell, planned)
        if planned.feasible:
            assert cell["lower_bound"] > 0.8 * cell["duration"]
    assert Verdict.SLACK_CABLE in verdicts[0] and verdicts[1:] == [Verdict.FEASIBLE] * 2


def test_lifted_paths_go_over_what_straight_ones_meet():
    """The mass passes each corner within the tolerance; its way round the ball has the clearance of its plan."""
    ways = {}
    for name, sweep in (("lines", LINES), ("lifts", LIFTS)):
        sweep = sweep | {"axes": LINES["axes"] | {"x": [0.0]}, "obstacle": [BALL]}
        ((_, ways[name], planned),) = cells_of(sweep)
        check_cell(ways[name], planned)
        places = np.asarray(planned.rows()["position"])
        assert np.all(places[[0, -1], 2] == pytest.approx(1.2))
        if name == "lifts":
            for x in (0.1, 0.0):
                distance = np.linalg.norm(places - [x, 0.05, 1.12], axis=1).min()
                assert 0.5 * 0.02 < distance <= 0.02 + 1e-3
            assert places[:, 2].min() == pytest.approx(1.12, abs=1e-6)
    assert Verdict(ways["lines"]["verdict"]) == Verdict.OBSTACLE and np.isnan(ways["lines"]["duration"])
    assert ways["lines"]["clearance"] < 0.0 < ways["lifts"]["clearance"]


@pytest.mark.ci("path1")
@pytest.mark.thorough
@pytest.mark.parametrize("path", [{"grid": 60}, {"grid": 60, "lift": 0.5, "blend_tolerance": 0.1}, {"lift": 0.3}])
def test_platforms_keep_their_orientation(path):
    sweep, verdicts = PLATFORM | {"trajectory": PLATFORM["trajectory"] | {"path": path}}, set()
    for place, cell, planned in cells_of(sweep):
        check_cell(cell, planned)
        verdicts.add(cell["verdict"] == 0)
        rows = planned.rows()
        np.testing.assert_allclose(rows["position"][0], [place["from_x"], -1.0, place["from_z"]], atol=1e-12)
        turn = np.array(PLATFORM["trajectory"]["from"]["quaternion"])
        np.testing.assert_allclose(rows["quaternion"], np.tile(turn, (len(rows["position"]), 1)), atol=1e-9)
    assert verdicts == {True, False}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"trajectory": {"from": {"rest": True}}}, "trajectory.from: must be { position"),
        ({"trajectory": {"from": None}}, "trajectory.from is missing"),
        ({"trajectory": {"from": START | {"quaternion": [1, 0, 0, 0]}}}, "trajectory.from.quaternion: must be absent"),
        ({"trajectory": {"from": START | {"beta_hat": 1.0}}}, "trajectory.from.beta_hat: must be absent"),
        ({"trajectory": {"path": {"lift": -0.1}}}, "trajectory.path.lift"),
        ({"trajectory": {"path": {"blend_tolerance": 0.1}}}, "absent without lift"),
        ({"trajectory": {"path": {"points": [[0, 0, 1]]}}}, "trajectory.path.points"),
        ({"trajectory": {"max_acceleration": 2.0}}, 'max_acceleration: must be absent with family = "path"'),
        ({"trajectory": {"family": "s-curve"}}, 'trajectory.path: must be absent with family = "s-curve"'),
        ({"trajectory": {"family": "transition"}}, '"s-curve", "path" or "free" in this map'),
        ({"run": {"store": ["margin"]}}, "run.store: margin: must be one of"),
        ({"run": {"store": ["clearance"]}}, "run.store: clearance: must be absent without"),
        ({"platform_hull": True}, "platform_hull: must be absent"),
        ({"axes": {"z": [-1.0]}}, "above the spool plane"),
    ],
)
def test_bad_input_is_one_line(more, message):
    keys = {
        name: LINES[name] | value if isinstance(value, dict) and name in LINES else value
        for name, value in more.items()
    }
    sweep = LINES | keys
    sweep["trajectory"] = {name: value for name, value in sweep["trajectory"].items() if value is not None}
    with pytest.raises(ConfigError) as caught:
        compute_sweep(sweep)
    text = str(caught.value)
    assert message in text and "\n" not in text
