"""Proofs of any motion agree with those that families have of their own: verdicts, and margins within their bounds."""

import dataclasses

import jax
import numpy as np
import pytest
from support.platforms import EFFECTIVE, MSSM, Z0, checker_of, made, ours, random_pose, stacked

import cspr_jax
from cspr_jax.families.platforms.platform_segment import PlatformMotion
from cspr_jax.families.swings.arcs import segments_between
from cspr_jax.families.swings.hypocycloid import Hypocycloid
from cspr_jax.families.swings.parities import pick
from cspr_jax.families.swings.proof import verdicts as swing_proof
from cspr_jax.motion import amplitudes
from cspr_jax.motion.motion import Backwards
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots import cables
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.bounds.block_slacks import BlockSlacks
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.proved_answers import MotionProof, proof_of, proved_answers
from cspr_jax.verification.time_proof import time_proof

COUNT = 12


def problem_of(**numbers) -> Problem:
    robot = centred(cspr_jax.load_robot("prototype"))[0]
    return Problem(
        robot, Limits(**{name: np.full(3, value) for name, value in numbers.items()}), amplitudes.named("quintic")
    )


def swings(problem: Problem, seed: int):
    """Random segments with random numbers of arcs; their motions."""
    rng = np.random.default_rng(seed)
    starts, ends = rng.uniform([-0.7, -0.7, 0.5], [0.7, 0.7, 1.0], (2, COUNT, 3))
    arcs = rng.integers(2, 6, COUNT)
    parities, _ = segments_between(problem, starts, ends, np.full(COUNT, 0.75))
    segments = pick(parities, np.arange(COUNT), arcs)
    motions = [
        Hypocycloid(jax.tree.map(lambda x, i=i: np.asarray(x)[i], segments), problem.amplitude, as_float64(arcs[i]))
        for i in range(COUNT)
    ]
    return segments, arcs, motions


LIMITS = {"tension_min": 0.1, "cable_speed_max": 2.0}


# Kernels with limits compile for seconds.
@pytest.mark.parametrize("limits", [{}, pytest.param(LIMITS, marks=pytest.mark.thorough)], ids=["taut", "limits"])
def test_swings_on_three_cables_get_the_verdict_of_their_own_proof(limits):
    problem = problem_of(**limits)
    segments, arcs, motions = swings(problem, 5)
    answers, exact = proved_answers(problem, motions), swing_proof.prove(problem, segments, arcs)
    assert 2 < exact.feasible.sum() < COUNT - 2 and not (answers.verdict & Verdict.UNDECIDED.value).any()
    np.testing.assert_array_equal(answers.verdict == 0, exact.feasible)
    np.testing.assert_array_equal(answers.verdict != 0, exact.infeasible)
    # Tensions of a motion at samples lie above what is proved, and the bounds are close.
    tensions = jax.jit(lambda motion, tau: jax.vmap(lambda t: cables.tensions(problem.robot, motion.state(t)))(tau))
    speeds = jax.jit(
        lambda motion, tau: jax.vmap(lambda t: cables.cable_motion(problem.robot, motion.state(t))[1])(tau)
    )
    for i, motion in enumerate(motions):
        tension = tensions(motion, np.linspace(0.0, 1.0, 2001))
        least = float(tension.min()) - limits.get("tension_min", 0.0)
        size = float(abs(tension).max())
        assert answers.margin_bound[i] <= least + 1e-9 * size
        assert least - answers.margin_bound[i] <= 0.02 * abs(least) + 0.005 * size
        assert answers.margin[i] >= answers.margin_bound[i]
        if limits:
            rate = np.asarray(speeds(motion, np.linspace(0.0, 1.0, 2001)))
            least = 1.0 - abs(rate).max() / limits["cable_speed_max"]
            assert answers.limit_margin[i] == pytest.approx(least, rel=0.02, abs=0.005)


@pytest.mark.thorough
def test_platforms_on_six_cables_get_the_verdict_of_their_own_proof():
    """Their own proof has contacts too: taut cables and the determinant alone are compared."""
    rng, checker = np.random.default_rng(8), checker_of()
    arcs = rng.integers(3, 10, COUNT)
    segments = [
        made(ours(MSSM), random_pose(rng, rest=True), random_pose(rng), Z0, (-1.0, float(rng.uniform(-3.0, 0.0))), p)
        for p in arcs.tolist()
    ]
    checks = checker.check(stacked(segments), arcs)
    motions = [PlatformMotion(*each) for each in zip(segments, [EFFECTIVE] * COUNT, map(as_float64, arcs), strict=True)]
    problem = Problem(checker.problem.robot, Limits(), EFFECTIVE)
    answers = proved_answers(problem, motions)
    is_taut = (checks.slack[:, :2] > 0.0).all(1)
    assert 0 < is_taut.sum() < COUNT
    np.testing.assert_array_equal(answers.verdict == 0, is_taut)
    assert (answers.margin_bound[is_taut] > 0.0).all()


def test_a_motion_in_reverse_has_the_same_answer():
    problem = problem_of()
    _, _, motions = swings(problem, 5)
    there, back = (proof_of(problem, motion) for motion in (motions[0], Backwards(motions[0])))
    assert there.verdict == back.verdict and there.margin_bound == pytest.approx(back.margin_bound, rel=0.03)


def test_what_fails_is_named_with_its_instant():
    rows, time = (Criterion(Verdict.OVER_TENSION, (0,), "N"), Criterion(Verdict.OBSTACLE, (), "m")), 3.0

    def slacks(start, end):
        # The first criterion fails after half of the time; the second one is never met or broken for certain.
        low, high = 0.5 * time - end, 0.5 * time - start
        return BlockSlacks(np.stack([low, 0.0 * low - 1.0], 1), np.stack([high, 0.0 * high + 1.0], 1))

    proof = MotionProof(rows, time_proof(slacks, time), np.ones(2))
    assert proof.verdict == Verdict.OVER_TENSION
    np.testing.assert_allclose(proof.failing, [[0.5 * time, time]], atol=1e-4)
    assert proof.margin_bound == pytest.approx(-0.5 * time)


def test_one_open_criterion_leaves_a_motion_undecided():
    rows = Criterion(Verdict.OVER_TENSION, (0,), "N"), Criterion(Verdict.OBSTACLE, (), "m")

    def slacks(start, end):
        return BlockSlacks(np.tile([1.0, -1.0], (len(start), 1)), np.ones((len(start), 2)))

    proof = MotionProof(rows, time_proof(slacks, 2.0), np.ones(2))
    assert proof.verdict == Verdict.UNDECIDED and len(proof.failing) == 0


def test_nothing_is_proved_of_a_motion_without_a_duration():
    problem = problem_of()
    motion = swings(problem, 5)[2][0]
    still = dataclasses.replace(motion, arcs=as_float64(np.nan))
    assert proof_of(problem, still).verdict == Verdict.UNDECIDED


def test_a_motion_is_feasible_though_fewer_arcs_are_undecided():
    problem = problem_of()
    answers = proved_answers(problem, swings(problem, 5)[2][:3])
    flags = np.array([0, Verdict.FEWER_ARCS_UNDECIDED.value, Verdict.UNDECIDED.value], answers.verdict.dtype)
    assert dataclasses.replace(answers, verdict=flags).feasible.tolist() == [True, True, False]
