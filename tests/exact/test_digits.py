"""Causes and demands with a number of digits, against exact extremes."""

import flint
import numpy as np
import pytest
from oracles import exact_motions as oracle

import cspr_jax
from cspr_jax.errors import InputError
from exact import cases

# Limits over the extremes.
BROKEN = 0.5


def extreme_of_all(robot, pieces, quantity):
    """The worst extreme of all cables, and the cable."""
    cables = range(len(robot.base)) if quantity in oracle.OF_EACH_CABLE else [0]
    found = [(oracle.polynomial_extreme(robot, pieces, quantity, cable), cable) for cable in cables]
    order = min if quantity == "least tension" else max
    return order(found, key=lambda each: each[0].value(quantity))


def value_at(robot, pieces, quantity, cable, t) -> float:
    """Value of a quantity at a time as a floating-point number is."""
    t = oracle.rational(t)
    piece = next(p for p in reversed(pieces) if p.start <= t)
    square = oracle.signed_square(robot, oracle.piece_state(piece, t - piece.start), quantity, cable)
    return oracle.Extreme(square, t).value(quantity)


def agree(first: float, second: float, digits: int) -> bool:
    """Tell whether two numbers agree to a number of digits."""
    return abs(first - second) <= 10.0**-digits * abs(second)


def rows_of(case, robot, pieces, digits):
    """Numbers of demands and causes, each with the quantity and its worst extreme and cable; every limit is broken."""
    worst = {quantity: extreme_of_all(robot, pieces, quantity) for quantity in oracle.LIMIT_OF if quantity != "depth"}
    limits = {
        oracle.LIMIT_OF[quantity]: BROKEN * extreme.value(quantity)
        for quantity, (extreme, _) in worst.items()
        if quantity != "least tension"
    }
    check = cspr_jax.check(case.robot, **case.samples, limits=limits, digits=digits)
    assert not check.feasible
    of_flag = {oracle.FLAG_OF[quantity]: quantity for quantity in worst}
    for quantity, extreme in worst.items():
        row = check.demands[oracle.LIMIT_OF[quantity]]
        yield quantity, row["value"], row, extreme
    assert {cause["criterion"] for cause in check.cause} == set(of_flag) - {"slack_cable"}
    for cause in check.cause:
        quantity = of_flag[cause["criterion"]]
        yield quantity, cause["needed"], cause, worst[quantity]


def wrong_values(case, robot, pieces, digits):
    """Values that differ from the extreme, or from the value at their time."""
    wrong = []
    for quantity, value, row, (extreme, cable) in rows_of(case, robot, pieces, digits):
        attained = value_at(robot, pieces, quantity, cable, row["t"])
        is_right = agree(value, extreme.value(quantity), digits) and agree(attained, value, digits)
        if quantity in oracle.OF_EACH_CABLE:
            is_right &= row["cable"] == cable
        wrong += [] if is_right else [(quantity, value, row, extreme.value(quantity), attained)]
    return wrong


def test_twelve_digits():
    assert wrong_values(*next(cases.feasible_cases(cases.point_mass_case, 0)), 12) == []


@pytest.mark.thorough
@pytest.mark.parametrize("digits", range(1, 16))
def test_numbers_of_digits(digits):
    assert wrong_values(*next(cases.feasible_cases(cases.point_mass_case, 10 * digits)), digits) == []


@pytest.mark.soak
@pytest.mark.parametrize("make", [cases.planar_case, cases.guided_case, cases.point_mass_case])
def test_many_motions(make):
    for seed in range(20):
        assert wrong_values(*next(cases.feasible_cases(make, 1000 * seed)), 12) == [], seed


@pytest.mark.thorough
def test_times_to_twelve_digits():
    case, robot, pieces = next(cases.feasible_cases(cases.point_mass_case, 0))
    for quantity, _, row, (extreme, _) in rows_of(case, robot, pieces, 12):
        assert agree(row["t"], extreme.seconds(), 12), quantity


@pytest.mark.parametrize("digits", [0, 16, -1, 1.5, True, "a"])
def test_impossible_numbers_of_digits_are_refused(digits):
    case = cases.point_mass_case(0)
    with pytest.raises(InputError, match=r"digits = .*: must be an integer from 1 to 15"):
        cspr_jax.check(case.robot, **case.samples, digits=digits)


@pytest.mark.thorough
def test_platform_to_three_digits():
    """More take minutes."""
    case, robot, pieces = next(cases.feasible_cases(cases.platform_case, 0))
    extremes = [oracle.rational_extreme(robot, pieces, "tension", cable, count=16) for cable in range(6)]
    with flint.ctx.workprec(oracle.ROOT_BITS):
        cable = int(np.argmax([float(flint.arb(extreme.square)) for extreme in extremes]))
    extreme = extremes[cable]
    check = cspr_jax.check(case.robot, **case.samples, limits={"tension_max": 1.0}, digits=3)
    cause = check.cause[0]
    assert (cause["criterion"], cause["cable"]) == ("over_tension", cable)
    assert agree(cause["needed"], extreme.value("tension"), 3)
    assert abs(cause["t"] - extreme.seconds()) < 1e-2
