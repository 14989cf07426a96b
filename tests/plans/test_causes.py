"""What stands between a motion and feasible: the limit without which there is one, with its numbers."""

import h5py
import jax
import numpy as np
import pytest
from support.commands import cspr, plan, planned
from swings.test_decide import LIMITS, answered, limited, problem

import cspr_jax
from cspr_jax.robots.cables import cable_motion
from cspr_jax.schema.verdicts import Verdict

LAB = """schema = 1
z0 = 1.5
max_arcs = 25
[robot]
name = "laboratory"
base_points = [[0.05, 0.10, 2.85], [3.40, 0.22, 3.10], [1.60, 2.95, 2.60]]
mass = 1.2
z_axis = "up"
tension_min = 0.5
tension_max = 26.0
SPEED
[limits]
floor = 0.3
[[pose]]
position = [0.4, 0.6, 1.2]
[[pose]]
position = [3.3, 1.2, 1.3]
[[pose]]
position = [1.7, 2.6, 1.35]
"""
FAST = LAB.replace("SPEED", "cable_speed_max = 2.5")
# Of each limit a value that no motion here reaches, and its flag.
FAR = {
    "tension_min": (0.0, Verdict.SLACK_CABLE),
    "tension_max": (1e9, Verdict.OVER_TENSION),
    "floor": (1e5, Verdict.BELOW_FLOOR),
    "cable_length_max": (1e5, Verdict.CABLE_TOO_LONG),
    "cable_speed_max": (1e9, Verdict.CABLE_TOO_FAST),
    "cable_acceleration_max": (1e9, Verdict.CABLE_OVER_ACCELERATION),
}
ALL = Verdict(sum(flag.value for _, flag in FAR.values()))


@pytest.mark.thorough
def test_a_segment_that_is_only_too_fast_is_not_called_slack(tmp_path):
    """It is shown as it is without the limit, which it needs to be higher: by how much, where and when."""
    free = planned(tmp_path, LAB.replace("SPEED", ""))["segments"]
    bound = planned(tmp_path, FAST, code=1)["segments"]
    for before, after, needed in zip(free, bound, (3.07, 3.31), strict=True):
        assert before["cause"] is None and before["verdict"] == "feasible"
        assert (after["arcs"], after["tried_arcs"], after["verdict"]) == (
            None,
            before["arcs"],
            "cable_too_fast+no_arcs",
        )
        assert after["margin"] == pytest.approx(before["margin"]) and after["margin_bound"] > 0.0
        (cause,) = after["cause"]
        assert (cause["criterion"], cause["allowed"], cause["unit"]) == ("cable_too_fast", 2.5, "m/s")
        assert cause["needed"] == pytest.approx(before["cable_speed_max"]) == pytest.approx(needed, abs=5e-3)
    path = tmp_path / "motion.h5"
    code, out, _ = plan(tmp_path, FAST, "--anyway", "-o", path)
    assert code == 1
    with h5py.File(path) as file:
        time, rate, starts = file["t"][...], np.abs(file["rate"][...]), file["segment_start"][...]
        for i, segment in enumerate(bound):
            (cause,) = segment["cause"]
            row = np.abs(time - starts[i] - cause["t"]).argmin()
            assert rate[row, cause["cable"]] == pytest.approx(cause["needed"], rel=1e-3)
            assert file["segment_cause"][i] == Verdict.CABLE_TOO_FAST.value
            assert file["segment_cause_cable"][i] == cause["cable"] + 1
            assert file["segment_needed"][i] == cause["needed"] and file["segment_allowed"][i] == 2.5
            words = f"cable {cause['cable'] + 1} needs {cause['needed']:.3g} m/s at t = {cause['t']:.2f} s, 2.5 allowed"
            assert f"to {i + 1}: {words}" in out
    page = tmp_path / "page.html"
    assert cspr("report", path, "-o", page)[0] == 0
    assert page.read_text().count(" m/s at t = ") == 2


@pytest.mark.thorough
def test_searches_from_python_say_the_same():
    base = [[0.05, 0.10, 2.85], [3.40, 0.22, 3.10], [1.60, 2.95, 2.60]]
    robot, limits = cspr_jax.point_mass(base, mass=1.2, z_axis="up"), cspr_jax.Limits(cable_speed_max=np.full(3, 2.5))
    answers = cspr_jax.minimum_arcs(robot, [[3.3, 1.2, 1.3], [2.6, 1.4, 1.4]], z0=1.5, limits=limits, max_arcs=25)
    rate = jax.vmap(lambda motion, tau: cable_motion(robot, motion.state(tau))[1])
    for i, own in enumerate(answers.causes()):
        assert len(own) == (answers.arcs[i] == 0)
        for cause in own:
            tau = np.full(2, cause.t / answers.duration[i])
            assert np.abs(rate(answers.motions(), tau)[i, cause.cables[0]]) == pytest.approx(cause.needed, rel=1e-9)
            assert cause.needed > cause.allowed == 2.5
    assert (answers.arcs == 0).any()


def dropped(cases, flags):
    """The cases without the limits of some flags, given all the same, so that kernels compile once."""
    changed = []
    for case in cases:
        limits = {
            name: np.full(np.shape(case.limits[name]), value) if flag & flags else case.limits[name]
            for name, (value, flag) in FAR.items()
        }
        changed.append(type(case)(*(getattr(case, f) for f in case.__dataclass_fields__ if f != "limits"), limits))
    return changed


def check_causes(seed, count):
    """Of one robot and its segments under all limits: how many of each kind there were."""
    rng, kinds = np.random.default_rng(seed), dict.fromkeys(("alone", "several", "slack"), 0)
    mine, cases = problem(rng, "quintic", count)
    cases = limited(rng, cases, LIMITS)

    def search(flags):
        return answered(mine, dropped(cases, flags), np.zeros(3), "down")

    found, known = search(Verdict(0)), {}
    for i in np.flatnonzero((found.arcs == 0) & (found.verdict != Verdict.UNDECIDED.value)):
        named = Verdict(int(found.verdict[i])) & ~Verdict.NO_ARCS
        for flags in (named, *(ALL & ~flag for flag in named), ALL & ~Verdict.SLACK_CABLE):
            if flags not in known:
                known[flags] = search(flags)
        is_slack = bool(named & (Verdict.SLACK_CABLE | Verdict.ABOVE_SPOOLS))
        if len(list(named)) == 1 and not is_slack:
            kinds["alone"] += 1
            without = known[named]
            assert without.arcs[i] == found.tried_arcs[i], (seed, i, named)
            assert without.margin[i] == pytest.approx(found.margin[i]) and found.margin_bound[i] > 0.0
            assert found.limit_margin[i] < 0.0
        elif not is_slack:
            kinds["several"] += 1
            alone = [known[ALL & ~flag].arcs[i] == 0 for flag in named]
            # Those that every number of arcs breaks; else those that the candidate breaks which breaks the fewest.
            assert all(alone) or known[named].arcs[i] == found.tried_arcs[i], (seed, i, named)
            assert sum(alone) < 2 or all(alone), (seed, i, named)
        elif named == Verdict.SLACK_CABLE:
            kinds["slack"] += 1
            # Of the limits alone tension_min may be the reason: then no other one is.
            others = [flag for _, flag in FAR.values() if flag != Verdict.SLACK_CABLE]
            for flag in others:
                if flag not in known:
                    known[flag] = search(flag)
                assert known[flag].arcs[i] == 0, (seed, i, flag)
    return kinds


@pytest.mark.thorough
def test_what_is_named_alone_stands_alone_in_the_way():
    kinds = check_causes(4, 40)
    assert kinds["alone"] >= 5 and kinds["several"] >= 5


@pytest.mark.soak
@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=pytest.mark.thorough if seed == 5 else pytest.mark.soak) for seed in range(5, 13)]
)
def test_what_is_named_alone_stands_alone_in_the_way_more(seed):
    check_causes(seed, 100)


def compared(keys, limits, flag):
    """Segments of a plan with limits out of reach and within it, of which the last one is only refused by one."""
    far = {name: FAR[name][0] for name in limits}
    free, bound = cspr_jax.plan(keys | far).to_dict()["segments"], cspr_jax.plan(keys | limits)
    (cause,) = bound.causes[-1]
    assert cause.criterion == flag
    return free[-1], bound.to_dict()["segments"][-1], cause


POSES = [{"rest": True}, {"position": [0.9, -0.7, 1.2]}]
MSSM = {"schema": 1, "robot": "laval-mssm", "family": "hypocycloid", "z0": 1.4, "max_arcs": 3, "pose": POSES}
MSSM |= {"amplitude": {"name": "effective-c3", "epsilon": 0.1}}


@pytest.mark.ci("limits1-tension_min-slack_cable")
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("limits", "key", "flag"),
    [
        ({"cable_speed_max": 1.2}, "cable_speed_max", "cable_too_fast"),
        pytest.param({"tension_min": 0.3}, "tension_min", "slack_cable", marks=pytest.mark.thorough),
        pytest.param({"tension_max": 3.0}, "tension_max", "over_tension", marks=pytest.mark.thorough),
    ],
)
def test_a_platform_that_one_limit_refuses(limits, key, flag):
    """It was shown with the number of arcs of the largest tension, and with all that this one breaks."""
    free, bound, cause = compared(MSSM, limits, flag)
    assert bound["verdict"].split("+") == sorted(["no_arcs", flag], key=bound["verdict"].find)
    assert bound["tried_arcs"] == free["arcs"] and bound["arcs"] is None
    assert bound["margin"] == pytest.approx(free["margin"], rel=1e-6)
    assert cause.needed == pytest.approx(free[key], rel=1e-6) and cause.allowed == limits[key]
    assert 0.0 < cause.t < bound["duration"] and len(cause.cables) == 1


@pytest.mark.thorough
def test_causes_of_a_platform_are_those_of_the_proof_of_any_motion():
    """Each has the time, the cable and the numbers of the instant at which the motion breaks it most."""
    plan = cspr_jax.plan(MSSM | {"cable_speed_max": 1.2})
    (leg,), (segment,) = plan.legs, plan.to_dict()["segments"]
    (cause,), (motion,) = plan.causes[0], leg.motions
    tau = np.linspace(0.0, 1.0, 20001)
    speeds = np.abs(jax.vmap(lambda t: cable_motion(plan.problem.robot, motion.state(t))[1])(tau))
    assert cause.needed == pytest.approx(speeds.max(), rel=1e-6)
    assert cause.cables == (int(np.argmax(speeds.max(0))),)
    too_fast = tau[(speeds > 1.2).any(1)] * segment["duration"]
    (first, *_), (*_, last) = segment["failing"][0], segment["failing"][-1]
    assert (first, last) == pytest.approx((too_fast[0], too_fast[-1]), abs=2e-4 * segment["duration"])
    assert list(segment["failing_by_criterion"]) == ["cable_too_fast"]


@pytest.mark.thorough
def test_a_platform_that_is_slack_names_limits_that_no_number_of_arcs_keeps():
    """One arc is slow enough, but no number of arcs up to three keeps the largest tension."""
    poses = [{"rest": True}, {"position": [1.1, -0.9, 0.9]}]
    keys = MSSM | {"pose": poses, "max_arcs": 3, "cable_speed_max": 2.0, "tension_max": 3.9}
    (segment,) = cspr_jax.plan(keys).to_dict()["segments"]
    assert segment["verdict"] == "slack_cable+over_tension+no_arcs" and segment["cable_speed_max"] > 2.0


@pytest.mark.quick("limits0-cable_too_fast")
@pytest.mark.parametrize(
    ("limits", "flag"), [({"cable_speed_max": 1.5}, "cable_too_fast"), ({"cable_length_max": 2.5}, "cable_too_long")]
)
def test_a_transition_that_one_limit_refuses(limits, flag):
    poses = [{"position": [1.2, -0.9, 2.1]}, {"rest": True}]
    keys = {"schema": 1, "robot": "transition-prototype", "family": "transition", "amplitude": "A1", "z0": 1.6}
    free, bound, cause = compared(keys | {"pose": poses}, limits, flag)
    assert bound["tried_oscillations"] == free["oscillations"] and bound["verdict"] == f"{flag}+no_arcs"
    assert cause.needed == pytest.approx(free[next(iter(limits))])


@pytest.mark.thorough
def test_a_bezier_segment_of_the_least_duration_is_taut_if_some_duration_is():
    """One that broke the limit by less, with slack cables, was shown."""
    poses = [{"position": place} for place in ([0, 0, -0.5], [-0.05, -0.05, -0.7], [0.1, 0.15, -0.8])]
    keys = {"schema": 1, "robot": "launch-robot", "family": "bezier", "pose": poses}
    _, bound, cause = compared(keys, {"cable_speed_max": 0.05}, "cable_too_fast")
    assert bound["verdict"] == "cable_too_fast" and bound["margin"] > 0.0
    assert cause.needed == pytest.approx(bound["cable_speed_max"]) and cause.needed > 0.05


SPOOLS = [[0, 0, 10], [10, 0, 10], [5, 9, 10]]
LINE = {"schema": 1, "robot": {"name": "x", "mass": 10.0, "z_axis": "up", "base_points": SPOOLS}}
LINE |= {
    "family": "s-curve",
    "max_acceleration": 5.0,
    "pose": [{"position": [1.2, 0.5, 8.5]}, {"position": [8.8, 0.5, 8.5]}],
}


@pytest.mark.thorough
def test_a_line_that_no_slow_motion_follows_is_not_called_too_fast():
    """At its ends each spool carries most of the weight, halfway two of them pull against each other."""
    bound = cspr_jax.plan(LINE | {"tension_max": 130.0, "cable_speed_max": 0.5})
    (segment,), ((cause,),) = bound.to_dict()["segments"], bound.causes
    assert segment["verdict"] == cause.criterion == "over_tension"
    rays = np.linspace([1.2, 0.5, 8.5], [8.8, 0.5, 8.5], 1001)[:, None] - np.array(SPOOLS)
    units = (rays / np.linalg.norm(rays, axis=2, keepdims=True)).transpose(0, 2, 1)
    pulls = np.linalg.solve(units, np.tile([[0.0], [0.0], [-98.1]], (1001, 1, 1)))
    assert cause.needed == pytest.approx(pulls.max(), rel=1e-4) and segment["cause"][0]["t"] is None


def test_rest_at_an_end_names_all_limits_that_it_breaks_and_no_others():
    """A tension below the smallest one was called above the largest one as well; limits on places were left out."""
    both = LINE | {"tension_min": 20.0, "tension_max": 900.0, "floor": 8.6, "cable_length_max": 8.0}
    (segment,) = cspr_jax.plan(both | {"pose": [{"position": [1.2, 0.05, 8.5]}, LINE["pose"][1]]}).to_dict()["segments"]
    assert segment["verdict"] == "slack_cable+below_floor+cable_too_long"
    criteria = {cause["criterion"]: cause for cause in segment["cause"]}
    assert criteria["below_floor"]["needed"] == pytest.approx(8.5) and criteria["below_floor"]["allowed"] == 8.6
    assert criteria["slack_cable"]["needed"] < 20.0 == criteria["slack_cable"]["allowed"]
    assert criteria["slack_cable"]["t"] == 0.0
    (above,) = cspr_jax.plan(both | {"pose": [LINE["pose"][0], {"position": [5.0, 3.0, 11.0]}]}).to_dict()["segments"]
    assert above["verdict"] == "slack_cable+above_spools+below_floor+cable_too_long"
    # The spools come first; tensions, which have no bound at their plane, have no numbers.
    assert [cause["criterion"] for cause in above["cause"]][::3] == ["above_spools", "slack_cable"]
    assert above["cause"][0]["needed"] == pytest.approx(-1.0) and above["cause"][-1]["needed"] is None


@pytest.mark.thorough
def test_more_cables_than_needed_name_what_refuses_them():
    """Cables that are too fast; tensions that no choice keeps within their limits, with the largest margin there is."""
    poses = [{"rest": True}, {"position": [1.5, 1.0, 1.6], "tilt_torsion": [0.3, 0.1, 0.2]}]
    keys = {"schema": 1, "robot": "cogiro", "family": "hypocycloid", "z0": 4.0, "samples": 50, "max_arcs": 2}
    keys |= {"amplitude": {"name": "effective-c3", "epsilon": 0.3}, "pose": poses}
    free, bound, cause = compared(keys, {"cable_speed_max": 1.0}, "cable_too_fast")
    assert bound["tried_arcs"] == free["arcs"] and cause.needed == pytest.approx(free["cable_speed_max"])
    tight = cspr_jax.plan(keys | {"tension_min": 300.0})
    ((cause,),), (segment,) = tight.causes, tight.to_dict()["segments"]
    assert cause.criterion == "wrench_infeasible" and 0.0 <= cause.t <= segment["duration"]
    assert cause.needed == pytest.approx(segment["tension_margin"]) and cause.allowed == 0.0 > cause.needed
