"""Feeds of G-code are limits like others: proved between nodes, named, and kept when a motion is retimed."""

import itertools

import numpy as np
import pytest

import cspr_jax
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import ConfigError
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.outputs.paths import path_lines
from cspr_jax.robots.model.limits import Limits
from cspr_jax.verification.feeds import feed_proof
from cspr_jax.verification.proved_answers import proved_answers

# Corners of a program whose feeds were exceeded by half a per cent behind a blended corner; mm, and mm a minute.
PLACES = np.array(
    [[-13.134, 4.159, 1000.0], [4.916, 24.98, 989.86], [-52.728, 6.524, 1044.954], [-14.59, -30.72, 1049.331]]
)
FEEDS = [9227.0, 7377.0, np.inf]
PROGRAM = """G21 G90
G0 X-13.134 Y4.159 Z1000.000
G1 X4.916 Y24.980 Z989.860 F9227
G1 X-52.728 Y6.524 Z1044.954 F7377
G0 X-14.590 Y-30.720 Z1049.331
"""
TOLERANCE = 3.0
PLAN = """schema = 1
robot = "prototype"
family = "path"
[limits]
tension_min = 0.05
tension_max = 3.0
[path]
kind = "gcode"
file = "part.nc"
corner = "blend"
blend_tolerance = 0.003
ramp_time = 0.0
grid = 60
"""


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("feeds")
    (folder / "part.nc").write_text(PROGRAM)
    (folder / "plan.toml").write_text(PLAN)
    return cspr_jax.plan(folder / "plan.toml")


def excess(result) -> list[float]:
    """Largest speed over the feed along each move, at samples on its line that no blend touches."""
    rows, largest = result.rows(rate=20000.0), []
    for start, end, feed in zip(PLACES, PLACES[1:], FEEDS, strict=False):
        length = np.linalg.norm(end - start)
        along = (1e3 * rows["position"] - start) @ (end - start) / length
        beside = np.linalg.norm(1e3 * rows["position"] - start - along[:, None] * (end - start) / length, axis=1)
        chosen = (beside < 1e-3) & (along > 0.05) & (along < length - 0.05)
        assert chosen.sum() > 100
        largest.append(6e4 * float(np.linalg.norm(rows["velocity"][chosen], axis=1).max()) / feed)
    return largest


def test_feeds_are_kept_between_nodes(planned):
    (segment,) = planned.to_dict()["segments"]
    assert segment["verdict"] == "feasible"
    fast, behind, rapid = excess(planned)
    assert 0.99 < behind < 1.0 and fast < 1.0 and rapid == 0.0


def test_stops_refuse_feeds(planned):
    with pytest.raises(ConfigError, match="feeds: must be absent in a plan that is to be stopped"):
        cspr_jax.stops(planned)


def test_feeds_are_named(planned):
    (segment,) = planned.to_dict()["segments"]
    fraction = {row.get("feed"): row["share"] for row in segment["binding"]}
    rows = planned.rows(rate=5000.0)
    speeds = 6e4 * np.linalg.norm(rows["velocity"], axis=1)
    near = (np.abs(speeds / FEEDS[1] - 1.0) < 1e-2).mean()
    assert fraction["F7377"] == pytest.approx(near, abs=0.1) and near > 0.1
    assert {row["criterion"] for row in segment["binding"] if "feed" in row} == {"over_feed"}
    assert "feed F7377 (" in path_lines(planned.to_dict()["segments"])[0]


def test_retimed_motions_keep_feeds(planned):
    again = cspr_jax.retime(planned, grid=60)
    assert again.feasible and max(excess(again)) < 1.0


# Along a line by the law of a quintic, in eight pieces; largest speed 15/8 of the mean.
KNOTS, LENGTH = np.linspace(0.0, 2.0, 9), 0.1
PEAK = 1.875 * LENGTH / 2.0


def law() -> Spline:
    """The motion, with its pieces by de Casteljau."""
    rest, pieces = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]), []
    for k in range(8, 0, -1):
        fraction, rows = 1.0 / k, [rest]
        while len(rows[-1]) > 1:
            rows.append((1.0 - fraction) * rows[-1][:-1] + fraction * rows[-1][1:])
        pieces.append(np.array([row[0] for row in rows]))
        rest = np.array([row[-1] for row in rows])[::-1]
    way = np.array([0.6, 0.0, -0.8])
    return Spline(
        as_float64(KNOTS), as_float64(np.array([0.0, 0.0, 1.2]) + LENGTH * np.stack(pieces)[..., None] * way), None
    )


def speed_at(t):
    return 30.0 * LENGTH / 2.0 * (t / 2.0) ** 2 * (1.0 - t / 2.0) ** 2


@pytest.mark.parametrize("fraction", [1.0 - 1e-6, 1.0 + 1e-6])
def test_feeds_hold_over_their_pieces_alone(fraction):
    """Each piece may be just as fast as it is, its neighbours may not."""
    fastest = np.array([speed_at(np.clip(1.0, a, b)) for a, b in itertools.pairwise(KNOTS)])
    row, proof = feed_proof(law(), fraction * fastest)
    assert (proof.low[0] > 0.0) == (fraction > 1.0) and (proof.high[0] < 0.0) == (fraction < 1.0)
    assert row.value(proof.high[0]) == pytest.approx(row.allowed / fraction, rel=1e-6)


def test_feeds_that_are_exceeded_are_refused():
    problem = Problem(cspr_jax.load_robot("prototype"), Limits(), named("quintic"))
    free = np.full(8, np.inf)
    slow = np.array([*[np.inf] * 3, 0.9 * PEAK, *[np.inf] * 3, 0.5 * PEAK])
    answers = proved_answers(problem, [law()] * 3, None, [None, free, slow])
    assert [int(flag) for flag in answers.verdict] == [0, 0, cspr_jax.Verdict.OVER_FEED]
    # In the fourth piece, from where the law is too fast on.
    t = np.linspace(*KNOTS[3:5], 100_001)
    first = t[np.argmax(speed_at(t) > slow[3])]
    np.testing.assert_allclose(answers.proof[2].failing, [[first, KNOTS[4]]], atol=2e-5)
    (cause,) = answers.causes_of(2, None)  # no heights among them: of any frame
    assert cause.needed == pytest.approx(PEAK, rel=1e-3)
    assert cause.text == f"the mass centre needs {cause.needed:.3g} m/s at t = 1.00 s, the feed allows 0.0844"
