"""Limits that are touched are kept, by every proof of every family; slack cables are not."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.motion.limits import touchable_limits
from cspr_jax.numerics.tolerances import TOUCHED
from cspr_jax.robots.model.limits import Limits
from cspr_jax.schema.limits import LIMITS
from cspr_jax.verification.proved_answers import proof_of

BASE = np.array([[0.22516660498395405, -0.13, 0.0], [-0.22516660498395405, -0.13, 0.0], [0.0, 0.26, 0.0]])
MASS, GRAVITY = 0.198, 9.81
SMALL = 1e-6
EXAMPLES = 6
# Columns of the reports that have the extremes of what limits bound.
COLUMNS = {row.name: row.name for row in LIMITS if not row.of_winch} | {"floor": "z_lowest"}
FLAGS = {row.name: row.flag.text for row in LIMITS if not row.of_winch}
FOUR = {"name": "four", "base_points": [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]], "mass": 1.0}
PROTOTYPE = {"name": "three", "base_points": BASE.tolist(), "mass": MASS}
PULLEYS = PROTOTYPE | {"name": "small pulleys", "pulley_radius": 1e-6}
SWING = {"z0": 1.4, "pose": [{"rest": True}, {"position": [0.3, 0.2, 1.5]}]}
WAY = [{"position": [0.0, 0.0, 1.4]}, {"position": [0.1, 0.05, 1.5]}]
VIA = [
    {"position": [0.0, 0.0, 1.4]},
    {"position": [0.1, 0.05, 1.5], "time": 2.0},
    {"position": [0, 0.1, 1.45], "time": 4},
]
COGIRO = [{"position": [-2.5, 1.5, 1.0]}, {"position": [-0.5, 2.2, 1.6], "time": 3.0}]
CIRCLE = {"centre": [0.0, 0.0, 1.4], "radius": 0.2, "frequency": 2.5}
# Motions whose time no limit stretches, and limits that they have besides.
MOTIONS = {
    "hypocycloid-standard": {"robot": "prototype", **SWING},
    "over pulleys": {"family": "hypocycloid-standard", "robot": PULLEYS, **SWING},
    "redundant swing": {"family": "hypocycloid-standard", "robot": FOUR, **SWING},
    "transition": {"robot": "prototype", **SWING, "pose": [{"rest": True}, {"position": [0.4, 0.2, 1.5]}]},
    "hypocycloid": {"robot": "laval-mssm", **SWING, "pose": [{"rest": True}, {"position": [0.3, 0.2, 1.4]}]},
    "redundant platform": {
        "family": "hypocycloid",
        "robot": "cogiro",
        "z0": 3.0,
        "pose": [{"rest": True}, {"position": [0.3, 0.2, 2.5]}],
    },
    "ellipse": {"robot": "prototype", "ellipse": CIRCLE, "turns": 1.0, "pose": [{}, {}]},
    "spline": {"robot": "prototype", "pose": VIA},
    "redundant spline": {"family": "spline", "robot": "cogiro", "tension_max": 5000.0, "pose": COGIRO},
    "bezier": {"robot": "prototype", "pose": [WAY[0], WAY[1] | {"duration": 3.0}]},
    "redundant bezier": {"family": "bezier", "robot": FOUR, "pose": [WAY[0], WAY[1] | {"duration": 3.0}]},
}
REDUNDANT = [name for name in MOTIONS if name.startswith("redundant")]
QUICK = ("spline",)
THOROUGH = pytest.mark.thorough


def families(names):
    return [name if name in QUICK else pytest.param(name, marks=THOROUGH) for name in names]


def beside(name: str, value: float, robot, fraction: float) -> float:
    """A limit that is tighter than a value by a share of it, of the floor by one of the robot's size."""
    if name == "floor":
        base = np.asarray(robot.base_points)
        size = np.linalg.norm(base - base.mean(0), axis=1).max()
        return value - fraction * size if robot.z_axis == "down" else value + fraction * size
    return value * (1.0 + fraction if name == "tension_min" else 1.0 - fraction)


def planned(keys: dict, **limits):
    """A plan whose limits are all set, but for tensions of redundant cables, so that kernels are compiled once."""
    return cspr_jax.plan(keys | {"schema": 1, "limits": keys.get("limits", {}) | limits})


def with_arcs(keys: dict, bare) -> dict:
    """The poses of a plan with the number of arcs that it has found, if its family has one."""
    arcs = int(bare.answers.tried_arcs[0])
    return {"pose": [keys["pose"][0], keys["pose"][1] | {"arcs": arcs}]} if arcs else {}


def check_touched(keys: dict, names: Sequence[str], checked: Sequence[str]) -> bool:
    """A motion reaches limits, to rounding; a millionth beyond one it is refused, by this limit alone.

    False if it is not feasible without any.
    """
    bare = planned(keys)
    if not bare.feasible:
        return False
    robot = bare.robot_file
    segments, keys = bare.to_dict()["segments"], keys | with_arcs(keys, bare)
    values = {}
    for limit in names:
        each = [segment[COLUMNS[limit]] for segment in segments]
        lowest = limit == "tension_min" or (limit == "floor" and robot.z_axis == "up")
        values[limit] = min(each) if lowest else max(each)
    loose = {limit: beside(limit, value, robot, -0.1) for limit, value in values.items()}
    assert planned(keys, **loose).feasible
    for limit in checked:
        value = values[limit]
        for fraction in (-SMALL, 0.0):
            found = planned(keys, **loose | {limit: beside(limit, value, robot, fraction)})
            assert found.feasible, (limit, fraction, [row["cause"] for row in found.to_dict()["segments"]])
        refused = planned(keys, **loose | {limit: beside(limit, value, robot, SMALL)}).to_dict()["segments"]
        flags = {row["verdict"].removeprefix("no_arcs+").removesuffix("+no_arcs") for row in refused}
        assert flags - {"feasible"} == {FLAGS[limit]}, (limit, flags)
    return True


def limits_of(name: str) -> list[str]:
    """Limits that one number of a motion's report reaches: not the tensions of redundant cables."""
    return [limit for limit in COLUMNS if name not in REDUNDANT or not limit.startswith("tension")]


@THOROUGH
@pytest.mark.parametrize("name", families(MOTIONS))
def test_motions_that_reach_a_limit_are_feasible(name):
    """Each limit of each family."""
    assert check_touched({"family": name, **MOTIONS[name]}, *[limits_of(name)] * 2)


def moved(keys: dict, rng: np.random.Generator) -> dict:
    """A plan with other positions, ellipses and spools nearby."""

    def nearby(points):
        return (np.asarray(points, float) + rng.uniform(-0.03, 0.03, np.shape(points))).tolist()

    poses = [pose | ({"position": nearby(pose["position"])} if "position" in pose else {}) for pose in keys["pose"]]
    changed = keys | {"pose": poses}
    robot = PROTOTYPE if keys["robot"] == "prototype" else keys["robot"]
    if isinstance(robot, dict):
        level = np.array([1.0, 1.0, 0.0])
        spools = np.asarray(robot["base_points"]) + level * rng.uniform(-0.03, 0.03, (len(robot["base_points"]), 3))
        # About their centroid, below which P0 is.
        changed["robot"] = robot | {"base_points": (spools - spools.mean(0)).tolist(), "mass": rng.uniform(0.1, 2.0)}
    if "ellipse" in keys:
        sizes = {"radius": rng.uniform(0.1, 0.25), "frequency": rng.uniform(2.0, 2.8)}
        changed["ellipse"] = keys["ellipse"] | {"centre": nearby(keys["ellipse"]["centre"])} | sizes
    return changed


@pytest.mark.ci("spline", "ellipse", "bezier", "hypocycloid-standard", "redundant bezier")
@THOROUGH
@pytest.mark.parametrize("name", MOTIONS)
@given(seed=st.integers(0, 2**16), data=st.data())
@settings(max_examples=EXAMPLES)
def test_random_motions_that_reach_a_limit_are_feasible(name, seed, data):
    """Of other robots, between other positions, at limits that are drawn."""
    limit = data.draw(st.sampled_from(limits_of(name)))
    keys = moved({"family": name, **MOTIONS[name]}, np.random.default_rng(seed))
    assume(check_touched(keys, limits_of(name), [limit]))


@pytest.mark.ci("s-curve", "quintic")
@THOROUGH
@pytest.mark.parametrize("family", ["s-curve", "quintic", "path", "free"])
@given(seed=st.integers(0, 2**16))
@settings(max_examples=EXAMPLES)
def test_the_fastest_motions_to_the_floor(family, seed):
    """Of families that choose their time, from above to a drawn target: at a floor that it is on, not below it."""
    rng = np.random.default_rng(seed)
    start, target = (rng.uniform([-0.05, -0.05, low], [0.05, 0.05, low + 0.15]) for low in (1.2, 1.36))
    keys = {"family": family, "robot": PROTOTYPE, "pose": [{"position": start}, {"position": target}]}
    keys |= {"max_acceleration": 1.0} if family == "s-curve" else {}
    robot = cspr_jax.load_robot("prototype")
    for fraction in (-SMALL, 0.0):
        found = planned(keys, tension_max=3.0, floor=beside("floor", target[2], robot, fraction))
        assert found.feasible, (fraction, found.to_dict()["segments"][0]["cause"])
    floor = beside("floor", target[2], robot, SMALL)
    if family == "free":
        with pytest.raises(ConfigError, match="floor"):
            planned(keys, tension_max=3.0, floor=floor)
    else:
        (refused,) = planned(keys, tension_max=3.0, floor=floor).to_dict()["segments"]
        assert FLAGS["floor"] in refused["verdict"].split("+")


@pytest.mark.parametrize("name", [name for name in REDUNDANT if "platform" not in name])
@THOROUGH
def test_the_least_tension_of_redundant_cables(name):
    """All tensions together reach the smallest tension: the largest distance that they can have from it is zero."""
    keys = {"family": name, **MOTIONS[name]}
    bare = planned(keys, tension_min=1.0)
    (margin,) = {row["margin"] for row in bare.to_dict()["segments"]}
    unit, keys = bare.to_dict()["segments"][0]["margin_unit"], keys | with_arcs(keys, bare)
    robot = bare.problem.robot
    least = 1.0 + margin * (1.0 if unit == "N" else float(robot.mass) * GRAVITY / robot.n_cables)
    for fraction, verdict in ((-SMALL, True), (0.0, True), (SMALL, False)):
        assert planned(keys, tension_min=least * (1.0 + fraction)).feasible == verdict


def test_general_proofs_agree_with_those_of_swings():
    """Of one swing to the floor: at it, a millionth above and below."""
    keys = {"family": "hypocycloid-standard", **MOTIONS["hypocycloid-standard"]}
    robot = cspr_jax.load_robot("prototype")
    for fraction, feasible in ((-SMALL, True), (0.0, True), (SMALL, False)):
        found = planned(keys, floor=beside("floor", 1.5, robot, fraction))
        proof = proof_of(found.problem, found.legs[0].motions[0])
        assert found.feasible == feasible == proof.is_feasible == (not proof.broken.any())


@THOROUGH
def test_the_two_runs_of_a_swing_to_the_floor():
    """By the proof of swings, and, since pulleys of a micrometre are there, by that of any motion."""
    swing = {"family": "hypocycloid-standard", "z0": 1.7, "limits": {"floor": 2.2}}
    poses = {"pose": [{"rest": True}, {"position": [0.3, 0.2, 2.2]}]}
    ours, others = (planned(swing | poses | {"robot": robot}) for robot in ("prototype", PULLEYS))
    assert ours.feasible and others.feasible
    rows = [found.to_dict()["segments"][0] for found in (ours, others)]
    for column in ("limit_margin", "tension_min", "tension_max", "duration"):
        assert rows[0][column] == pytest.approx(rows[1][column], rel=1e-4, abs=1e-12)


def tension_of_cables(spread: float, duration: float) -> np.ndarray:
    """Tensions of a quintic way up along z, rest to rest, by a solver of three equations."""
    s = np.linspace(0.0, 1.0, 20001)
    height = 1.4 - spread * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    second_derivative = -spread * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / duration**2
    rays = BASE[None] - np.stack([0.0 * s, 0.0 * s, height], axis=1)[:, None]
    units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    force = MASS * np.stack([0.0 * s, 0.0 * s, second_derivative - GRAVITY], axis=1)
    return np.linalg.solve(np.swapaxes(units, 1, 2), force[..., None])[..., 0]


@pytest.mark.parametrize("fraction", [-SMALL, 0.0, SMALL])
def test_cables_that_just_lose_their_tension_are_slack(fraction):
    """On a way up whose braking is a free fall at one time: its largest downward acceleration is that of gravity."""
    spread = 0.3
    duration = np.sqrt(10.0 / np.sqrt(3.0) * spread / GRAVITY)
    assert abs(tension_of_cables(spread, duration).min()) < 1e-6
    poses = [
        {"position": [0.0, 0.0, 1.4]},
        {"position": [0.0, 0.0, 1.4 - spread], "time": float(duration) * (1.0 - fraction)},
    ]
    found = planned({"family": "spline", "interpolation": "quintic", "robot": "prototype", "pose": poses})
    verdict = found.to_dict()["segments"][0]["verdict"]
    # Of the motion itself rounding decides, and exact arithmetic tells which way: it is never undecided.
    assert verdict in {-SMALL: ["feasible"], 0.0: ["feasible", "slack_cable"], SMALL: ["slack_cable"]}[fraction]
    assert (verdict == "feasible") == found.feasible


def test_what_may_be_missed():
    """A share of each limit, of the floor one of the robot's size; nothing of a smallest tension of zero."""
    robot = dataclasses.replace(cspr_jax.load_robot("prototype"))
    low, most = np.array([0.0, 0.1, 0.2]), np.full(3, 7.0)
    wider = touchable_limits(
        robot, Limits(tension_min=low, tension_max=most, floor=np.array(2.2), speed_max=np.array(3.0))
    )
    np.testing.assert_allclose(wider.tension_min - low, -TOUCHED * low, rtol=1e-6, atol=0.0)
    np.testing.assert_allclose(wider.tension_max - most, TOUCHED * most, rtol=1e-6)
    assert wider.floor - 2.2 == pytest.approx(TOUCHED * 0.26, rel=1e-6)
    assert wider.speed_max / 3.0 - 1.0 == pytest.approx(TOUCHED, rel=1e-6)
    assert wider.cable_speed_max is None and 100.0 * TOUCHED <= SMALL


def test_poses_at_rest_that_touch_limits_are_inside():
    """The tension of a mass that hangs below the middle of three spools, by its closed form."""
    depth, weight = 1.4, MASS * GRAVITY
    pull = weight / 3.0 * np.hypot(0.26, depth) / depth
    places, still = np.array([[0.0, 0.0, depth]]), np.zeros(3)
    robot = cspr_jax.load_robot("prototype")
    for fraction, is_in in ((-SMALL, True), (0.0, True), (SMALL, False)):
        for limits in ({"tension_max": pull * (1.0 - fraction)}, {"tension_min": pull * (1.0 + fraction)}):
            found = cspr_jax.workspace(robot, places, condition="wrench-feasible", **limits)
            assert (found.verdict[0] == 0) == is_in, (fraction, limits)
            sets = cspr_jax.available_accelerations(robot, places, **limits)
            assert (sets.verdict(still)[0] == 0) == is_in, (fraction, limits)
