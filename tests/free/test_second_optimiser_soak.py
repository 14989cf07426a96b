"""Free motions of 100 random pairs beside a second optimiser: direct collocation by CasADi and ipopt."""

import numpy as np
import pytest
from oracles import free_motion_cases, free_motions
from support.free_motions import solve

from cspr_jax.families.free.problem import FreeSettings

pytestmark = pytest.mark.soak

KINDS = ("2T-2", "2T-3", "2T-4", "3T-3", "3T-4")
SEEDS = range(10)
# By how much a motion may be slower than the other optimiser's.
SLOWER = 0.005


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("outside", [False, True])
def test_second_optimiser(kind, outside, capsys):
    pytest.importorskip("casadi")
    rows = []
    for seed in SEEDS:
        case = free_motion_cases.case(kind, 100 + seed, outside)
        other = free_motions.least_time(case.robot, case.limits, case.start, case.end, steps=(24, 48), count=6).time
        free, _ = solve(case.robot, case.limits, [case.start.position, case.end.position], settings=FreeSettings())
        rows.append((seed, free.duration if free.answers.feasible.all() else np.inf, other))
    with capsys.disabled():
        print(f"\n{kind} {'outside' if outside else 'inside'}:", *rows, sep="\n")
    for seed, ours, other in rows:
        assert ours <= (1.0 + SLOWER) * other or np.isinf(other), seed
