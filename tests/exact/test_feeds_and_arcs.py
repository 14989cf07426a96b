"""Feeds near the largest speed of a piece, and refusals of one of several motions."""

import dataclasses

import numpy as np
import pytest

import cspr_jax
from cspr_jax.curves.spline import Spline
from cspr_jax.motion.limits import TOUCHED
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.attained import attained, with_attained
from cspr_jax.verification.proved_answers import answers_of, proof_of

SPOOLS = [[1.0, 0.0, 0.0], [-0.5, 0.75, 0.0], [-0.5, -0.75, 0.0]]
FASTEST = 1.5  # of z = 1 + 3 u^2 - 2 u^3 at u = 1/2


def problem(limits=NO_LIMITS):
    """A light load under strong gravity, so that its cables stay taut."""
    robot, _ = centred(cspr_jax.point_mass(SPOOLS, mass=1.0, gravity=20.0))
    return Problem(robot, limits, None)


def lowered():
    """Two pieces of that motion, one second each: down by 1 m, and down by half a metre more."""
    table = np.zeros((2, 4, 3))
    table[:, :, 2] = [[1.0, 1.0, 2.0, 2.0], [2.0, 2.0, 2.5, 2.5]]
    return Spline(np.array([0.0, 1.0, 2.0]), table, None)


@pytest.mark.parametrize("fraction", [-1e-6, -1e-9, -1e-12, -1e-15, 1e-15, 1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("second", [np.inf, 5.0])
def test_feeds_beside_the_largest_speed(fraction, second):
    feed = FASTEST * (1.0 + fraction) / (1.0 + TOUCHED)
    proof = proof_of(problem(), lowered()).with_feeds(lowered(), np.array([feed, second]))
    decided = attained(problem(), lowered(), proof)
    assert decided.verdict == (Verdict.FEASIBLE if fraction > 0.0 else Verdict.OVER_FEED)


@pytest.mark.parametrize("none", [Verdict.FEASIBLE, Verdict.NO_ARCS])
@pytest.mark.parametrize(
    ("tried", "arcs", "verdict"),
    [(0, None, Verdict.TOO_FAST), (7, None, Verdict.UNDECIDED), (7, 0, Verdict.UNDECIDED), (7, 7, Verdict.TOO_FAST)],
)
def test_one_refused_motion_refuses_no_others(tried, arcs, verdict, none):
    """Where the number of arcs is free, the motions of other numbers may be feasible."""
    case, motion = problem(Limits(speed_max=np.array(1.0))), lowered()
    answers = answers_of([proof_of(case, motion)], np.array([2.0]))
    flags = np.array([(Verdict.UNDECIDED | none).value], answers.verdict.dtype)
    open_ones = dataclasses.replace(answers, verdict=flags, tried_arcs=np.array([tried]))
    given = None if arcs is None else np.array([arcs])
    assert with_attained(case, open_ones, [motion], None, given).verdict.tolist() == [(verdict | none).value]


@pytest.mark.parametrize("none", [Verdict.FEASIBLE, Verdict.NO_ARCS])
def test_a_feasible_motion_is_an_answer(none):
    case, motion = problem(Limits(speed_max=np.array(100.0))), lowered()
    answers = answers_of([proof_of(case, motion)], np.array([2.0]))
    flags = np.array([(Verdict.UNDECIDED | none).value], answers.verdict.dtype)
    closed = with_attained(
        case, dataclasses.replace(answers, verdict=flags, tried_arcs=np.array([7])), [motion], None, np.array([0])
    )
    assert (closed.verdict.tolist(), closed.arcs.tolist()) == ([Verdict.FEASIBLE.value], [7])
