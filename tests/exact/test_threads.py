"""Threads that decide at once: the library holds its precision and number of coefficients for the whole process."""

import itertools
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import flint
import pytest
from oracles import exact_motions as oracle

import cspr_jax
from cspr_jax.verification.exact.components import Component
from cspr_jax.verification.exact.minimum import attained, lowest
from cspr_jax.verification.exact.series import STATES, SeriesPieces, absolute, ball, precision
from cspr_jax.verification.exact.slacks import _norm
from exact import cases

FEW = (1e-9, -1e-9, 1e-14, -1e-14)


@pytest.fixture
def frequent_switches():
    """Threads that take turns after every few steps."""
    earlier = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(earlier)


def test_threads_decide_alike(tmp_path, frequent_switches):
    case, robot, pieces = next(cases.feasible_cases(cases.point_mass_case, 0))
    extreme = oracle.polynomial_extreme(robot, pieces, "tension", 0)
    limits = oracle.near_limits(extreme.square, "tension", FEW)
    kept = ["feasible" if oracle.keeps(extreme.square, limit, "tension") else "over_tension" for limit in limits]
    case.with_limit("tension", limits[0], 0).plan.save_certificate(tmp_path / "motion.json")
    before = flint.ctx.prec, flint.ctx.cap
    with ThreadPoolExecutor(3) as pool:
        decisions = [pool.submit(lambda x: case.with_limit("tension", x, 0).verdict, limit) for limit in limits]
        checks = [pool.submit(cspr_jax.verify_certificate, tmp_path / "motion.json") for _ in range(3)]
        assert [future.result() for future in decisions] == kept
        assert all(future.result().holds for future in checks)
    assert (flint.ctx.prec, flint.ctx.cap) == before


def test_one_thread_at_a_time():
    """Another one waits until the first has restored what it found."""
    entered = threading.Event()

    def enter():
        with precision(64):
            entered.set()
            return flint.ctx.prec

    before = flint.ctx.prec, flint.ctx.cap
    with ThreadPoolExecutor(1) as pool:
        with precision(128):
            future = pool.submit(enter)
            assert not entered.wait(0.1)
            assert flint.ctx.prec == 128
        assert future.result() == 64
    assert (flint.ctx.prec, flint.ctx.cap) == before


@pytest.mark.parametrize("count", range(STATES + 1))
def test_too_few_coefficients_bound_nothing(count):
    """Coefficients beyond the order of a series read as zero; other users of the library may lower it at any time."""
    motion = cases.point_mass_case(0).checked().plan.legs[0].motions[0]
    with precision(128):
        piece, radius = SeriesPieces(motion.formulas())[0], ball(0.1)
        flint.ctx.cap = count
        at, over = piece.state(radius), piece.state(radius, radius)
        for middle, full in zip(at.acceleration, over.acceleration, strict=True):
            for function in (lambda x: x, lambda x: absolute(0 * x), lambda x: _norm([0 * x] * 3)):
                bound, _ = lowest(function(middle), function(full), radius)
                assert bound.is_finite() == (count == STATES)
            assert (attained([Component(middle)]) < flint.arb("inf")) == (count >= STATES - 2)


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("count", range(STATES))
def test_too_few_coefficients_in_one_of_two_series(monkeypatch, count, which):
    motion = cases.point_mass_case(0).checked().plan.legs[0].motions[0]
    with precision(128):
        piece, radius, calls = SeriesPieces(motion.formulas())[0], ball(0.1), itertools.count()
        outputs_of = piece._outputs

        def outputs(u):
            flint.ctx.cap = count if next(calls) == which else STATES
            return outputs_of(u)

        monkeypatch.setattr(piece, "_outputs", outputs)
        position = piece.state(radius, radius).position
    assert not any(x[k].is_finite() for x in position for k in range(STATES))
