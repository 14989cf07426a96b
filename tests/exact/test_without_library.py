"""Without the library for exact arithmetic: what is near a limit is undecided, and plans say how to install it."""

import re

import pytest
from oracles import exact_motions as oracle

import cspr_jax
from cspr_jax.errors import ConfigError
from exact import cases

HOW = "pip install 'cspr_jax[exact]'"


def near_case():
    """A case, and a limit of a cable's tension that is extremely near its extreme."""
    case, robot, pieces = next(cases.feasible_cases(cases.point_mass_case, 0))
    extreme = oracle.polynomial_extreme(robot, pieces, "tension", 0)
    return case, oracle.near_limits(extreme.square, "tension", (1e-14, -1e-14))


def test_a_limit_near_an_extreme_is_undecided(monkeypatch):
    case, limits = near_case()
    with cases.without_library(monkeypatch):
        for limit in limits:
            check = case.with_limit("tension", limit, 0)
            assert check.verdict == "undecided"
            assert any(HOW in line for line in check.plan.warnings), check.plan.warnings
        decided = case.checked(**case.loose("tension"))
    assert decided.feasible
    assert not any(HOW in line for line in decided.plan.warnings)
    check = case.with_limit("tension", limits[0], 0)
    assert check.verdict == "feasible"
    assert not any(HOW in line for line in check.plan.warnings)


def test_digits_need_the_library(monkeypatch):
    case = cases.point_mass_case(0)
    monkeypatch.setattr("cspr_jax.runtime.exact_arithmetic.has_exact", lambda: False)
    with pytest.raises(ConfigError, match=re.escape(f"digits: python-flint is not installed: {HOW}")):
        cspr_jax.check(case.robot, **case.samples, digits=12)
    assert case.checked().feasible
