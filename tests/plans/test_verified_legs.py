"""Families that know neither obstacles nor pulleys: their motions are proved with both, here beside dense samples."""

import numpy as np
import pytest
from oracles.pulleys import length
from support.commands import cspr

import cspr_jax
from cspr_jax.schema.verdicts import Verdict

SPOOLS = [[0.22516660498395405, -0.13, 0.0], [-0.22516660498395405, -0.13, 0.0], [0.0, 0.26, 0.0]]
ROBOT = {"name": "three", "mass": 0.198, "z_axis": "down", "base_points": SPOOLS}
FROM, TO = [0.1, 0.05, 1.5], [-0.1, 0.05, 1.5]
SWING = {"family": "hypocycloid-standard", "z0": 1.7, "pose": [{"position": FROM}, {"position": TO}]}
TRANSITION = {"family": "transition", "z0": 1.7, "pose": [{"rest": True}, {"position": FROM}]}
LINE = {"family": "s-curve", "pose": [{"position": FROM}, {"position": TO}]}
BEZIER = {"family": "bezier", "pose": [{"position": FROM}, {"position": TO, "duration": 2.0}]}
# On the way of the swing of one arc.
PLACE = [0.0, 0.04, 1.542]


def planned(keys, radius=None, place=PLACE, **more):
    """A plan among a ball, or without one."""
    balls = [] if radius is None else [{"kind": "sphere", "centre": place, "radius": radius, "name": "ball"}]
    return cspr_jax.plan({"schema": 1, "robot": ROBOT} | keys | ({"obstacle": balls} if balls else {}) | more)


def clearances(plan, place, radius):
    """Distances of the ball from the cables at all rows; the effector is their common end."""
    ends = plan.rows()["position"][:, None]
    way = ends - np.array(SPOOLS)
    along = np.clip(((place - np.array(SPOOLS)) * way).sum(2) / (way**2).sum(2), 0.0, 1.0)
    return np.linalg.norm(np.array(SPOOLS) + along[..., None] * way - place, axis=2) - radius


@pytest.mark.thorough
def test_swings_take_the_smallest_number_of_arcs_beside_an_obstacle():
    free, beside = planned(SWING), planned(SWING, 0.01)
    assert (free.answers.arcs[0], beside.answers.arcs[0]) == (1, 2) and beside.feasible
    assert clearances(free, PLACE, 0.01).min() < 0.0 < clearances(beside, PLACE, 0.01).min()
    two = planned(SWING | {"pose": [{"position": FROM}, {"position": TO, "arcs": 2}]})
    assert beside.answers.margin[0] == two.answers.margin[0]  # all else is as without the ball
    assert beside.to_dict()["segments"][0]["failing"] == []


@pytest.mark.thorough
def test_swings_that_all_touch_an_obstacle():
    """The motion that is shown is the one without obstacles; its cause and intervals are those of the proof."""
    plan = planned(SWING, 0.06, max_arcs=3, samples=4001)
    segment = plan.to_dict()["segments"][0]
    assert (segment["arcs"], segment["tried_arcs"], segment["verdict"]) == (None, 1, "no_arcs+obstacle")
    apart, (cause,) = clearances(plan, PLACE, 0.06), plan.causes[0]
    assert (cause.criterion, cause.obstacle, cause.allowed) == ("obstacle", "ball", 0.0)
    assert cause.needed == pytest.approx(apart.min(), rel=0.01)
    assert cause.cables == (int(np.unravel_index(apart.argmin(), apart.shape)[1]),)
    times = plan.rows()["t"]
    failing = np.array(segment["failing"])
    inside = ((failing[:, :1] <= times) & (times <= failing[:, 1:])).any(0)
    step, broken = times[1], (apart < 0.0).any(1)
    wrong = times[inside != broken]
    assert broken.any() and (np.abs(wrong[:, None] - failing.ravel()).min(1, initial=np.inf) <= step).all()
    given = planned(SWING | {"pose": [{"position": FROM}, {"position": TO, "arcs": 1}]}, 0.06)
    assert Verdict(int(given.answers.verdict[0])) == Verdict.OBSTACLE  # nobody asked for another number


def test_transitions_and_lines_among_obstacles():
    """Lines in the least time have no room left in their own criteria, and are proved all the same."""
    place = [0.05, 0.025, 1.6]
    wall = planned(TRANSITION, 0.2, place, max_arcs=4)
    segment = wall.to_dict()["segments"][0]
    assert (segment["oscillations"], segment["verdict"]) == (None, "no_arcs+obstacle")
    assert planned(TRANSITION, 0.001, [0.2, 0.2, 1.6]).answers.arcs[0] == 2
    for keys in (LINE, BEZIER):
        plain, near = planned(keys), planned(keys, 0.01, [0.0, 0.05, 1.515])
        assert near.feasible and near.answers.margin[0] == plain.answers.margin[0]
        met = planned(keys, 0.02, [0.0, 0.05, 1.515])
        assert Verdict(int(met.answers.verdict[0])) == Verdict.OBSTACLE and met.answers.arcs[0] == 0
        assert met.causes[0][0].needed == pytest.approx(clearances(met, [0.0, 0.05, 1.515], 0.02).min(), rel=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("keys", [SWING, LINE, BEZIER])
def test_motions_over_pulleys(keys):
    """The margin is the smallest tension of the cables over their pulleys, whatever it is without them."""
    plan = planned(keys, robot=ROBOT | {"pulley_radius": 0.02}, samples=2001)
    columns = plan.rows()
    robot = cspr_jax.point_mass_robot(SPOOLS, mass=0.198, z_axis="down")
    robot = cspr_jax.with_cables(robot, pulley_radius=0.02)
    parts = list(
        zip(*(np.asarray(x) for x in (robot.base_points, robot.pulleys.axes, robot.pulleys.radius)), strict=True)
    )
    tensions = []
    for place, pull in zip(columns["position"][::20], columns["acceleration"][::20], strict=True):
        ways = -np.array([length(*part, place)[1] for part in parts]).T
        tensions.append(np.linalg.solve(ways, 0.198 * (pull - [0.0, 0.0, 9.81])))
    segment = plan.to_dict()["segments"][0]
    assert (segment["margin_unit"], segment["verdict"] == "feasible") == ("N", np.min(tensions) > 0.0)
    assert segment["margin"] == pytest.approx(np.min(tensions), rel=0.02)
    assert segment["margin_bound"] <= columns["tension"].min() <= segment["margin"] + 1e-3
    if keys is SWING:
        assert plan.answers.arcs[0] == 2  # one arc is feasible without pulleys alone
        assert not segment["fewer_arcs_undecided"]


def worst_clearance(plan, place, radius, size):
    """Least distance of the ball from a cable whose spool, `size` off its place, is as bad as can be."""
    ends, base = plan.rows()["position"][:, None], np.array(SPOOLS)
    # Towards the ball and across the cable.
    ways = (ends - base) / np.linalg.norm(ends - base, axis=2, keepdims=True)
    across = place - base - ((place - base) * ways).sum(2)[..., None] * ways
    moved = base + size * across / np.linalg.norm(across, axis=2, keepdims=True)
    along = np.clip(((place - moved) * (ends - moved)).sum(2) / ((ends - moved) ** 2).sum(2), 0.0, 1.0)
    return (np.linalg.norm(moved + along[..., None] * (ends - moved) - place, axis=2) - radius).min()


@pytest.mark.thorough
@pytest.mark.parametrize("keys", [SWING, TRANSITION])
def test_robots_within_an_uncertainty_keep_clear(keys):
    """Of a ball beside a cable, halfway up, of which displaced spools come nearer than they make cables slack."""
    place, size = [0.11, -0.1, 0.75], 0.004
    off = {"limits": {"uncertainty": {"spool_positions": size}}}
    plain = planned(keys, samples=2001, **off)
    radius = clearances(plain, place, 0.006).min()  # 6 mm from the cable as planned
    beside = planned(keys, radius, place, samples=2001, **off)
    proved, refuted = beside.answers.tolerated[0], beside.answers.not_tolerated[0]
    assert beside.feasible and 1.0 < proved < refuted < 0.7 * plain.answers.tolerated[0]
    assert worst_clearance(beside, place, radius, size * proved) > 0.0
    assert worst_clearance(beside, place, radius, 1.02 * size * refuted) < 0.0 and proved > 0.4 * refuted
    # Random ones among these robots are no worse.
    rng = np.random.default_rng(0)
    for _ in range(20):
        way = rng.normal(size=(3, 3))
        moved = np.array(SPOOLS) + proved * size * way / np.linalg.norm(way, axis=1, keepdims=True)
        ends = beside.rows()["position"][:, None]
        along = np.clip(((place - moved) * (ends - moved)).sum(2) / ((ends - moved) ** 2).sum(2), 0.0, 1.0)
        assert np.linalg.norm(moved + along[..., None] * (ends - moved) - place, axis=2).min() > radius
    fixed = keys | {"pose": [*keys["pose"][:-1], keys["pose"][-1] | {"arcs": int(plain.answers.arcs[0])}]}
    wide = {"limits": {"uncertainty": {"spool_positions": 1.05 * refuted * size}}}
    met = planned(fixed, radius, place, **wide)
    assert Verdict(int(met.answers.verdict[0])) == Verdict.UNCERTAINTY and not met.feasible
    (cause,) = met.causes[0]
    assert (cause.criterion, cause.needed) == ("uncertainty", 1.0) and cause.allowed < 1.0


@pytest.mark.thorough
def test_an_uncertain_mass_moves_no_cable():
    off = {"limits": {"uncertainty": {"mass_factor": 1.01}}}
    plain, beside = planned(SWING, **off), planned(SWING, 0.01, [0.11, -0.1, 0.75], **off)
    assert beside.feasible and beside.answers.tolerated[0] == plain.answers.tolerated[0] > 1.0


def test_surroundings_that_are_refused(tmp_path):
    (tmp_path / "plan.toml").write_text(
        'schema = 1\nrobot = "prototype"\nfamily = "hypocycloid-standard"\nz0 = 1.7\n'
        "platform_box = [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.1]]\n"
        "[[pose]]\nrest = true\n[[pose]]\nposition = [0.1, 0.05, 1.5]\n"
    )
    code, out, err = cspr("plan", tmp_path / "plan.toml")
    assert (code, out, err.count("\n")) == (
        2,
        "",
        1,
    ) and "platform_box: must be absent: a point mass has no shape" in err
