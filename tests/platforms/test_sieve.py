"""The first look at transitions of a platform: what it refutes and how many are left, beside checking everything."""

from dataclasses import replace
from itertools import pairwise

import jax
import numpy as np
import pytest
from oracles import platform as oracle
from support.platforms import EFFECTIVE, FROM_REST, MSSM, Z0, checker_of, made, ours

from cspr_jax.families.platforms.arcs import Candidates, _Segments, smallest_arcs
from cspr_jax.families.platforms.six_cable_proof import screen
from cspr_jax.families.platforms.six_cable_proof.slacks import certain_tension
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.platform_kind import USUAL
from cspr_jax.robots.statics.wrench_lanes import CableLanes, balance

BENDS, ARCS = 5, 8


def candidates(robot, rng, count):
    """Random targets up to twice the footprint away, each with several values of beta-hat."""
    radius, angle = 1.7 * np.sqrt(rng.uniform(0.0, 1.0, count)), rng.uniform(-np.pi, np.pi, count)
    place = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0.9, 2.0, count)], axis=1)
    turns = rng.uniform([-np.pi, 0.0, -1.0], [np.pi, 1.0, 1.0], (count, 3))
    end = place, np.stack([oracle.pose_quaternion(*pair) for pair in zip(place, turns, strict=True)])
    rest = np.tile(oracle.rest_point(robot, Z0), (count, 1)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    motion = np.repeat(np.arange(count), BENDS)
    beta_hats = np.full(len(motion), -1.0), rng.uniform(-8.0, 1.0, len(motion))
    return Candidates(rest, end, np.full(count, Z0), motion, beta_hats)


@pytest.mark.thorough
def test_the_search_is_the_full_search():
    """2,400 trajectories: smallest numbers of arcs, and what passes where each is checked in full."""
    check_search(60, EFFECTIVE)


@pytest.mark.soak
def test_the_search_is_the_full_search_all():
    """20,000 trajectories."""
    check_search(500, named("quintic"))


def check_search(motions, amplitude):
    """Of so many motions, with all values of beta-hat and numbers of arcs."""
    robot, rng = MSSM, np.random.default_rng(3)
    checker, full = (checker_of(kind=FROM_REST, amplitude=amplitude) for _ in range(2))
    given = candidates(robot, rng, motions)
    segments, every = _Segments(full.problem.robot, given), np.arange(motions * BENDS)
    passes = np.zeros((ARCS + 1, len(every)), bool)
    for arcs in range(1, ARCS + 1):
        passes[arcs] = full.check(segments(arcs, every), np.full(len(every), arcs)).verdict == 0
    of_motion = passes.reshape(ARCS + 1, motions, BENDS).any(2)
    wanted = np.where(of_motion.any(0), of_motion.argmax(0), 0)
    found = smallest_arcs(checker, given, max_arcs=ARCS)
    arcs = np.zeros(motions, int)
    some = np.flatnonzero(found.arcs)
    arcs[given.motion[some]] = found.arcs[some]
    np.testing.assert_array_equal(arcs, wanted)
    assert passes[found.arcs[some], some].all()
    assert 0 < (wanted > 0).sum() < motions
    work, brute = (sum(c.done[name] for name in ("screen", "checks")) for c in (checker, full))
    assert checker.done["motions"] < 0.2 * motions * BENDS * ARCS and work < 0.25 * brute


@pytest.mark.parametrize("kind", [USUAL, pytest.param(FROM_REST, marks=pytest.mark.thorough)])
def test_nothing_is_refuted_that_float64_would_pass(kind, monkeypatch):
    """Instants of every kind; with a float32 that is wrong on purpose, less is refuted but never more."""
    checker, rng = checker_of(kind=kind, batch=64), np.random.default_rng(4)
    segments = _Segments(checker.problem.robot, candidates(MSSM, rng, 60))(6, np.arange(300))
    tau = np.linspace(1.0, 0.0, 37)
    lowest = checker.screen.lowest(segments, 6, tau)
    wanted = lowest <= -1e-7
    assert 30 < wanted.sum() < 270
    np.testing.assert_array_equal(checker.screen.refuted(segments, 6, tau), wanted)
    few = jax.tree.map(lambda x: x[:16], segments)
    np.testing.assert_array_equal(checker.screen.refuted(few, 6, tau), wanted[:16])
    whole = screen._rough_and_certain
    for wrong in (lambda x: x - 0.3, lambda x: np.inf * x, lambda x: np.nan * x):

        def spoiled(*given, wrong=wrong, **options):
            single_precision, certain = whole(*given, **options)
            return wrong(single_precision), certain

        monkeypatch.setattr(screen, "_rough_and_certain", spoiled)
        refuted = checker.screen.refuted(segments, 6, tau)
        assert not (refuted & ~wanted).any()


def test_segments_of_candidates():
    """Those of their motions, with their own beta-hat at the start and at the end."""
    robot, given = ours(MSSM), candidates(MSSM, np.random.default_rng(7), 4)
    (places, turns), (ends, targets) = given.start, given.end
    for arcs in (4, 5):
        found = _Segments(robot, given)(arcs, np.arange(20))
        for k in range(20):
            i = given.motion[k]
            pair = (places[i], turns[i]), (ends[i], targets[i])
            one = made(robot, *pair, Z0, (given.beta_hats[0][k], given.beta_hats[1][k]), arcs)
            for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(found), strict=True):
                np.testing.assert_allclose(b[k], a, rtol=1e-12, atol=1e-12)


def test_more_instants_refute_more():
    checker, rng = checker_of(kind=FROM_REST, batch=64), np.random.default_rng(5)
    segments = _Segments(checker.problem.robot, candidates(MSSM, rng, 40))(5, np.arange(200))
    found = [checker.screen.refuted(segments, 5, np.linspace(1.0, 0.0, count)) for count in (3, 17, 129)]
    assert all(not (a & ~b).any() for a, b in pairwise(found))


@pytest.mark.parametrize("scale", [0.003, 300.0])
def test_the_size_of_the_robot_changes_nothing(scale):
    """In float32 too, whose range a determinant of such lengths leaves."""
    sizes = []
    for unit in (1.0, scale):
        robot = replace(MSSM, base=MSSM.base * unit, platform=MSSM.platform * unit, inertia=MSSM.inertia * unit**2)
        checker, given = checker_of(robot, FROM_REST, batch=64), candidates(MSSM, np.random.default_rng(6), 60)
        start, end = ((place * unit, turn) for place, turn in (given.start, given.end))
        given = given._replace(start=start, end=end, z0=given.z0 * unit)
        segments = _Segments(checker.problem.robot, given)(5, np.arange(300))
        sizes.append(checker.screen.refuted(segments, 5, np.linspace(1.0, 0.0, 33)))
        single_precision, _ = screen.smallest_tensions(
            checker.problem.robot,
            EFFECTIVE,
            5.0,
            np.linspace(0.1, 1.0, 8),
            segments,
            kind=FROM_REST,
            single_precision=True,
        )
        assert not np.isnan(single_precision).any() and (np.asarray(single_precision) < 0.0).sum() > 20
    np.testing.assert_array_equal(*sizes)


def test_a_tension_is_right_or_unknown():
    """Three cables in one plane but for a billionth or more, of systems that NumPy solves to ten digits."""
    rng, n = np.random.default_rng(6), 2000
    arms, rays = rng.normal(size=(6, n, 3)), rng.normal(size=(6, n, 3))
    across = np.cross(rays[0], rays[2])
    out = 10.0 ** rng.uniform(-9.0, 0.0, n)
    part = rng.uniform(-2.0, 2.0, (2, n, 1))
    rays[4] = part[0] * rays[0] + part[1] * rays[2] + out[:, None] * across / np.linalg.norm(across, axis=1)[:, None]
    force, moment = rng.normal(size=(2, n, 3))
    columns = -np.concatenate([rays, np.cross(arms, rays)], axis=2).transpose(1, 2, 0)
    is_good = np.linalg.cond(columns) < 100.0
    true = 6.0 * np.linalg.solve(columns, np.concatenate([force, moment], axis=1)[:, :, None])[:, :, 0].min(1)
    cables = CableLanes(*([tuple(x.T) for x in vectors] for vectors in (arms, rays)))
    found = balance(cables, tuple(force.T), tuple(moment.T))
    mine = np.asarray(certain_tension(np.ones(n), np.sign(found.signed), cables, found))
    is_known = np.isfinite(mine) & is_good
    assert np.abs(mine - true)[is_known].max() < 1e-7
    assert is_known[is_good & (out > 0.1)].all() and not is_known[out < 1e-4].any()
