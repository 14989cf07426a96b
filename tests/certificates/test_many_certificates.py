"""Certificates of fresh motions of all families hold, with limits beside what the motions need, on both sides."""

import json

import numpy as np
import pytest
from exact import cases
from exact.test_families import FAMILIES, PlanCase

from cspr_jax.certificate_checker.checking import check
from cspr_jax.certificate_checker.reading import read

LIMITS = (
    "tension_max",
    "cable_length_max",
    "cable_speed_max",
    "cable_acceleration_max",
    "speed_max",
    "acceleration_max",
)


def _sampled(make, **how):
    return lambda rng: make(int(rng.integers(1_000_000)), **how)


SPLINES = {
    "spline": _sampled(cases.point_mass_case),
    "planar": _sampled(cases.planar_case),
    "guided": _sampled(cases.guided_case),
    "four cables": _sampled(cases.point_mass_case, count=4, samples=4),
    "five cables": _sampled(cases.point_mass_case, count=5, samples=4),
    "platform": _sampled(cases.platform_case),
    "laval-mssm": _sampled(cases.platform_case, name="laval-mssm"),
}
MAKERS = FAMILIES | SPLINES
# Motions, and limits of each: some 10,000 certificates, fewer of motions whose plans or proofs take seconds.
COUNTS = dict.fromkeys(MAKERS, (20, 48)) | {
    "path": (10, 30),
    "free": (10, 30),
    "platform_swing": (6, 10),
    "four cables": (20, 12),
    "five cables": (20, 12),
    "platform": (10, 12),
    "laval-mssm": (10, 12),
}


def planned(case, **limits):
    """The plan of a case within limits, and whether the motion is feasible."""
    if isinstance(case, PlanCase):
        plan = case.planned(**limits)
        return plan, plan.feasible
    result = case.checked(**limits)
    return result.plan, result.feasible


def limits_near(rng, needed: dict) -> dict:
    """One to three limits, each 1e-9 to 0.3 of what is needed beside it; none of what is zero."""
    limits = {}
    for name in rng.choice(LIMITS, int(rng.integers(1, 4)), replace=False).tolist():
        value = needed.get(name)
        if value is not None and value > 1e-9:
            limits[name] = float(value * (1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9.0, -0.5)))
    return limits


def wrong_certificates(make, seed: int, count: int):
    """Certificates of one motion that do not hold or say something else than the plan, and the number of all."""
    rng = np.random.default_rng(seed)
    case = make(rng)
    wrong, number, limits = [], 0, {}
    needed = planned(case)[0].to_dict()["segments"][-1]
    for _ in range(count + 1):
        plan, is_feasible = planned(case, **limits)
        content = plan.certificate()
        finding = check(read(json.dumps(content)))
        is_right = finding.holds and content["verdict"] == ("feasible" if is_feasible else "infeasible")
        wrong += [] if is_right else [{"seed": seed, "limits": limits, "finding": finding}]
        number += 1
        limits = limits_near(rng, needed)
    return wrong, number


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["turns", "line", "planar"])
def test_certificates_of_motions(name):
    assert wrong_certificates(MAKERS[name], 0, 6) == ([], 7)


@pytest.mark.soak
@pytest.mark.parametrize("name", MAKERS)
def test_certificates_of_many_motions(name):
    motions, count = COUNTS[name]
    for seed in range(100, 100 + motions):
        assert wrong_certificates(MAKERS[name], seed, count) == ([], count + 1)
