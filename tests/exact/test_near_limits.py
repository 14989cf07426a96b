"""Verdicts on limits that lie extremely near an extreme: they are right, and never "undecided"."""

import itertools
from fractions import Fraction

import flint
import numpy as np
import pytest
from oracles import exact_motions as oracle

from exact import cases

THOROUGH = pytest.mark.thorough
SOAK = pytest.mark.soak
MAKERS = {"space": cases.point_mass_case, "plane": cases.planar_case, "guide": cases.guided_case}
FEW = (1e-9, -1e-9, 1e-14, -1e-14)


def faults_of_point_masses(make, seed, count, shares, quantities=tuple(oracle.LIMIT_OF), nearest_floors=False):
    """Verdicts that are wrong, and the number of checks, over all quantities of some motions."""
    faults, number = [], 0
    rng = np.random.default_rng(seed)
    for case, robot, pieces in itertools.islice(cases.feasible_cases(make, 1000 * seed), count):
        for quantity in quantities:
            cable = int(rng.integers(case.n_cables)) if quantity in oracle.OF_EACH_CABLE else 0
            extreme = oracle.polynomial_extreme(robot, pieces, quantity, cable)
            results = list(cases.wrong_verdicts(case, quantity, cable, extreme, shares))
            results = results[:-2] if quantity == "depth" and not nearest_floors else results
            faults += [row | {"seed": seed} for row in results if row is not None]
            number += len(results)
    return faults, number


def faults_of_platforms(seed, name, quantities, shares):
    """The same of one motion of a platform."""
    case, robot, pieces = next(cases.feasible_cases(lambda k: cases.platform_case(k, name), 1000 * seed))
    faults, number = [], 0
    for quantity in quantities:
        cable = seed % 6 if quantity in oracle.OF_EACH_CABLE else 0
        extreme = oracle.rational_extreme(robot, pieces, quantity, cable, count=24)
        results = list(cases.wrong_verdicts(case, quantity, cable, extreme, shares))
        results = results[:-2] if quantity == "depth" else results
        faults += [row | {"seed": seed} for row in results if row is not None]
        number += len(results)
    return faults, number


def redundant_verdicts(case, extreme, least, shares):
    """What is wrong with verdicts on one limit of all tensions of a redundant point mass.

    All limits of tensions are missed alike, by the allowance of the smallest tension.
    """
    allowance = oracle.ALLOWANCE * least
    for limit in oracle.near_limits(extreme.square, "tension", shares, allowance):
        check = case.checked(tension_max=limit, **({"tension_min": least} if least else {}))
        is_kept = oracle.keeps(extreme.square, limit, "tension", allowance)
        is_right = check.feasible if is_kept else check.verdict not in ("feasible", "undecided")
        yield None if is_right else {"limit": limit, "least": least, "verdict": check.verdict, "kept": is_kept}


def faults_of_redundant(seed, n_cables, shares):
    """The same of one motion, without and with a smallest tension."""
    case, robot, pieces = next(
        cases.feasible_cases(lambda k: cases.point_mass_case(k, n_cables, samples=4), 1000 * seed)
    )
    least = 0.01 * float(Fraction(int(robot.mass.p), int(robot.mass.q))) if seed % 2 else 0.0
    extreme = oracle.redundant_extreme(robot, pieces, oracle.threshold(least, "least tension"), count=24)
    results = list(redundant_verdicts(case, extreme, least, shares))
    return [row | {"seed": seed} for row in results if row is not None], len(results)


def test_extremes_of_the_oracle_agree():
    """By roots, and by samples and the golden section."""
    _, robot, pieces = next(cases.feasible_cases(cases.point_mass_case, 0))
    for quantity in oracle.LIMIT_OF:
        by_roots = oracle.polynomial_extreme(robot, pieces, quantity, 1)
        by_samples = oracle.rational_extreme(robot, pieces, quantity, 1)
        with flint.ctx.workprec(oracle.ROOT_BITS):
            ratio = by_roots.square / flint.arb(by_samples.square)
            assert abs(ratio - 1) < flint.arb(10) ** -35, quantity


@pytest.mark.quick("space")
@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_point_masses(make):
    """All quantities of one motion each."""
    assert faults_of_point_masses(make, 1, 1, FEW[::3])[0] == []


@THOROUGH
@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_more_point_masses(make):
    assert faults_of_point_masses(make, 2, 1, cases.SHARES)[0] == []


@SOAK
@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_many_point_masses(make):
    """1,034 checks in space, 188 in the plane and on the guide."""
    count = 11 if make is cases.point_mass_case else 2
    faults, number = faults_of_point_masses(make, 3, count, cases.SHARES)
    assert (faults, number) == ([], 94 * count)


@THOROUGH
def test_floors_at_the_nearest_numbers():
    faults, _ = faults_of_point_masses(cases.planar_case, 1, 4, (), ("depth",), nearest_floors=True)
    assert faults == []


@THOROUGH
def test_one_limit_alone():
    """Without the loose ones beside it."""
    case, robot, pieces = next(cases.feasible_cases(cases.point_mass_case, 50))
    for quantity in oracle.LIMIT_OF:
        extreme = oracle.polynomial_extreme(robot, pieces, quantity, 2)
        assert not any(cases.wrong_verdicts(case, quantity, 2, extreme, FEW, only=True)), quantity


@THOROUGH
@pytest.mark.parametrize("name", [None, "laval-mssm"])
def test_platforms(name):
    assert faults_of_platforms(1, name, ("tension", "cable speed", "depth"), FEW)[0] == []


@SOAK
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", [None, "laval-mssm"])
def test_many_platforms(name, seed):
    """Six checks of each of two quantities: 120 checks, less those of the nearest floors."""
    every = list(oracle.LIMIT_OF)
    quantities = ("tension", every[1 + seed % (len(every) - 1)])
    faults, _ = faults_of_platforms(10 + seed, name, quantities, FEW)
    assert faults == []


@THOROUGH
@pytest.mark.parametrize("n_cables", [4, 5])
def test_redundant_point_masses(n_cables):
    assert faults_of_redundant(n_cables, n_cables, FEW)[0] == []


@SOAK
@pytest.mark.parametrize("seed", range(10, 15))
@pytest.mark.parametrize("n_cables", [4, 5])
def test_many_redundant_point_masses(n_cables, seed):
    """Six checks each: 60 checks."""
    assert faults_of_redundant(seed, n_cables, FEW) == ([], 6)
