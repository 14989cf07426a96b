"""Maps of arcs among obstacles: cells are what plans say, and what dense samples of motions say."""

import json

import numpy as np
import pytest
from matplotlib.colors import to_hex

import cspr_jax
from cspr_jax.errors import ConfigError, CsprError
from cspr_jax.outputs.plots.robots.obstacles import COLOUR
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.schema.verdicts import Verdict

SPOOLS = np.array([[0.22516660498395405, -0.13, 0.0], [-0.22516660498395405, -0.13, 0.0], [0.0, 0.26, 0.0]])
ROBOT = {"name": "three", "mass": 0.198, "z_axis": "down", "base_points": SPOOLS.tolist()}
BALL = {"kind": "sphere", "centre": [0.0, 0.04, 1.542], "radius": 0.02, "name": "ball"}
MOST = 4
SWEEP = {
    "schema": 1,
    "map": "minimum-arcs",
    "robot": ROBOT,
    "axes": {"x": [-0.1, 0.05], "y": [-0.03, 0.05], "z": [1.53, 1.62], "z0": [1.7]},
    "trajectory": {"family": "hypocycloid-standard", "from": {"position": [0.1, 0.05, 1.5]}, "max_arcs": MOST},
    "obstacle": [BALL],
    "run": {"store": ["arcs", "tried_arcs", "verdict", "duration", "margin", "clearance"]},
}


# Beside a cable, where two arcs do not help.
BEHIND = {"kind": "sphere", "centre": [0.015, 0.025, 1.421], "radius": 0.006}


def clearance_of(positions, ball=BALL):
    """Smallest distance of a ball from cables to positions (n, 3)."""
    ways, centre = positions[:, None] - SPOOLS, np.array(ball["centre"])
    along = np.clip(((centre - SPOOLS) * ways).sum(2) / (ways**2).sum(2), 0.0, 1.0)
    return (np.linalg.norm(SPOOLS + along[..., None] * ways - centre, axis=2) - ball["radius"]).min()


def plan_of(place, arcs=None, **more):
    """Plan of the motion to a cell."""
    target = {"position": [place[name] for name in "xyz"]} | ({} if arcs is None else {"arcs": arcs})
    keys = {"schema": 1, "robot": ROBOT, "family": "hypocycloid-standard", "z0": place["z0"], "max_arcs": MOST}
    return cspr_jax.plan(keys | {"pose": [SWEEP["trajectory"]["from"], target], "samples": 800} | more)


@pytest.fixture(scope="module")
def result():
    return cspr_jax.compute_sweep(SWEEP)


def cells_of(result):
    for index in np.ndindex(*result["arcs"].shape):
        place = {name: float(result[name].values[i]) for name, i in zip(result["arcs"].dims, index, strict=True)}
        yield place, {name: result[name].values[index].item() for name in result.data_vars}


@pytest.mark.thorough
def test_cells_are_what_plans_say(result):
    settings = json.loads(result.attrs["settings"])
    for place, cell in cells_of(result):
        plan = cspr_jax.plan(cell_plan(settings, place, {}))
        for name in ("arcs", "tried_arcs", "verdict", "duration", "margin"):
            assert cell[name] == getattr(plan.answers, name)[0], name
        proof = plan.legs[0].answers.proof[0]
        assert cell["clearance"] == pytest.approx(float(proof.proof.high.min()), rel=0.01, abs=1e-6)


@pytest.mark.thorough
def test_cells_have_the_smallest_number_whose_motion_keeps_clear(result):
    """Of all numbers of arcs, tried one by one without the ball; samples tell how near the motions come to it."""
    kinds = set()
    for place, cell in cells_of(result):
        free = [plan_of(place, arcs) for arcs in range(1, MOST + 1)]
        near = [clearance_of(plan.rows()["position"]) if plan.feasible else -np.inf for plan in free]
        clear = [k + 1 for k, distance in enumerate(near) if distance > 0.0]
        assert cell["arcs"] == (clear[0] if clear else 0)
        assert cell["clearance"] == pytest.approx(near[cell["tried_arcs"] - 1], rel=0.01, abs=2e-5)
        first = next(k + 1 for k, plan in enumerate(free) if plan.feasible)
        flags = Verdict(int(cell["verdict"]))
        assert flags == (Verdict.FEASIBLE if clear else Verdict.OBSTACLE | Verdict.NO_ARCS)
        assert clear or cell["tried_arcs"] == first
        kinds.add((bool(clear), bool(clear) and cell["arcs"] > first))
    assert kinds == {(True, False), (True, True), (False, False)}


def test_numbers_of_arcs_are_tried_one_after_the_other():
    """To the last place one arc and two are feasible alone, and meet the ball; three keep clear."""
    axes = {"x": [-0.1], "y": [0.05], "z": [1.53, 1.62], "z0": [1.7]}
    result = cspr_jax.compute_sweep(SWEEP | {"axes": axes, "obstacle": [BEHIND]})
    for (_, cell), smallest in zip(cells_of(result), (2, 3), strict=True):
        assert (cell["arcs"], cell["verdict"]) == (smallest, 0)
    plans = [plan_of({"x": -0.1, "y": 0.05, "z": 1.62, "z0": 1.7}, arcs) for arcs in (1, 2, 3)]
    assert all(plan.feasible for plan in plans)
    near = [clearance_of(plan.rows()["position"], BEHIND) for plan in plans]
    assert max(near[:2]) < 0.0 < near[2] == pytest.approx(cell["clearance"], rel=0.01)


def test_a_run_goes_on_and_belongs_to_its_obstacles(result, tmp_path):
    sweep = SWEEP | {"run": SWEEP["run"] | {"tile": [1, 1, 2, 1]}}
    file = cspr_jax.run(sweep, tmp_path / "run")
    shards = sorted((tmp_path / "run" / "shards").iterdir())
    assert len(shards) == 4
    whole = cspr_jax.open_result(file)
    for name, values in whole.data.items():
        np.testing.assert_array_equal(values, result[name].values)
    shards[2].unlink()
    file.unlink()
    computed = []
    cspr_jax.run(sweep, tmp_path / "run", on_tile=lambda done, total: computed.append(done))
    assert computed[-1] == 8 and len(computed) <= 2
    again = cspr_jax.open_result(file)
    for name, values in whole.data.items():
        np.testing.assert_array_equal(values, again.data[name])
    with pytest.raises(CsprError, match="another"):  # of another sweep
        cspr_jax.run(sweep | {"obstacle": [BALL | {"radius": 0.021}]}, tmp_path / "run")


def test_pictures_show_the_ball(result, tmp_path):
    """Filled where the section cuts it, dashed where it does not."""
    file = cspr_jax.run(SWEEP, tmp_path / "run")
    figure = cspr_jax.plot(file)
    fills = []
    for panel in figure.axes:
        rings = [patch for patch in panel.patches if to_hex(patch.get_edgecolor()) != "#000000"]
        for patch in rings:
            ring = patch.get_path().vertices
            if np.allclose(ring.mean(0), BALL["centre"][:2], atol=0.01):
                fills.append(patch.get_fill())
                assert to_hex(patch.get_facecolor() if patch.get_fill() else patch.get_edgecolor()) == COLOUR
    assert fills == [True, False]
    words = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert {"obstacle", "obstacle beside the section"} <= set(words)


def test_surroundings_that_are_refused():
    for more, why in (
        ({"platform_box": [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.1]]}, "platform_box: must be absent in this map"),
        ({"run": {"store": ["clearance"]}, "obstacle": None}, 'clearance: must be absent without "obstacle"'),
        (
            {"map": "least-time", "trajectory": {"family": "s-curve", "from": {"position": [0.1, 0.05, 1.5]}}}
            | {"axes": {"x": [0.0], "y": [0.0], "z": [1.5]}},
            'obstacle: must be absent with family = "s-curve"',
        ),
        ({"robot": "launch-robot"}, "obstacle: must be absent, but in plans"),
    ):
        keys = {name: value for name, value in (SWEEP | more).items() if value is not None}
        with pytest.raises(ConfigError, match=why):
            cspr_jax.compute_sweep(keys)
