"""Checks in several threads, jumps that add up, and files that would take too long or too much memory."""

import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from flint import arb_series, ctx, fmpq

from cspr_jax.certificate_checker import checking, state
from cspr_jax.certificate_checker.checking import check
from cspr_jax.certificate_checker.criteria import crossing
from cspr_jax.certificate_checker.reading import NotACertificate
from cspr_jax.certificate_checker.series import ORDER, Undefined, angle, apply, run, term, tight
from tests.certificate_checker.cases import MASS
from tests.certificate_checker.oracle import cut, feasible, infeasible, piece, statement, text, verify
from tests.certificate_checker.test_crossings import SECTOR, between, rise

PLANAR = MASS | {"base_points": [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "forces": [0, 2]}
BOUNDS = {"slack_cable:0": 0, "slack_cable:1": 0, "above_spools": 0}


def bump(floor, power=6):
    """A mass at z = 1 + (2 t - 1)^power, of which series of a lower order see the 1 alone."""
    heavy = PLANAR | {"gravity": 981.0}
    height = 1 + np.polynomial.Polynomial([-1.0, 2.0]) ** power
    steps = [["poly", [0.0]], ["poly", height.coef.tolist()], ["+", 0, 1]]
    pieces = [piece(0, 1, steps, [0, 0, 2])]
    return feasible(statement(heavy, {"floor": floor}, pieces), BOUNDS | {"below_floor": 0}, cut(pieces, 1))


@pytest.mark.parametrize("caps", [(6, 10), (10, 6), (6, 3), (3, 6), (5, 6), (1, 6), (0, 6), (6, 0)])
@pytest.mark.parametrize("power", [2, 4, 6])
def test_orders_of_another_thread(power, caps, monkeypatch):
    """Whatever order another thread sets between a state and its middle, nothing false is shown."""

    def disturbed(program, at, radius):
        ctx.cap = caps[bool(radius)]
        return run(program, at, radius)

    assert verify(bump(2.5, power))
    monkeypatch.setattr(state, "run", disturbed)
    monkeypatch.setattr(checking, "MAX_PARTS", 8)
    assert not verify(bump(1.5, power))
    assert ctx.cap == 10


def test_terms_beyond_the_order_are_not_known():
    short = arb_series([1, 2, 3], 3)
    assert term(short, 2) == 3
    for series, k in ((short, 3), (short, -1), (arb_series([1], 0), 0)):
        with pytest.raises(Undefined, match="order"):
            term(series, k)
    unknown = arb_series([1], 0)
    for name in ("inv", "sqrt", "acos", "sin"):
        with pytest.raises(Undefined, match="order"):
            apply(name, unknown)
    with pytest.raises(Undefined):
        angle(unknown, short)
    with pytest.raises(Undefined):
        tight(short, arb_series([1, 2, 3, 4, 5], 5), fmpq(1))


@pytest.mark.parametrize("cap", [2, 10, 20])
def test_programs_have_their_order_by_themselves(cap, monkeypatch):
    monkeypatch.setattr(ctx, "cap", cap)
    assert run([["poly", [fmpq(1)] * 9]], fmpq(0), fmpq(1))[0].prec == ORDER


def test_settings_of_flint_stay():
    for content, error in ((bump(2.5), None), (bump(1.5), None), (bump(2.5) | {"robot": {}}, NotACertificate)):
        with ctx.workprec(77):
            ctx.cap = 3
            try:
                if error:
                    with pytest.raises(error):
                        verify(content)
                else:
                    verify(content)
                assert (ctx.prec, ctx.cap) == (77, 3)
            finally:
                ctx.cap = 10


def test_checks_in_threads_wait_for_each_other(monkeypatch):
    """While one check is at work, another has not begun."""
    running, most = [], []

    def slow(content):
        running.append(1)
        most.append(len(running))
        time.sleep(0.02)
        running.pop()
        raise NotACertificate("stop")

    def one():
        with pytest.raises(NotACertificate, match="stop"):
            verify(bump(2.5))

    monkeypatch.setattr(checking, "read_statement", slow)
    threads = [threading.Thread(target=one) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1] * 4


def staircase(heights, speeds=(0, 0, 0, 0)):
    """Pieces of 1/4 s at x = 0.1, and at z as given, with speeds."""
    pieces = []
    for (start, end), height, speed in zip(pairwise([0, 0.25, 0.5, 0.75, 1]), heights, speeds, strict=True):
        steps = [["poly", [0.1]], ["poly", [0.0]], ["poly", [0.0]]]
        entry = piece(start, end, steps, [0, 1, 2])
        entry["program"][2] = ["poly", [str(height), str(speed)]]
        pieces.append(entry)
    return check(feasible(statement(PLANAR, {}, pieces), BOUNDS, cut(pieces, 1)) | {"sha256": ""})


@pytest.mark.parametrize(
    ("heights", "meets"),
    [
        (["1.5", "1.500000003", "1.500000006", "1.500000009"], True),
        (["1.5", "1.500000003", "1.5", "1.500000003"], True),
        (["1.5", "1.500000004", "1.500000008", "1.500000012"], False),
        (["1.5", "1.500000004", "1.5", "1.500000004"], False),  # they do not cancel
    ],
)
def test_jumps_of_position_add_up(heights, meets):
    finding = staircase(heights)
    assert finding.holds is meets
    assert ("pieces[2] and the next do not meet" in finding.message) is not meets


@pytest.mark.parametrize(("rate", "meets"), [(fmpq(3, 10**7), True), (fmpq(4, 10**7), False)])
def test_jumps_of_velocity_add_up(rate, meets):
    heights = [fmpq(3, 2) + rate / 4 * k for k in (0, 0, 1, 3)]
    starts = [heights[0], *(heights[k] for k in (1, 2, 3))]
    assert staircase(starts, [rate * k for k in range(4)]).holds is meets


def test_jumps_of_rotation_add_up():
    robot = MASS | {"base_points": [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], "forces": [2], "moments": [0]}
    robot |= {"platform_points": [[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]], "inertia": np.eye(3).tolist()}
    for turn, meets in (("2e-9", True), ("3e-9", False)):  # entries change by twice as much
        pieces = []
        for k, (start, end) in enumerate(pairwise([0, 0.5, 0.75, 1])):
            entry = piece(start, end, [["poly", [c]] for c in (0.0, 2.0, 1.0, 0.0)], [0, 0, 1], [2, 3, 0, 0])
            entry["program"][3] = ["poly", [str(fmpq(int(turn[0]), 10**9) * k)]]
            pieces.append(entry)
        failing = infeasible(statement(robot, {"floor": 1.0}, pieces), {"criterion": "below_floor", "time": "0"})
        assert verify(failing) is meets


def bodies(first, second):
    """A statement with fixed bodies of so many points."""
    pair = [{"points": text([[0, 0, x]] * count), "radius": "0"} for x, count in ((9, first), (7, second))]
    pieces = [piece(0, 1, [["poly", [c]] for c in (0.1, 0.0, 1.5)], [0, 1, 2])]
    content = statement(PLANAR, {}, pieces, scene={"pairs": [pair]})
    return feasible(content, BOUNDS | {"contact:0": 0}, cut(pieces, 1, directions=[text([0, 0, -1])]))


def test_points_of_a_pair():
    assert verify(bodies(100, 100))
    for counts in ((100, 101), (10001, 1), (3000, 3000)):
        with pytest.raises(NotACertificate, match=r"pairs\[0\]: more than 10000 points"):
            verify(bodies(*counts))


def test_corners_of_a_pair():
    content = rise(SECTOR)
    content["scene"] = {"pairs": [[{"body": True, "radius": "0"}] * 2], "body": {"corners": text([[0, 0, 0]] * 101)}}
    with pytest.raises(NotACertificate, match="10000 points"):
        verify(infeasible(content, between("0", "1")))


def test_coefficients_of_a_step():
    content = bodies(1, 1)
    for count, right in ((100, True), (101, False)):
        content["motion"]["pieces"][0]["program"][1] = ["poly", ["0"] * count]
        if right:
            assert verify(content)
        else:
            with pytest.raises(NotACertificate, match=r"program\[1\]: more than 100 coefficients"):
                verify(content)


@pytest.mark.parametrize(
    ("rays", "crosses"),
    [
        ([[1, k / 16, 0] for k in range(-13, 1)], False),
        ([[-2 - 2 * k, -1 - k, 0] for k in range(12)] + SECTOR, True),
    ],
)
def test_cones_of_many_rays(rays, crosses, monkeypatch):
    """Each two of 14 rays are looked at once at both ends, and further where they may cross."""
    calls = []

    def counted(*arguments):
        calls.append(arguments)
        return crossing(*arguments)

    monkeypatch.setattr(checking, "crossing", counted)
    assert verify(infeasible(rise(rays), between("0", "1"))) is crosses
    assert len(calls) < 2 * 14 * 13 / 2 + 20


@pytest.mark.parametrize("proof", ["blocks", "junctions", "failures", "crossings"])
def test_work_of_a_file(proof, monkeypatch):
    """Just enough is enough, and a step less is not."""
    base = bodies(3, 4)
    entry = base["motion"]["pieces"][0]
    part = 2 * 100 + 3 * 4 + 3  # cables, points, and steps
    failing = {k: v for k, v in base.items() if k not in ("bounds", "blocks")} | {"limits": {"floor": "1"}}
    failure = {"criterion": "below_floor", "time": "0"}
    content, count = {
        "blocks": (base | {"blocks": cut([entry], 5, directions=[text([0, 0, -1])])}, 5),
        "junctions": (base, 4),
        "failures": (infeasible(failing, failure, failure), 3),
        "crossings": (infeasible(rise(SECTOR), between("0.7", "0.71")), 0),
    }[proof]
    if proof == "junctions":
        pieces = [entry | {"end": "1/2"}, entry | {"start": "1/2"}]
        content = base | {
            "motion": {"duration": "1", "pieces": pieces},
            "blocks": cut(pieces, 1, directions=[["0", "0", "-1"]]),
        }
    if proof == "crossings":
        part, count = 2 * 100 + 2 + 10, 4  # a piece, both times, and a part
    monkeypatch.setattr(checking, "MAX_WORK", part * count)
    assert verify(content)
    monkeypatch.setattr(checking, "MAX_WORK", part * count - 1)
    with pytest.raises(NotACertificate, match="steps"):
        verify(content)
