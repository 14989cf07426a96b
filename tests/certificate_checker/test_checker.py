"""The checker against an oracle in floating point, and against files with mistakes."""

import copy
import json
import subprocess
import sys
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from cspr_jax.certificate_checker.checking import check
from cspr_jax.certificate_checker.reading import NotACertificate, checksum, read
from tests.certificate_checker.cases import MASS, SPOOLS, all_cases, all_limits, hexapod, planar, point_mass, quintic
from tests.certificate_checker.oracle import (
    Oracle,
    cut,
    feasible,
    infeasible,
    piece,
    rotation,
    statement,
    text,
    verify,
)

TIMES = np.linspace(0, 1, 201)
CASES = all_cases()
SMALLEST = {name: oracle.smallest(TIMES) for name, (_, oracle, _) in CASES.items()}


def below(name, slack):
    return slack * 0.999 if name == "singular" else slack - 1e-3 * max(1, abs(slack))


def beyond(name, slack):
    return slack * 1.0001 if name == "singular" else slack + 2e-6 * max(1, abs(slack))


@pytest.mark.parametrize("case", CASES)
def test_bounds_below_the_oracle_hold(case):
    content, _, pieces = CASES[case]
    bounds = {name: below(name, slack) for name, slack in SMALLEST[case].items()}
    assert min(bounds.values()) > 0
    assert verify(feasible(content, bounds, cut(pieces, 16)))
    assert verify(feasible(content, bounds, cut(pieces, 1)))  # parts replace blocks


@pytest.mark.parametrize("case", CASES)
def test_each_bound_beyond_the_oracle_is_refused(case):
    content, _, pieces = CASES[case]
    for name in SMALLEST[case]:
        bounds = {key: below(key, slack) for key, slack in SMALLEST[case].items()}
        bounds[name] = beyond(name, SMALLEST[case][name])
        assert not verify(feasible(content, bounds, cut(pieces, 16))), name


@pytest.mark.parametrize("case", CASES)
def test_failures(case):
    """Limits that the oracle sees exceeded at a sample fail there; those that it sees kept do not."""
    content, oracle, _ = CASES[case]
    slacks = oracle.slacks(0.3)
    for name, slack in slacks.items():
        flag, _, cable = name.partition(":")
        key = {"slack_cable": "tension_min", "above_spools": "", "singular": ""}.get(flag, KEYS.get(flag, ""))
        if not key:
            assert not verify(infeasible(content, {"criterion": name, "time": "0.3"})), name
            continue
        sign = -1 if key == "tension_min" else 1
        limit = oracle.limits.get(key, [0.0] * 9)
        edge = (limit[int(cable)] if cable else limit) - sign * slack  # the limit at which the slack is zero
        for factor, fails in ((1 - sign * 1e-4, True), (1 + sign * 1e-4, False)):
            changed = copy.deepcopy(content)
            moved = (
                edge * factor if not cable else [edge * factor if i == int(cable) else x for i, x in enumerate(limit)]
            )
            changed["limits"] |= {key: text(moved[: len(oracle.base)] if cable else moved), "touched": "0"}
            assert verify(infeasible(changed, {"criterion": name, "time": "0.3"})) is fails, (name, edge)


KEYS = {
    "over_tension": "tension_max",
    "below_floor": "floor",
    "lowest_below_floor": "floor",
    "cable_too_long": "cable_length_max",
    "cable_too_fast": "cable_speed_max",
    "cable_over_acceleration": "cable_acceleration_max",
    "too_fast": "speed_max",
    "over_acceleration": "acceleration_max",
    "motor_too_fast": "motor_speed_max",
    "motor_over_torque": "motor_torque_max",
    "motor_over_power": "motor_power_max",
    "motor_over_load": "motor_load_max",
}


def test_touched_limits():
    """A slack of -h fails as little as one of zero, and bounds may go down to -h, not below."""
    content, _, pieces = planar()
    content["limits"] = {"tension_max": ["1e3", "1e3"], "floor": "1.5", "touched": "0.1"}  # h of the floor: 0.2
    bounds = {"slack_cable:0": 0, "slack_cable:1": 0, "over_tension:0": 0, "over_tension:1": 0, "above_spools": 0}
    assert verify(feasible(content, bounds | {"below_floor": -0.1001}, cut(pieces, 8)))
    assert not verify(feasible(content, bounds | {"below_floor": -0.0999}, cut(pieces, 8)))
    assert verify(feasible(content, bounds | {"below_floor": "-1/5"}, cut(pieces, 8)))  # exactly -h
    with pytest.raises(NotACertificate, match="below_floor"):
        verify(feasible(content, bounds | {"below_floor": -0.20001}, cut(pieces, 8)))
    assert not verify(infeasible(content, {"criterion": "below_floor", "time": "1"}))
    content["limits"]["touched"] = "0.04"
    assert verify(infeasible(content, {"criterion": "below_floor", "time": "1"}))


def rest(x, duration=1.0, **more):
    return [piece(0, duration, [["poly", [float(c)]] for c in x], [0, 1, 2], **more)]


def test_rest():
    """Standing still, norms and motors at zero speed have slacks too, and both frictions count."""
    robot = MASS | {"base_points": SPOOLS, "forces": [0, 1, 2]}
    robot["winches"] = CASES["motors"][1].robot["winches"]
    limits = all_limits(3, True)
    oracle = Oracle(robot, limits, lambda t: np.array([0.1, 0.2, 1.5]))
    pieces = rest([0.1, 0.2, 1.5])
    slacks = oracle.slacks(0.5)
    bounds = {name: slack - 1e-6 for name, slack in slacks.items()}
    assert verify(feasible(statement(robot, limits, pieces), bounds, cut(pieces, 1)))
    for name in bounds:
        wrong = bounds | {name: slacks[name] + 1e-6}
        assert not verify(feasible(statement(robot, limits, pieces), wrong, cut(pieces, 1))), name


def test_feed():
    content, oracle, pieces = point_mass()
    fastest = max(np.linalg.norm(np.diff([oracle.x(t) for t in (s - 1e-5, s + 1e-5)], axis=0)) / 2e-5 for s in TIMES)
    bounds = {name: below(name, slack) for name, slack in SMALLEST["point mass"].items()}
    content["limits"]["touched"] = "0"
    for limit, holds in ((fastest + 1e-3, True), (fastest - 1e-3, False)):
        pieces[0]["speed_max"] = text(limit)
        content["motion"]["pieces"] = pieces
        assert verify(feasible(content, bounds | {"over_feed": 0}, cut(pieces, 8))) is holds
        assert verify(infeasible(content, {"criterion": "over_feed", "time": "1/2"})) is not holds


def redundant():
    """A point mass on four cables, with the tensions of least norm about a middle as witnesses."""
    steps, x = quintic([-0.3, 0.1, 1.5], [0.4, 0.2, 1.9])
    robot = MASS | {"base_points": [*SPOOLS, [-1.5, 1.5, 0.05]], "forces": [0, 1, 2]}
    limits = {"tension_min": [2.0] * 4, "tension_max": [60.0] * 4, "touched": 0.05}
    oracle, pieces = Oracle(robot, limits, x), [piece(0, 1, steps, [0, 1, 2])]
    blocks = cut(pieces, 20)

    def tensions(t):
        a, w = oracle.balance(t)
        return 25 + np.linalg.pinv(a) @ (w - a @ np.full(4, 25.0))

    for block in blocks:
        ends = [tensions(float(Fraction(block[key]))) for key in ("start", "end")]
        width = float(Fraction(block["end"]) - Fraction(block["start"]))
        block["tensions"] = text([np.round((ends[0] + ends[1]) / 2, 3), np.round((ends[1] - ends[0]) / width, 3)])
    return statement(robot, limits, pieces), oracle, pieces, blocks, tensions


def best_slack(oracle, t, low=2.0, high=60.0):
    """The largest slack of tensions, along the null space of one dimension."""
    a, w = oracle.balance(t)
    f, null = np.linalg.pinv(a) @ w, np.linalg.svd(a)[2][-1]
    return max(min((f + s * null - low).min(), (high - f - s * null).min()) for s in np.linspace(-200, 200, 40001))


def test_redundant_cables():
    content, oracle, _, blocks, tensions = redundant()
    samples = [tensions(t) for t in TIMES]
    slack = min(min(f.min() - 2, 60 - f.max()) for f in samples)
    assert slack > 0.5
    assert verify(feasible(content, {"wrench_infeasible": slack - 0.05}, blocks))
    best = min(best_slack(oracle, t) for t in TIMES[::20])
    assert not verify(feasible(content, {"wrench_infeasible": best + 0.1}, blocks))
    wrong = copy.deepcopy(blocks)
    wrong[7]["tensions"][0][1] = "-300"  # the exact tensions are near no witness
    assert not verify(feasible(content, {"wrench_infeasible": 0}, wrong))


def test_redundant_failure():
    """A multiplier shows that no tensions within the limits balance the wrench."""
    content, oracle, _, _, _ = redundant()
    a, w = oracle.balance(0.5)
    up = [0, 0, -1.0]  # all cables together bear too little
    failure = {"criterion": "wrench_infeasible", "time": "0.5", "wrench": text(up)}
    assert not verify(infeasible(content, failure))
    strength = w @ up / (np.array(up) @ a).sum()
    for factor, fails in ((0.999, True), (1.001, False)):
        content["limits"] |= {"tension_max": text([strength * factor] * 4), "tension_min": ["0"] * 4}
        assert verify(infeasible(content, failure)) is fails
    del content["limits"]["tension_max"]
    assert not verify(infeasible(content, failure))
    assert not verify(infeasible(content, failure | {"wrench": ["0", "0", "0"]}))
    content["limits"] |= {"tension_min": text([strength * 1.001] * 4), "touched": "0"}
    assert not verify(infeasible(content, failure))
    assert verify(infeasible(content, failure | {"wrench": text([0, 0, 1.0])}))
    content["limits"]["touched"] = "0.01"  # wider than the lack
    assert not verify(infeasible(content, failure | {"wrench": text([0, 0, 1.0])}))


def contact_case(pairs, directions, bound, **scene):
    """The platform on six cables in a scene."""
    content, _, pieces = hexapod()
    content["limits"], content["scene"] = {}, {"pairs": pairs, **scene}
    bounds = {f"contact:{k}": bound for k in range(len(pairs))}
    bounds |= {f"slack_cable:{i}": 0 for i in range(6)} | {"singular": 0, "above_spools": 0}
    return feasible(content, bounds, cut(pieces, 16, directions=[text(d) for d in directions]))


BALL = {"points": [["0", "0", "3"]], "radius": "0.2"}


def test_contact_of_cable_and_sphere():
    """A cable of a point mass passes a sphere at a distance that the oracle knows."""
    content, oracle, pieces = point_mass()
    content["limits"] = {}
    ball, spool = np.array([-1.0, -1.0, 1.9]), np.array(SPOOLS[0])

    def distance(t):
        way = oracle.x(t) - spool
        return np.linalg.norm(ball - spool - way * np.clip((ball - spool) @ way / (way @ way), 0, 1)) - 0.12

    pair = [{"cable": 0, "radius": "0.02"}, {"points": [text(ball)], "radius": "0.1"}]
    content["scene"] = {"pairs": [pair]}
    blocks = cut(pieces, 32)
    for block in blocks:
        middle = float(Fraction(block["start"]) + Fraction(block["end"])) / 2
        way = oracle.x(middle) - spool
        near = ball - spool - way * ((ball - spool) @ way / (way @ way))
        block["directions"] = [text(np.round(near, 4))]
    smallest = min(distance(t) for t in TIMES)
    base = {f"slack_cable:{i}": 0 for i in range(3)} | {"above_spools": 0}
    assert smallest > 0.1
    assert verify(feasible(content, base | {"contact:0": smallest - 0.02}, blocks))
    assert not verify(feasible(content, base | {"contact:0": smallest + 1e-4}, blocks))
    swapped = [
        block | {"directions": [text([-float(Fraction(c)) for c in block["directions"][0]])]} for block in blocks
    ]
    assert not verify(feasible(content, base | {"contact:0": 0}, swapped))
    content["scene"] = {"pairs": [pair[::-1]]}
    assert verify(feasible(content, base | {"contact:0": smallest - 0.02}, swapped))
    check_touching(content, oracle, spool)


def check_touching(content, oracle, spool):
    """A sphere about a point of the cable touches, one further away does not."""
    x = oracle.x(0.5)
    side = np.cross(x - spool, [0, 0, 1.0])
    for gap, touches in ((0.119, True), (0.121, False)):
        ball = spool + 0.75 * (x - spool) + side / np.linalg.norm(side) * gap
        pair = [{"cable": 0, "radius": "0.02"}, {"points": [text(ball), text(ball)], "radius": "0.1"}]
        content["scene"] = {"pairs": [pair]}
        failure = {"criterion": "contact:0", "time": "0.5", "points": [["1/4", "3/4"], ["1/2", "1/2"]]}
        assert verify(infeasible(content, failure)) is touches
        # The part next to the platform is left out: 3/4 of the shortened cable is elsewhere.
        pair[0]["leave"] = "1"
        assert not verify(infeasible(content, failure))
        # Nothing is left of the cable: no point beyond its spool counts.
        pair[0]["leave"] = "100"
        beyond_spool = x + (spool - x) / np.linalg.norm(spool - x) * 100
        pair[1] = {"points": [text(beyond_spool)], "radius": "0.1"}
        assert not verify(infeasible(content, failure | {"points": [["0", "1"], ["1"]]}))


def test_contact_of_platform():
    """Body, cone, shortened cable and spool with directions that turn with the platform."""
    _, oracle, _ = hexapod()
    corners = [[x, y, 0.1] for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    floor = {"points": [["-9", "-9", "2.8"], ["9", "-9", "2.8"], ["0", "9", "2.8"]], "radius": "0"}
    ball = {"points": [["0", "0", "3"]], "radius": "0.2"}
    body, scene = {"body": True, "radius": "0.01"}, {"body": {"corners": text(corners)}}
    lengths = [rotation(oracle.q(t)).T @ (np.array([0, 0, 3.0]) - oracle.x(t)) for t in TIMES]
    smallest = min(v[2] - 0.1 for v in lengths) - 0.21
    assert verify(contact_case([[body, ball]], [[0, 0, 2.0]], smallest - 1e-3, **scene))
    assert not verify(contact_case([[body, ball]], [[0, 0, 2.0]], smallest + 1e-4, **scene))
    assert not verify(contact_case([[body, floor]], [[0, 0, 1.0]], 0, **scene))  # the tilted plane cuts the wide floor
    # A cone that spreads below the platform, and one that opens towards the ball.
    flat = {"cone": [["1", "0", "0"], ["0", "1", "0"]], "corner": ["0", "0", "0.1"]}
    assert verify(contact_case([[flat, ball]], [[0, 0, 1.0]], smallest + 0.009))
    assert verify(contact_case([[ball, flat]], [[0, 0, -1.0]], smallest + 0.009))
    steep = flat | {"cone": [["1", "0", "1e-9"]]}
    assert not verify(contact_case([[steep, ball]], [[0, 0, 1.0]], 0))
    assert not verify(contact_case([[ball, steep]], [[0, 0, -1.0]], 0))
    assert verify(contact_case([[steep | {"cone": [["1", "0", "-1e-9"]]}, ball]], [[0, 0, 1.0]], 0))
    # Cables leave upwards, more so without the part next to the platform.
    whole = {"cable": 0, "radius": "0.01"}
    assert verify(contact_case([[whole | {"leave": "0.5"}, flat]], [[0, 0, 1.0]], 0.3))
    assert not verify(contact_case([[whole, flat]], [[0, 0, 1.0]], 0.3))
    assert not verify(contact_case([[whole | {"leave": "50"}, flat]], [[0, 0, 1.0]], 0.3))  # nothing is left of it
    assert verify(contact_case([[{"spool": 1, "radius": "1"}, ball]], [[0, 0, 1.0]], 1))


def test_cone_failure():
    content, oracle, _ = hexapod()
    content["limits"] = {}
    target = oracle.x(0.5) + rotation(oracle.q(0.5)) @ np.array([2.0, 3.0, 0.1])
    cone = {"cone": [["1", "0", "0"], ["0", "1", "0"]], "corner": ["0", "0", "0.1"]}
    content["scene"] = {"pairs": [[cone, {"points": [text(target)], "radius": "1e-6"}]]}
    failure = {"criterion": "contact:0", "time": "0.5", "points": [["2", "3"], ["1"]]}
    assert verify(infeasible(content, failure))
    assert not verify(infeasible(content, failure | {"points": [["2", "2.9"], ["1"]]}))
    with pytest.raises(NotACertificate, match=r"points\[0\]\[0\]"):
        verify(infeasible(content, failure | {"points": [["-2", "3"], ["1"]]}))


def test_failure_of_bodies_at_rest():
    """Whether fixed bodies and spools touch, for which no series is needed."""
    content, _, _ = point_mass()
    content["limits"] = {}
    spool, ball = {"spool": 0, "radius": "0.5"}, {"points": [text(SPOOLS[0]), ["-2", "-1.2", "0.9"]], "radius": "0.25"}
    other, far = {"points": [["-2", "-1.2", "1.3"]], "radius": "0.25"}, {"spool": 1, "radius": "3.6"}
    for pair, points, touches in [
        ([spool, ball], [["1"], ["0.26", "0.74"]], True),  # 0.74 m apart
        ([spool, ball], [["1"], ["0.24", "0.76"]], False),
        ([ball, other], [["0.09", "0.91"], ["1"]], True),  # 0.49 m apart
        ([ball, other], [["0.11", "0.89"], ["1"]], False),
        ([spool, far], [["1"], ["1"]], False),  # 4.106 m apart
        ([spool, far | {"radius": "3.61"}], [["1"], ["1"]], True),
    ]:
        content["scene"] = {"pairs": [pair]}
        failure = {"criterion": "contact:0", "time": "0.5", "points": points}
        assert verify(infeasible(content, failure)) is touches, (pair, points)


def test_leaving_point_of_pulley():
    """The cable runs from where it leaves its pulley, and there the body of its spool is."""
    content, oracle, _ = point_mass(pulleys=True)
    content["limits"] = {}
    unit, length = oracle.cables(0.5)[0][0], np.sqrt(free_length_squared(oracle, 0.5))
    weight = Fraction(float(1 / length))
    near = {"points": [text(oracle.x(0.5) + unit)], "radius": "1e-9"}
    content["scene"] = {"pairs": [[{"cable": 0, "radius": "0"}, near]]}
    failure = {"criterion": "contact:0", "time": "0.5", "points": [[str(weight), str(1 - weight)], ["1"]]}
    assert verify(infeasible(content, failure))
    leaving = {"points": [text(oracle.x(0.5) + unit * length)], "radius": "1e-9"}
    content["scene"] = {"pairs": [[{"spool": 0, "radius": "0"}, leaving]]}
    assert verify(infeasible(content, failure | {"points": [["1"], ["1"]]}))


def free_length_squared(oracle, t):
    """From the tangent: distance of the pulley's centre less the radius, in squares."""
    pulley = oracle.robot["pulleys"]
    k = np.array(pulley["axes"][0]) / np.linalg.norm(pulley["axes"][0])
    v = oracle.x(t) - np.array(SPOOLS[0])
    side = v - (v @ k) * k
    centre = np.array(SPOOLS[0]) + pulley["radius"][0] * side / np.linalg.norm(side)
    return np.sum((oracle.x(t) - centre) ** 2) - pulley["radius"][0] ** 2


def simple(**limits):
    """A planar mass at rest, feasible with bounds of zero."""
    robot = MASS | {"base_points": [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "forces": [0, 2]}
    pieces = rest([0.1, 0, 1.5])
    bounds = {"slack_cable:0": 0, "slack_cable:1": 0, "above_spools": 0}
    return feasible(statement(robot, limits, pieces), bounds, cut(pieces, 2))


def test_short_blocks_and_high_precision():
    content = simple()
    edges = ["0", "1e-30", "2e-30", "1/2", "1"]
    content["blocks"] = [{"start": a, "end": b} for a, b in pairwise(edges)]
    assert verify(content)
    content["motion"]["pieces"][0]["program"][2] = ["poly", ["1.5", "0", "1", "1"]]  # the slack grows from 1.5
    content["bounds"]["above_spools"] = str(Fraction(3, 2) - Fraction(1, 10**45))  # below 128 bits
    assert verify(content)
    content["bounds"]["above_spools"] = "1.5"
    assert not verify(content)


@pytest.mark.parametrize(
    "steps",
    [
        [["poly", ["0", "1"]], ["/", 0, 0]],  # 0 / 0 at the start, cancelled by series
        [["poly", ["-1/3", "1"]], ["*", 0, 0], ["/", 1, 0]],
        [["poly", ["-1/3", "1"]], ["*", 0, 0], ["sqrt", 1], ["*", 2, 0]],
        [["poly", ["-1/3", "1"]], ["sqrt", 0]],
        [["poly", ["0.5", "1"]], ["acos", 0]],
        [["poly", ["0"]], ["poly", ["1", "1"]], ["/", 1, 0], ["*", 2, 0]],
    ],
)
def test_steps_that_are_not_defined_are_refused(steps):
    """Also where position does not use them."""
    content = simple()
    shift = len(steps)
    entry = content["motion"]["pieces"][0]
    entry["program"] = steps + entry["program"]
    entry["position"] = [k + shift for k in entry["position"]]
    assert not verify(content)
    assert not verify(
        infeasible(
            {k: v for k, v in content.items() if k not in ("bounds", "blocks")},
            {"criterion": "slack_cable:0", "time": "1/3"},
        )
    )


def test_rotation_that_is_not_defined_is_refused():
    content, _, pieces = CASES["hexapod"]
    content = copy.deepcopy(content)
    content["limits"] = {}
    bounds = {f"slack_cable:{i}": 0 for i in range(6)} | {"singular": 0, "above_spools": 0}
    assert verify(feasible(content, bounds, cut(pieces, 16)))
    content["motion"]["pieces"][0]["program"] += [["poly", ["-1/3", "1"]]]
    last = len(content["motion"]["pieces"][0]["program"]) - 1
    content["motion"]["pieces"][0]["quaternion"] = [last, last, last, last]
    assert not verify(feasible(content, bounds, cut(pieces, 16)))


def two_pieces(second, **limits):
    """The simple file with a second half that has its own steps."""
    content = simple(**limits)
    steps = content["motion"]["pieces"][0]["program"]
    first = {"start": "0", "end": "1/2", "program": steps, "position": [0, 1, 2]}
    content["motion"]["pieces"] = [first, first | {"start": "1/2", "end": "1", "program": [*steps[:2], second]}]
    return content


def without_proof(content):
    return {key: value for key, value in content.items() if key not in ("bounds", "blocks")}


def test_pieces_meet_one_sided():
    """At the time between two pieces a failure may belong to either, a feasible motion to both."""
    content = two_pieces(["poly", ["1.5", "0", "1"]], acceleration_max=1.0)
    failing = without_proof(content)
    for time, fails in (("1/2", True), ("0.49", False), ("0.51", True)):
        assert verify(infeasible(failing, {"criterion": "over_acceleration", "time": time})) is fails
    assert not verify(content | {"bounds": content["bounds"] | {"over_acceleration": "0"}})


@pytest.mark.parametrize(
    ("second", "meets"),
    [
        (["1.5"], True),
        (["1.500000009"], True),
        (["1.500000011"], False),
        (["1.499999989"], False),
        (["2"], False),
        (["1.5", "0.9e-6"], True),
        (["1.5", "-0.9e-6"], True),
        (["1.5", "1.1e-6"], False),
        (["1.5", "-1"], False),
        (["1.5", "0", "3"], True),  # accelerations may jump
    ],
)
def test_jumps_of_position_and_velocity(second, meets):
    """Whatever the verdict, pieces meet within the tolerances."""
    content = two_pieces(["poly", second], floor=1.0)
    failing = infeasible(without_proof(content), {"criterion": "below_floor", "time": "0"})
    assert verify(failing) is meets
    del content["limits"]["floor"]
    assert verify(content) is meets
    assert ("do not meet" in check(content | {"sha256": ""}).message) is not meets


@pytest.mark.parametrize(("turn", "meets"), [("0", True), ("4e-9", True), ("6e-9", False), ("-1", False)])
def test_jumps_of_rotation(turn, meets):
    """A quaternion of any norm may follow, minus the one before too."""
    content, _, _ = hexapod()
    content["limits"] = {}
    whole = content["motion"]["pieces"][0]
    still = [["poly", [step[1][0]]] for step in whole["program"][:3]] + [["poly", [c]] for c in ("1", "0", "0", "0")]
    turned = still[:3] + [["poly", [c]] for c in ("-3", "0", "0", str(-3 * Fraction(turn)))]
    whole["program"] = still
    content["motion"]["pieces"] = [whole | {"end": "1/2"}, whole | {"start": "1/2", "program": turned}]
    bounds = {f"slack_cable:{i}": -0.0 for i in range(6)} | {"singular": 0, "above_spools": 0}
    finding = check(feasible(content, bounds, cut(content["motion"]["pieces"], 2)) | {"sha256": ""})
    assert ("do not meet" in finding.message) is not meets
    assert finding.holds or turn == "-1" or not meets


@pytest.mark.parametrize(("rate", "meets"), [("0", True), ("2e-7", True), ("1e-6", False), ("0.1", False)])
def test_jumps_of_angular_velocity(rate, meets):
    """A platform does not begin to turn from one time to the next."""
    content, _, _ = hexapod()
    content["limits"] = {}
    piece = content["motion"]["pieces"][0]
    still = [["poly", [step[1][0]]] for step in piece["program"][:3]] + [["poly", [c]] for c in ("1", "0", "0", "0")]
    turning = [*still[:6], ["poly", ["0", rate]]]
    content["motion"]["pieces"] = [
        piece | {"end": "1/2", "program": still},
        piece | {"start": "1/2", "program": turning},
    ]
    bounds = {f"slack_cable:{i}": -0.0 for i in range(6)} | {"singular": 0, "above_spools": 0}
    finding = check(feasible(content, bounds, cut(content["motion"]["pieces"], 2)) | {"sha256": ""})
    assert ("do not meet" in finding.message) is not meets


def test_motions_that_are_not_defined_are_not_infeasible():
    """A step that is not defined at another time than that of the failure makes the motion none."""
    content = without_proof(simple(floor=1.0))
    failure = {"criterion": "below_floor", "time": "0"}
    assert verify(infeasible(content, failure))
    content["motion"]["pieces"][0]["program"] += [["poly", ["-1/3", "1"]], ["/", 0, 3]]
    assert not verify(infeasible(content, failure))


def test_messages():
    """One line says verdict, counts or failures, and the limits, `touched` too."""
    content = simple(tension_max=[1e3, 2e3])
    content["bounds"] |= {"over_tension:0": "0", "over_tension:1": "0"}
    message = check(content | {"sha256": ""}).message
    assert "feasible, 5 criteria hold on 2 blocks" in message
    assert "tension_min 0, " in message
    assert "tension_max 1000 to 2000" in message
    assert message.endswith("touched 0")
    failing = infeasible(without_proof(simple(floor=1.0, touched=0.01)), {"criterion": "below_floor", "time": "1/4"})
    message = check(failing | {"sha256": ""}).message
    assert "infeasible, fails: below_floor at 0.25 s" in message
    assert message.endswith("touched 0.01")
    unreal = infeasible(without_proof(simple(floor=3.0)), {"criterion": "below_floor", "time": "1/4"})
    assert "below_floor at 0.25 s is not shown" in check(unreal | {"sha256": ""}).message


def test_all_failures_must_be_real():
    content = without_proof(simple(floor=1.0))
    real, unreal = ({"criterion": name, "time": "0"} for name in ("below_floor", "slack_cable:0"))
    assert verify(infeasible(content, real))
    assert not verify(infeasible(content, real, unreal))


def changed(path, value):
    """The simple file with the value at a path replaced, or left out if it is None."""
    content = simple(tension_max=[1e3, 1e3])
    content["bounds"] |= {"over_tension:0": "0", "over_tension:1": "0"}
    place = content
    for key in path[:-1]:
        place = place[key]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return content


PIECE = ("motion", "pieces", 0)
DEEP = json.loads("[" * 400 + "]" * 400)
MISTAKES = [
    (("format",), "cspr"),
    (("version",), True),
    (("version",), 2),
    (("version",), "1"),
    (("verdict",), "true"),
    (("verdict",), ["feasible"]),
    (("surprise",), "1"),
    (("failures",), []),
    (("name",), 1),
    (("robot",), []),
    (("robot", "mass"), "-5"),
    (("robot", "mass"), "0"),
    (("robot", "mass"), 5),
    (("robot", "mass"), "5/0"),
    (("robot", "mass"), "NaN"),
    (("robot", "mass"), "inf"),
    (("robot", "mass"), " 5"),
    (("robot", "mass"), "5\n"),
    (("robot", "mass"), "5_0"),
    (("robot", "mass"), "٥"),
    (("robot", "mass"), "1e999999999"),
    (("robot", "mass"), "1" * 4001),
    (("robot", "mass"), "5/-1"),
    (("robot", "mass"), ""),
    (("robot", "mass"), True),
    (("robot", "mass"), DEEP),
    (("robot", "gravity"), "-9.81"),
    (("robot", "forces"), [2, 0]),
    (("robot", "forces"), [0, 0]),
    (("robot", "forces"), [0, 3]),
    (("robot", "forces"), [0, -1]),
    (("robot", "forces"), [False, 2]),
    (("robot", "forces"), [0, 1, 2]),
    (("robot", "forces"), []),
    (("robot", "moments"), [1]),
    (("robot", "inertia"), [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "1"]]),
    (("robot", "joint_arm"), ["0", "0", "1"]),
    (("robot", "platform_points"), [["1", "0", "0"], ["0", "1", "0"]]),
    (("robot", "base_points"), []),
    (("robot", "base_points"), [["0", "0", "0"], ["1", "0"]]),
    (("robot", "base_points"), {"0": 1}),
    (("robot", "pulleys"), {"radius": ["1", "1"]}),
    (("robot", "pulleys"), {"radius": ["-1", "1"], "axes": [["0", "0", "1"]] * 2}),
    (("robot", "pulleys"), {"radius": ["1", "1"], "axes": [["0", "0", "0"]] * 2}),
    (("robot", "winches"), {}),
    (("limits", "tension_max"), ["1"]),
    (("limits", "tension_min"), ["-1", "-1"]),
    (("limits", "touched"), "-1"),
    (("limits", "speed"), "1"),
    (("limits", "motor_speed_max"), ["1", "1"]),
    (("scene",), {"pairs": [[]]}),
    (("scene",), []),
    (("scene",), {"pairs": [[{"cable": 2, "radius": "0"}, {"spool": 0, "radius": "0"}]]}),
    (("scene",), {"pairs": [], "body": {"corners": [["0", "0", "0"]]}}),
    (("scene",), {"pairs": [[{"body": True, "radius": "0"}, {"spool": 0, "radius": "0"}]]}),
    (("scene",), {"pairs": [[{"points": [], "radius": "0"}, {"spool": 0, "radius": "0"}]]}),
    (("scene",), {"pairs": [[{"cable": 0, "spool": 0, "radius": "0"}, {"spool": 0, "radius": "0"}]]}),
    (("scene",), {"pairs": [[{"cable": 0, "radius": "-1"}, {"spool": 0, "radius": "0"}]]}),
    (("scene",), {"pairs": [[{"cable": 0, "radius": "1"}, {"spool": 0, "radius": "0"}]]}),  # no directions
    (("motion", "duration"), "0"),
    (("motion", "duration"), "2"),
    (("motion", "pieces"), []),
    ((*PIECE, "start"), "0.1"),
    ((*PIECE, "end"), "0.9"),
    ((*PIECE, "end"), "-1"),
    ((*PIECE, "speed_max"), "-1"),
    ((*PIECE, "speed_max"), "1"),  # no bound for it
    ((*PIECE, "quaternion"), [0, 0, 0, 0]),
    ((*PIECE, "position"), [0, 1]),
    ((*PIECE, "position"), [0, 1, 3]),
    ((*PIECE, "position"), [0, 1, -1]),
    ((*PIECE, "position"), [0, 1, True]),
    ((*PIECE, "position"), [0, 1, 2.0]),
    ((*PIECE, "program"), "poly"),
    ((*PIECE, "program", 1), ["sin", 1]),
    ((*PIECE, "program", 1), ["sin", 2]),
    ((*PIECE, "program", 1), ["sin", -1]),
    ((*PIECE, "program", 1), ["sin"]),
    ((*PIECE, "program", 1), ["sin", 0, 0]),
    ((*PIECE, "program", 1), ["exp", 0]),
    ((*PIECE, "program", 1), [["sin"], 0]),
    ((*PIECE, "program", 1), ["__class__", 0]),
    ((*PIECE, "program", 1), []),
    ((*PIECE, "program", 1), "sin"),
    ((*PIECE, "program", 1), ["poly", []]),
    ((*PIECE, "program", 1), ["poly", "12"]),
    ((*PIECE, "program", 1), ["poly", [1]]),
    (("bounds", "slack_cable:0"), "-1e-9"),
    (("bounds", "contact:0"), "0"),
    (("bounds",), []),
    (("blocks",), []),
    (("blocks", 0, "end"), "0.6"),
    (("blocks", 1, "start"), "0.6"),
    (("blocks", 1, "end"), "2"),
    (("blocks", 0, "tensions"), [["0", "0"], ["0", "0"]]),
    (("blocks", 0, "directions"), []),
    (("blocks", 0), {"start": "0", "end": "1/2", "extra": "0"}),
    *((path, None) for path in [("robot",), ("limits",), ("motion",), ("bounds",), ("blocks",), ("version",)]),
    *((("robot", key), None) for key in ("mass", "gravity", "forces", "moments", "base_points")),
    *(((*PIECE, key), None) for key in ("start", "end", "program", "position")),
    (("bounds", "slack_cable:0"), None),
    (("blocks", 0, "start"), None),
    (("blocks", 1), None),
    (("motion", "duration"), None),
]


def test_the_file_of_the_mistakes_is_right():
    assert verify(changed(("name",), "a name"))


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: f"{mistake[0]}-{str(mistake[1])[:30]}")
def test_mistakes(mistake):
    content = changed(*mistake)
    with pytest.raises(NotACertificate) as caught:
        check(content | {"sha256": checksum(content)})
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


def redundant_change(path, value):
    content, _, _, blocks, _ = redundant()
    content = feasible(content, {"wrench_infeasible": 0}, blocks)
    place = content
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return content


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("blocks", 0, "tensions"), [["1"] * 4]),
        (("blocks", 0, "tensions"), [["1"] * 4, ["1"] * 3]),
        (("blocks", 0), {"start": "0", "end": "1/20"}),
        (("limits", "motor_torque_max"), ["1"] * 4),
        (("robot", "forces"), []),
    ],
)
def test_mistakes_of_redundant_robots(path, value):
    with pytest.raises(NotACertificate):
        verify(redundant_change(path, value))


def platform_change(path, value):
    content = contact_case(
        [[{"body": True, "radius": "0"}, BALL]], [[0, 0, 1.0]], 0, body={"corners": [["0", "0", "0"]]}
    )
    place = content
    for key in path[:-1]:
        place = place[key]
    if value is None:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return content


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("robot", "inertia"), None),
        (("robot", "inertia", 0, 1), "1"),
        (("robot", "inertia", 0, 0), "-1"),
        (("robot", "joint_arm"), ["0", "0", "1"]),
        (("robot", "line_axes"), [["1", "0", "0"], ["0", "1", "0"]]),
        (("robot", "moments"), [0, 1, 2, 2]),
        (("robot", "platform_points"), [["0", "0", "0"]] * 6),
        (("robot", "platform_points"), [["0", "0", "0"]] * 5),
        (("motion", "pieces", 0, "quaternion"), None),
        (("motion", "pieces", 0, "quaternion"), [0, 1, 2]),
        (("blocks", 3, "directions"), None),
        (("blocks", 3, "directions"), [["0", "0", "0"]]),
        (("blocks", 3, "directions"), [["0", "0"]]),
        (("blocks", 3, "directions"), []),
        (("scene", "pairs", 0, 0, "body"), 1),
        (("scene", "pairs", 0, 0), {"cone": [["1", "0", "0"]], "corner": ["0", "0", "0"], "radius": "1"}),
        (("scene", "pairs", 0, 0), {"cone": [], "corner": ["0", "0", "0"]}),
        (("scene", "pairs", 0, 0), {"body": True, "radius": "0", "leave": "1"}),
        (("scene", "pairs", 0), [BALL]),
        (("scene", "pairs", 0), [BALL, BALL, BALL]),
        (("scene", "body"), None),
        (("scene", "body"), {"corners": []}),
    ],
)
def test_mistakes_of_platforms(path, value):
    assert verify(platform_change(("name",), "right"))
    with pytest.raises(NotACertificate):
        verify(platform_change(path, value))


@pytest.mark.parametrize(
    "failure",
    [
        {"criterion": "no_such", "time": "0"},
        {"criterion": ["slack_cable:0"], "time": "0"},
        {"criterion": "slack_cable:0"},
        {"criterion": "slack_cable:0", "time": "-1"},
        {"criterion": "slack_cable:0", "time": "2"},
        {"criterion": "slack_cable:0", "time": "0", "wrench": ["0", "0"]},
        {"criterion": "contact:0", "time": "0"},
        {"criterion": "contact:0", "time": "0", "points": [["1", "0"]]},
        {"criterion": "contact:0", "time": "0", "points": [["1", "0"], ["1", "0"]]},
        {"criterion": "contact:0", "time": "0", "points": [["1", "1"], ["1"]]},
        {"criterion": "contact:0", "time": "0", "points": [["2", "-1"], ["1"]]},
        "slack_cable:0",
    ],
)
def test_mistakes_of_failures(failure):
    content = {key: value for key, value in simple().items() if key not in ("bounds", "blocks")}
    content["scene"] = {"pairs": [[{"cable": 0, "radius": "0"}, {"spool": 1, "radius": "0"}]]}
    with pytest.raises(NotACertificate):
        verify(infeasible(content, failure))
    with pytest.raises(NotACertificate):
        verify(infeasible(content))


@pytest.mark.parametrize(
    "file",
    [
        "",
        "[]",
        "{}",
        "1",
        "[" * 100000,
        '{"a": ' * 100000,
        '{"version": 1.0}',
        '{"version": 1e400}',
        '{"version": NaN}',
        '{"version": ' + "1" * 5000 + "}",
        '{"version": 1, "version": 1}',
        '{"a": "\\ud800"}',
        "\ufeff{}",
    ],
    ids=lambda file: file[:20],
)
def test_unreadable_files(file):
    with pytest.raises(NotACertificate):
        read(file)


def test_where_a_file_is_no_json():
    with pytest.raises(NotACertificate, match=r"no JSON from line 2, column 4 on$"):
        read("[1,\n 2,,]")
    with pytest.raises(NotACertificate, match=r"no JSON that can be read$"):
        read("1" * 6000)


def test_keys_that_stand_twice():
    content = simple()
    file = json.dumps(content | {"sha256": checksum(content)})
    with pytest.raises(NotACertificate, match="the key 'version' stands twice"):
        read(file.replace('"version": 1', '"version": 2, "version": 1'))


def test_altered_files():
    content = simple()
    file = json.dumps(content | {"sha256": checksum(content)})
    assert check(read(file)).holds
    with pytest.raises(NotACertificate, match="sha256"):
        read(file.replace('"mass": "5"', '"mass": "6"'))
    with pytest.raises(NotACertificate):
        read(file[:-20])


@pytest.mark.parametrize("content", [None, [], "x", 1, {}, {1: 2}])
def test_contents_that_are_no_objects(content):
    with pytest.raises(NotACertificate):
        check(content)


def test_command_line(tmp_path):
    """Exit codes, also for files that do not exist or hold no text."""
    good = simple()
    wrong = simple() | {"bounds": good["bounds"] | {"above_spools": "9"}}
    files = {"good": good, "wrong": wrong, "bad": good | {"version": 3}}
    for name, content in files.items():
        (tmp_path / name).write_text(json.dumps(content | {"sha256": checksum(content)}))
    (tmp_path / "binary").write_bytes(b"\xff\x00\x80")
    for name, code in {"good": 0, "wrong": 5, "bad": 2, "binary": 2, "missing": 2}.items():
        command = [sys.executable, "-m", "cspr_jax.certificate_checker", str(tmp_path / name)]
        ran = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (ran.returncode, ran.stderr, ran.stdout.count("\n")) == (code, "", 1), name
