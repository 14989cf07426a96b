"""Answers with limits against the plain search: every number of arcs proved in full, in increasing order."""

import jax
import numpy as np
import pytest
from conftest import TILTED, equilateral

from cspr_jax.families.swings.arcs import arcs_and_segments, segments_between
from cspr_jax.families.swings.parities import pick
from cspr_jax.families.swings.proof.verdicts import prove
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model import point_mass
from cspr_jax.robots.model.limits import Limits
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.fewest_limits import FewestLimits

Z0, MAX_ARCS = 1.7, 10
ROBOTS = {
    "prototype": point_mass.point_mass_robot(equilateral(0.26), mass=0.198),
    "tilted": point_mass.point_mass_robot(TILTED - TILTED.mean(0), mass=0.198),
}
FLAGS = (Verdict.SLACK_CABLE, Verdict.OVER_TENSION, Verdict.BELOW_FLOOR, Verdict.CABLE_TOO_FAST)


def random_problem(rng, name):
    """Limits from what most motions keep to what hardly any keeps."""
    three = np.ones(3)
    limits = Limits(
        tension_min=rng.uniform(0.0, 0.06) * three,
        tension_max=rng.uniform(1.2, 4.0) * three,
        floor=rng.uniform(2.6, 3.6),
        cable_speed_max=rng.choice([0.3, 2.0, 3.0, 4.0, 8.0]) * three,
    )
    return Problem(ROBOTS[name], jax.tree.map(np.asarray, limits), named("quintic"))


def first_feasible(problem, parities, count):
    """Smallest number of arcs proved feasible, 0 where there is none; and whether each number is decided."""
    proofs = [
        prove(problem, pick(parities, np.arange(count), np.full(count, p)), np.full(count, p))
        for p in range(1, MAX_ARCS + 1)
    ]
    feasible = np.stack([proof.feasible for proof in proofs], 1)
    decided = feasible | np.stack([proof.infeasible for proof in proofs], 1)
    return np.where(feasible.any(1), np.argmax(feasible, axis=1) + 1, 0), decided.all(1)


def limits_in_the_way(problem, parities, i):
    """Number of arcs and limits that are named for a segment without an answer, as `verification.fewest_limits` says
    it."""
    least, shown, common = None, (0, set()), None
    for p in range(1, MAX_ARCS + 1):
        segment, arcs = pick(parities, np.array([i]), np.array([p])), np.array([p])
        # Columns: taut cables, depth below the spools, the four limits.
        if not prove(problem, segment, arcs, ignored=np.array([[False] * 2 + [True] * 4])).feasible[0]:
            continue
        only = ~np.eye(6, dtype=bool)[2:]
        broken = {
            flag
            for flag, ignored in zip(FLAGS, only, strict=True)
            if prove(problem, segment, arcs, ignored=ignored[None]).infeasible[0]
        }
        common = broken if common is None else common & broken
        rank = 2 * len(broken) + (Verdict.SLACK_CABLE in broken)
        if least is None or rank < least:
            least, shown = rank, (p, broken)
        if least <= 2:
            break
    return shown if common is None or len(common) <= 1 else (shown[0], common)


def compare(seed, count):
    """Count segments of one robot; returns how many have an answer, and how many are refused by limits alone."""
    rng = np.random.default_rng([seed, 50])
    name = str(rng.choice(sorted(ROBOTS)))
    problem = random_problem(rng, name)
    starts, ends = rng.uniform([-1.5, -1.5, 0.7], [1.5, 1.5, 3.2], (2, count, 3))
    parities, _ = segments_between(problem, starts, ends, np.full(count, Z0))
    answers, _ = arcs_and_segments(problem, starts, ends, np.full(count, Z0), max_arcs=MAX_ARCS)
    wanted, is_decided = first_feasible(problem, parities, count)
    np.testing.assert_array_equal(answers.arcs[is_decided], wanted[is_decided])
    refused = 0
    for i in np.flatnonzero(is_decided & (wanted == 0))[:12]:
        arcs, broken = limits_in_the_way(problem, parities, i)
        if arcs:
            refused += 1
            flags = Verdict(int(answers.verdict[i]))
            assert (answers.tried_arcs[i], {flag for flag in FLAGS if flag in flags}) == (arcs, broken), (seed, i)
    return int((wanted > 0).sum()), refused


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 3])
def test_limits_are_met_by_the_arcs_of_a_full_search(seed):
    """Segments of a robot, some with an answer, some refused by limits; the soak has 100,000 segments."""
    feasible, refused = compare(seed, 40)
    assert feasible > 2
    assert refused > 1


@pytest.mark.soak
def test_many_limits_are_met_by_the_arcs_of_a_full_search(record_property):
    """A hundred robots with random limits, a thousand segments each."""
    counts = np.sum([compare(seed, 1000) for seed in range(100)], axis=0)
    record_property("segments with an answer, segments refused by limits", counts.tolist())
    assert (counts > 1000).all()


def test_candidates_left_out_change_nothing():
    """Limits named from all candidates, and from those alone that may change them by what is known beforehand."""
    rng, left_out = np.random.default_rng(11), 0
    for _ in range(300):
        every, some = (FewestLimits(1, (Verdict.SLACK_CABLE, Verdict.ABOVE_SPOOLS, *FLAGS)) for _ in range(2))
        for p in range(1, 8):
            broken = np.append([False] * 2, rng.random(4) < 0.7)[None]
            known = broken & (rng.random(6) < 0.8)
            if not broken.any():
                continue
            if not every.is_best[0]:
                every.take(np.array([0]), np.array([p]), broken)
            if not some.is_best[0] and some.may_change(np.array([0]), known)[0]:
                some.take(np.array([0]), np.array([p]), broken)
            else:
                left_out += 1
        for one, other in zip(every.refused(), some.refused(), strict=True):
            np.testing.assert_array_equal(one, other)
    assert left_out
