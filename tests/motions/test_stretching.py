"""The least stretching of time: against roots that are known, and only where there is one."""

import math

import numpy as np
import pytest

from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.proved_answers import MotionProof
from cspr_jax.verification.time_proof import TimeProof
from cspr_jax.verification.time_stretching import least_stretching

ROWS = (Criterion(Verdict.SLACK_CABLE, (0,), "N"), Criterion(Verdict.CABLE_TOO_FAST, (0,), "m/s", allowed=1.0))


def of_slacks(tension, speed):
    """Proofs of a motion whose slacks are functions of u = 1 / c^2."""
    calls = []

    def proved(factor):
        slack = np.array([tension(1.0 / factor**2), speed(1.0 / factor**2)])
        calls.append(factor)
        empty, whole = np.empty((0, 2)), np.array([[0.0, 1.0]])
        failing = [whole if value < 0.0 else empty for value in slack]
        proof = TimeProof(slack, slack, np.zeros(2), failing, [empty] * 2, 1)
        return MotionProof(ROWS, proof, np.ones(2))

    return proved, calls


def test_feasible_as_it_is():
    proved, calls = of_slacks(lambda u: 2.0 - u, lambda u: 1.0 - 0.5 * math.sqrt(u))
    assert least_stretching(proved)[0] == 1.0 and calls == [1.0]


@pytest.mark.parametrize("largest", [0.999, 0.3, 1e-3, 1e-8])
def test_down_to_rest(largest):
    """Where rest is feasible, the least stretching is where the first slack vanishes."""
    proved, _ = of_slacks(lambda u: largest - u, lambda u: 2.0 - math.sqrt(u))
    found = least_stretching(proved)
    assert found.is_static and found.factor == pytest.approx(largest**-0.5, rel=2e-6)
    assert found.factor >= largest**-0.5


@pytest.mark.parametrize(("low", "high"), [(0.1, 0.4), (0.5, 0.51), (0.02, 0.9)])
def test_faster_than_some_speed(low, high):
    """Beyond the static workspace a motion can be too slow as well."""
    proved, _ = of_slacks(lambda u: min(u - low, high - u), lambda u: 2.0 - math.sqrt(u))
    found = least_stretching(proved)
    assert not found.is_static and found.factor == pytest.approx(high**-0.5, rel=2e-6)


def test_none():
    proved, _ = of_slacks(lambda u: min(u - 0.5, 0.4 - u), lambda u: 2.0 - math.sqrt(u))
    assert math.isnan(least_stretching(proved).factor)
    # A limit that time does not change: two proofs say so.
    proved, calls = of_slacks(lambda u: 1.0, lambda u: -1.0)
    assert math.isnan(least_stretching(proved).factor) and len(calls) == 2
