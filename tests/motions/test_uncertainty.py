"""Verdicts about all robots within an uncertainty, against robots that the oracles simulate one by one."""

import dataclasses

import numpy as np
import pytest
from oracles import platform as oracle
from support.other_robots import displaced, on_balls, ratios, uncertain, worst_robot
from support.platforms import FROM_REST, stacked
from support.random_motions import ROBOTS, motions_of, problem_of, quintic

from cspr_jax.families.platforms.platform_segment import take_segments as some_of
from cspr_jax.families.platforms.six_cable_proof.checker import PlatformChecker
from cspr_jax.families.platforms.six_cable_proof.enclosures import Robustness
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.robots.model.limits import Limits, Uncertainty
from cspr_jax.verification.bounds.blocks import parts_of_arcs
from cspr_jax.verification.bounds.enclosures import influence
from cspr_jax.verification.robustness.uncertainty import closer_changes, deviations, requirements_of, worst
from cspr_jax.verification.robustness.uncertainty import tensions as tensions_of

BETWEEN = PlatformMotionKind()
SPOOLS, CENTRE = 0.004, 0.006
BALLS = Uncertainty(np.asarray(SPOOLS), np.asarray(CENTRE), np.asarray(1.0))


def feasible_motions(name, kind, count, limits, seed=0):
    """Motions that are feasible as planned: the oracle's, the package's, numbers of arcs."""
    robot, rng = ROBOTS[name], np.random.default_rng(seed)
    drawn = motions_of(rng, robot, kind, count)
    segments, arcs = stacked([own[3] for own in drawn]), np.array([own[1] for own in drawn])
    without = dataclasses.replace(limits, uncertainty=None)
    checks = PlatformChecker(problem_of(robot, without), kind, batch=64).check(segments, arcs, margins=False)
    which = np.flatnonzero(checks.verdict == 0)
    return [drawn[i] for i in which], some_of(segments, which), arcs[which]


def oracle_motion(robot, own, tau):
    segment, arcs, beta, _ = own
    segment = dataclasses.replace(segment, amplitude=quintic)
    return oracle.motion(robot, segment, arcs, beta, np.asarray(tau))


def distance_of_cables(robot, motion):
    return np.linalg.norm(oracle.cable_vectors(robot, motion.position, motion.rotation)[0], axis=2).min()


SOAK = pytest.mark.soak
MANY = [(robot, kind) for robot in ROBOTS for kind in (FROM_REST, BETWEEN)]


@pytest.mark.ci("mssm-kind0-20-2")
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "kind", "count", "robots"),
    [
        ("mssm", FROM_REST, 20, 2),
        pytest.param("general", BETWEEN, 100, 2, marks=pytest.mark.thorough),
        # Hardly any motion between random poses is feasible.
        *(pytest.param(*own, 1000 if own[1].from_rest else 4000, 30, marks=SOAK) for own in MANY),
    ],
)
def test_no_robot_within_a_proved_multiple_of_the_uncertainty_fails(name, kind, count, robots):
    robot, limits = ROBOTS[name], Limits(uncertainty=BALLS)
    drawn, segments, arcs = feasible_motions(name, kind, count, limits)
    robustness = Robustness(problem_of(robot, limits), kind, batch=64, count_samples=lambda _: None)
    found = robustness.tolerated(segments, arcs)
    rng = np.random.default_rng(1)
    assert (found.proved > 0.0).mean() > 0.9
    assert (found.proved <= found.refuted).all()
    assert np.median(found.proved / found.refuted) > 0.6
    for own, proved in zip(drawn, found.proved, strict=True):
        motion = oracle_motion(robot, own, np.linspace(0.0, 1.0, 201))
        planned = ratios(robot, motion)
        # At random on the balls, and the worst to first order where tensions are least.
        others = [
            dataclasses.replace(
                robot, base=robot.base + on_balls(rng, (6,), proved * SPOOLS), com=on_balls(rng, (), proved * CENTRE)
            )
            for _ in range(robots)
        ]
        places = [(int(np.argmin(planned[:, k])), k) for k in range(6)]
        others += [worst_robot(robot, motion, *at, proved * SPOOLS, proved * CENTRE) for at in places]
        for other in others:
            assert (ratios(other, motion) > 0.0).all()
            assert distance_of_cables(other, motion) > 0.0


@pytest.mark.thorough
def test_a_robot_that_refutes_a_multiple_fails_in_the_oracle_too():
    robot, limits = ROBOTS["mssm"], Limits(uncertainty=BALLS)
    drawn, segments, arcs = feasible_motions("mssm", FROM_REST, 20, limits)
    problem = problem_of(robot, limits)
    robustness = Robustness(problem, FROM_REST, batch=64, count_samples=lambda _: None)
    refuted, fails = robustness.tolerated(segments, arcs).refuted, []
    for i, own in enumerate(drawn):
        one, only = some_of(segments, [i]), arcs[[i]]
        blocks = parts_of_arcs(only, np.zeros(0), 64)
        known = robustness.enclosure(one, only, blocks)
        found = influence(known)
        bad = worst(known, found, requirements_of(problem, np.full(len(blocks.row), float(one.rate[0]) / 6)))
        spools, centre = 1.02 * refuted[i] * SPOOLS * bad.spools[0], 1.02 * refuted[i] * CENTRE * bad.centre[0]
        mu, lengths = tensions_of(known, spools, centre)
        k = int(np.argmin(mu.min(1)))
        motion = oracle_motion(robot, own, [0.5 * (blocks.start[k] + blocks.stop[k])])
        other = displaced(robot, spools[k] @ motion.rotation[0].T, centre[k])
        assert ratios(other, motion)[0] == pytest.approx(mu[k], rel=1e-9, abs=1e-12)
        assert np.linalg.norm(oracle.cables(other, motion.position, motion.rotation)[0], axis=1) == pytest.approx(
            lengths[k]
        )
        # It is the worst one to first order, by differences.
        by_differences = worst_robot(
            robot, motion, 0, int(np.argmin(mu[k])), 1.02 * refuted[i] * SPOOLS, 1.02 * refuted[i] * CENTRE
        )
        assert ratios(by_differences, motion)[0] == pytest.approx(mu[k], rel=1e-3, abs=1e-4)
        fails.append(mu[k].min() < 0.0)
    # Else what fails are contacts, or the instant is between these.
    assert np.mean(fails) > 0.5


@pytest.mark.parametrize(
    ("spools", "centre"),
    [
        pytest.param(0.004, 0.0, marks=pytest.mark.thorough),
        pytest.param(0.0, 0.006, marks=pytest.mark.thorough),
        (0.004, 0.006),
    ],
)
@pytest.mark.parametrize(
    ("name", "kind"), [("mssm", FROM_REST), pytest.param("general", BETWEEN, marks=pytest.mark.thorough)]
)
def test_no_robot_deviates_more_than_is_bounded(name, kind, spools, centre):
    """At random instants of blocks, feasible motions or not; and the bounds are not far off."""
    robot, rng = ROBOTS[name], np.random.default_rng(4)
    drawn = motions_of(rng, robot, kind, 20)
    segments, arcs = stacked([own[3] for own in drawn]), np.array([own[1] for own in drawn])
    problem = problem_of(robot, Limits(uncertainty=BALLS))
    robustness = Robustness(problem, kind, batch=64, count_samples=lambda _: None)
    blocks = parts_of_arcs(arcs, np.zeros(0), 512)
    blocks = blocks.part(rng.choice(len(blocks.row), 200, replace=False))
    known = robustness.enclosure(segments, arcs, blocks)
    found, sizes = influence(known), [np.full(200, x) for x in (spools, centre)]
    off = deviations(known, found, *sizes)
    sound = np.isfinite(off).all(1) & (known.low > 0.0).all(1)
    # Of each block the largest smallest tensions, as parts of the planned ones, that are proved to be kept.
    least, most = np.full_like(known.low, -np.inf), np.full_like(known.low, np.inf)
    for part in np.linspace(0.0, 0.99, 12):
        tried = part * np.where(sound[:, None], known.low, 0.0)
        changes = closer_changes(known, found, *sizes, np.where(np.isfinite(off), off, 0.0), tried, upwards=True)
        kept = sound & (known.low - changes.down > tried).all(1)
        least[kept] = tried[kept]
        most = np.where(np.isfinite(changes.up), np.minimum(most, changes.up), most)
    # The worst for the smallest tension, and for the largest.
    limited = problem._replace(limits=Limits(tension_max=np.full(6, 1e9), uncertainty=BALLS))
    bad = worst(known, found, requirements_of(limited, np.asarray(segments.rate)[blocks.row] / 6))
    is_sure = np.isfinite(known.low) & np.isfinite(found.mu)
    assert ((known.low <= found.mu) & (found.mu <= known.high))[is_sure].all()
    reached = []
    for k in np.flatnonzero(sound):
        tau = rng.uniform(blocks.start[k], blocks.stop[k], 4)
        motion = oracle_motion(robot, drawn[blocks.row[k]], tau)
        planned = ratios(robot, motion)
        lengths = np.linalg.norm(oracle.cables(robot, motion.position, motion.rotation), axis=2)
        assert (planned >= known.low[k] - 1e-9 * known.high[k]).all()
        assert (planned <= known.high[k] * (1.0 + 1e-9)).all()
        turn = motion.rotation[0]
        others = [displaced(robot, on_balls(rng, (6,), spools), on_balls(rng, (), centre)) for _ in range(4)]
        others += [displaced(robot, spools * bad.spools[i, k] @ turn.T, centre * bad.centre[i, k]) for i in (0, 1)]
        for other in others:
            more = np.linalg.norm(oracle.cables(other, motion.position, motion.rotation), axis=2)
            # Tensions over planned lengths: a spool that moves along its ray changes none.
            change = ratios(other, motion) * more / lengths - planned
            slack = (planned + off[k]) * (1.0 / np.sqrt(1.0 - (spools / lengths) ** 2) - 1.0) + 1e-9 * known.high[k]
            assert (change >= -off[k] - 1e-9 * known.high[k]).all()
            assert (change <= off[k] + slack).all()
            reached.append((np.abs(change) / off[k]).max())
            assert (planned + change >= least[k] - 1e-9 * known.high[k]).all()
            assert (change <= most[k] + slack).all()
    # They are not far off.
    proved = sound & (known.low - off > 0.2 * known.low).all(1)
    kept = least[proved] / (known.low[proved] - off[proved])
    assert len(reached) > 200
    assert np.quantile(reached, 0.9) > 0.5
    assert np.median(kept) > 0.8


@pytest.mark.thorough
def test_verdicts_are_those_of_the_multiples():
    limits = Limits(uncertainty=BALLS)
    _, segments, arcs = feasible_motions("mssm", FROM_REST, 20, limits)
    robustness = Robustness(problem_of(ROBOTS["mssm"], limits), FROM_REST, batch=64, count_samples=lambda _: None)
    whole, short = robustness.tolerated(segments, arcs), robustness.tolerated(segments, arcs, full=False)
    assert ((short.proved >= 1.0) | (whole.proved < 1.001)).all()
    assert ((short.refuted > 1.0) | (short.proved == 0.0)).all()
    assert not ((short.refuted <= 1.0) & (whole.proved >= 1.0)).any()
    assert (short.proved >= 1.0).any()
    assert (short.refuted <= 1.0).any()
    # Twice the uncertainty, half the multiple.
    twice = Limits(uncertainty=uncertain(spool_positions=2 * SPOOLS, mass_centre=2 * CENTRE))
    half = Robustness(problem_of(ROBOTS["mssm"], twice), FROM_REST, batch=64, count_samples=lambda _: None)
    assert half.tolerated(segments, arcs).proved == pytest.approx(0.5 * whole.proved, rel=0.03)
