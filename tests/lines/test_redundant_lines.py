"""Straight lines on more cables than degrees of freedom, beside linear programs and the prover of any motion."""

import dataclasses

import pytest
from support.redundant import PLANAR_THREE, RECTANGLE, least_distances

import cspr_jax
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.verification.proved_answers import proof_of

KEYS = {"schema": 1, "max_acceleration": 20.0, "samples": 241}
CASES = {
    "boralugoda-planar-three": (PLANAR_THREE, [[10.0, 0.0, 5.0], [35.0, 0.0, 12.0]]),
    "boralugoda-rectangle": (RECTANGLE, [[10.0, 10.0, 5.0], [35.0, 20.0, 12.0]]),
}


@pytest.mark.ci("boralugoda-planar-three-s-curve-limits3", "boralugoda-rectangle-s-curve-limits6")
@pytest.mark.parametrize(
    ("robot", "family", "limits"),
    [
        ("boralugoda-planar-three", "quintic", {}),
        *(
            pytest.param(robot, family, limits, marks=pytest.mark.thorough)
            for robot in CASES
            for family, limits in (
                ("s-curve", {}),
                ("cubic", {"cable_speed_max": 6.0}),
                ("s-curve", {"tension_min": 5.0, "tension_max": 90.0}),
            )
        ),
    ],
)
def test_the_prover_of_any_motion_agrees(robot, family, limits):
    """The line of least time is feasible to within its tolerance; a slower one is proved, a faster one refuted."""
    base, places = CASES[robot]
    planned = cspr_jax.plan(
        KEYS | {"robot": robot, "family": family, "pose": [{"position": x} for x in places]} | limits
    )
    assert planned.feasible
    low, high = limits.get("tension_min", 0.0), limits.get("tension_max", float("inf"))
    assert least_distances(base, planned, 241, low=low, high=high)[0] > -1e-6
    (line,) = planned.legs[0].motions
    with double_precision():
        slower, faster = (
            proof_of(planned.problem, dataclasses.replace(line, time=line.time * fraction))
            for fraction in (1.001, 0.999)
        )
    assert slower.verdict == 0 and slower.margin_bound > 0.0
    assert faster.verdict != 0 and faster.failing[0].mean() > 0.0
