"""Maps and plans of platforms among obstacles: cells are what plans say, and what dense samples of motions say."""

import json
from pathlib import Path

import numpy as np
import pytest
from oracles import sampled_motion

import cspr_jax
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.schema.verdicts import Verdict

MOST = 4
START = {"position": [0.4, 0.1, 1.32], "tilt_torsion": [0.2, 0.15, -0.1], "beta_hat": -1.2}
HYPOCYCLOID = {"family": "hypocycloid", "amplitude": {"name": "effective-c3", "epsilon": 0.1}, "max_arcs": MOST}
SWINGS = {
    "schema": 1,
    "map": "poses",
    "robot": "laval-mssm",
    "axes": {"x": [-0.4, 0.1], "y": [0.3], "z": [1.35], "tilt": [0.0, 1.2], "tilt_azimuth": [0.4], "z0": [1.4]},
    "trajectory": HYPOCYCLOID | {"from": START},
}
# 6 cm and more below the points of the cables.
BOX = [[-0.15, -0.17, 0.06], [0.15, 0.09, 0.1]]
# Least clearance that contacts without obstacles have in all of these motions.
APART = 0.05


def ball(centre, radius):
    return [{"kind": "sphere", "centre": centre, "radius": radius, "name": "ball"}]


SWEEPS = {
    "cables": SWINGS
    | {"axes": SWINGS["axes"] | {"x": [-0.4, 0.1, 3.0]}, "obstacle": ball([-0.153, 0.26, 1.391], 0.056)},
    "platform": SWINGS
    | {"axes": SWINGS["axes"] | {"y": [0.3, -0.1], "tilt": [0.3]}, "obstacle": ball([-0.323, -0.112, 1.369], 0.055)}
    | {"platform_box": BOX},
    "eight cables": {
        "schema": 1,
        "map": "poses",
        "robot": "cogiro",
        "axes": {"x": [1.5, -1.2], "y": [1.0], "z": [1.6], "tilt": [0.1], "tilt_azimuth": [0.3], "torsion": [0.2]}
        | {"z0": [4.0]},
        "trajectory": HYPOCYCLOID
        | {"amplitude": {"name": "effective-c3", "epsilon": 0.3}, "max_arcs": 3}
        | {"from": {"position": [-1.5, -1.0, 1.7], "beta_hat": -1.0}, "beta_hat": "preferred"},
        "obstacle": ball([0.629, -0.296, 1.826], 0.171),
    },
}
# Kinds of cells, as `kind_of` names them.
KINDS = {
    "cables": {"free", "third", "none", "slack"},
    "platform": {"free", "next", "third", "none"},
    "eight cables": {"third", "none"},
}


def distances(rows, robot, centre, box=None):
    """Distances of a point from each cable, (n, n_cables), and from the box of the platform, (n,)."""
    turns, base = sampled_motion.rotations(rows["quaternion"]), np.array(robot["base_points"])
    arms = np.array(robot["platform_points"]) - robot.get("centre_of_mass", np.zeros(3))
    ways = rows["position"][:, None] + np.einsum("nij,kj->nki", turns, arms) - base
    along = np.clip(((centre - base) * ways).sum(2) / (ways**2).sum(2), 0.0, 1.0)
    cables = np.linalg.norm(base + along[..., None] * ways - centre, axis=2)
    if box is None:
        return cables, np.full(len(cables), np.inf)
    seen = np.einsum("nji,nj->ni", turns, centre - rows["position"])  # from the platform
    return cables, np.linalg.norm(seen - np.clip(seen, *np.array(box)), axis=1)


def clearance_of(rows, keys, robot):
    (body,) = keys["obstacle"]
    parts = distances(rows, robot, np.array(body["centre"]), keys.get("platform_box"))
    return min(part.min() for part in parts) - body["radius"]


def cells_of(result):
    for index in np.ndindex(*result["arcs"].shape):
        place = {name: float(result[name].values[i]) for name, i in zip(result["arcs"].dims, index, strict=True)}
        yield place, {name: result[name].values[index].item() for name in result.data_vars}


def kind_of(cell, first):
    if not cell["arcs"]:
        return "none" if first else "slack"
    return {0: "free", 1: "next", 2: "third"}[cell["arcs"] - first]


@pytest.mark.ci("eight cables")
@pytest.mark.thorough
@pytest.mark.parametrize("name", SWEEPS)
def test_cells_are_what_plans_and_samples_say(name):
    """Numbers of arcs are the smallest of all, tried one by one without the ball; samples say which keep clear."""
    keys = SWEEPS[name]
    stored = ["arcs", "tried_arcs", "verdict", "duration", "margin", "beta_hat", "det_margin", "cable_distance"]
    result = cspr_jax.compute_sweep(keys | {"run": {"store": [*stored, "clearance"]}})
    settings, kinds = json.loads(result.attrs["settings"]), set()
    for place, cell in cells_of(result):
        chosen = {} if "beta_hat" not in keys["trajectory"] else {"beta_hat": cell["beta_hat"]}
        leg = cspr_jax.plan(cell_plan(settings, place, chosen)).legs[0].answers
        answers, first = getattr(leg, "plain", leg), 0
        assert (cell["arcs"], cell["verdict"]) == (answers.arcs[0], answers.verdict[0])
        for column in stored[1:5] + stored[6:]:
            assert cell[column] == pytest.approx(getattr(answers, column)[0], rel=1e-6, nan_ok=True), column
        assert cell["beta_hat"] == pytest.approx(answers.beta_hat[0, 1], rel=1e-9)
        near = {}
        for arcs in range(1, keys["trajectory"]["max_arcs"] + 1):
            alone = cell_plan(settings, place, chosen | {"arcs": arcs}, samples=1501)
            del alone["obstacle"]
            plan = cspr_jax.plan(alone)
            if plan.feasible:
                near[arcs] = clearance_of(plan.rows(), keys, settings["robot"])
        first, clear = min(near, default=0), [arcs for arcs, distance in near.items() if distance > 0.0]
        kinds.add(kind_of(cell, first))
        assert cell["arcs"] == min(clear, default=0)
        if not near:
            assert np.isnan(cell["clearance"]) and Verdict(cell["verdict"]) & Verdict.SLACK_CABLE
            continue
        assert cell["tried_arcs"] == (cell["arcs"] or first)
        assert Verdict(cell["verdict"]) == (Verdict.FEASIBLE if clear else Verdict.OBSTACLE | Verdict.NO_ARCS)
        expected = near[cell["tried_arcs"]]
        assert min(cell["clearance"], APART) == pytest.approx(min(expected, APART), rel=0.02, abs=5e-5)
    assert kinds == KINDS[name]


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["platform", "eight cables"])
def test_plans_of_platforms_among_obstacles(name):
    """A motion that is feasible alone, with a ball in its way and beside it."""
    keys = SWEEPS[name]
    place = {axis: values[0] for axis, values in keys["axes"].items()}
    robot = resolve_robot(keys["robot"], Path("plan.toml"), Path()).settings
    settings = {key: value for key, value in keys.items() if key != "obstacle"} | {"robot": robot}
    alone = cell_plan(settings, place, {"beta_hat": -3.0, "arcs": 1}, samples=2001)
    free = cspr_jax.plan(alone)
    rows = free.rows()
    centre, box = rows["position"][1000] + [0.05, 0.02, 0.3 if name == "platform" else -0.3], keys.get("platform_box")
    cables, body = distances(rows, robot, centre, box)
    nearest = min(cables.min(), body.min())
    assert free.feasible
    beside = cspr_jax.plan(alone | {"obstacle": ball(centre.tolist(), 0.97 * nearest)})
    assert beside.feasible and not beside.causes[0]
    assert beside.legs[0].answers.proof[0].proof.high.min() == pytest.approx(0.03 * nearest, abs=2e-3 * nearest)
    met = cspr_jax.plan(alone | {"obstacle": ball(centre.tolist(), 1.05 * nearest)})
    (cause,) = met.causes[0]
    assert Verdict(int(met.answers.verdict[0])) == Verdict.OBSTACLE and not met.feasible
    assert (cause.criterion, cause.obstacle, cause.allowed) == ("obstacle", "ball", 0.0)
    assert cause.needed == pytest.approx(-0.05 * nearest, abs=2e-3 * nearest)
    at = np.minimum(cables.min(1), body)
    assert cause.cables == (() if body.min() < cables.min() else (int(cables.min(0).argmin()),))
    assert cause.t == pytest.approx(rows["t"][at.argmin()], abs=2e-3 * rows["t"][-1])


def test_surroundings_that_are_refused():
    for more, why in (
        ({"map": "orientations", "axes": {"x": [0.1], "y": [0.0], "z": [1.3]}}, "obstacle: must be absent in this map"),
        ({"platform_hull": True}, "platform_hull = true: must be points"),
        ({"obstacle": ball([0.0, 0.0, 1.0], -0.1)}, r"obstacle\[0\]\.radius = -0\.1: must be"),
        ({"obstacle": None, "run": {"store": ["clearance"]}}, 'clearance: must be absent without "obstacle"'),
    ):
        keys = {name: value for name, value in (SWEEPS["cables"] | more).items() if value is not None}
        with pytest.raises(ConfigError, match=why) as caught:
            cspr_jax.compute_sweep(keys)
        assert "\n" not in str(caught.value)
