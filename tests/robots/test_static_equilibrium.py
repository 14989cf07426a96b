"""Whether robots on more cables than degrees of freedom hang still, beside linear programs of the oracle."""

import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.optimize import linprog
from support import cable_robots
from support.workspaces import made

from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.static_equilibrium import DEPTHS, slack_at_rest
from cspr_jax.robots.statics.kernel_axes import centred

SIZES = [("2T", 4), ("1R2T", 4), *(pytest.param(*size, marks=pytest.mark.thorough) for size in (("1T", 3), ("3T", 5)))]
SIZES += [pytest.param(*size, marks=pytest.mark.thorough) for size in (("2R3T", 7), ("3R3T", 8))]


def hangs(drawn, low, high):
    """Whether tensions within limits hold the robot at some depth below the centroid of its spools."""
    middle = drawn.base.mean(0)
    size = np.linalg.norm(drawn.base - middle, axis=1).mean()
    rows = oracle.rows(drawn.pattern, drawn.platform, np.eye(3))
    weight = oracle.weight(rows, drawn.mass, (0.0, 0.0, 0.0))
    for depth in DEPTHS * size:
        place = middle - [0.0, 0.0, depth]
        matrix = oracle.wrench_matrix(drawn.base, drawn.platform, place, np.eye(3), drawn.pattern)
        bounds = list(zip(low, high, strict=True))
        if linprog(np.zeros(drawn.cables), A_eq=matrix, b_eq=weight, bounds=bounds, method="highs").status == 0:
            return True
    return False


@pytest.mark.quick("2T-4")
@pytest.mark.parametrize(("pattern", "n"), SIZES)
def test_who_hangs_still_is_who_the_programs_say(pattern, n):
    """Robots that hang and some that cannot, since their smallest tensions are above what the weight asks for."""
    rng, verdicts = np.random.default_rng(n), set()
    for _ in range(3):
        drawn = cable_robots.any_robot(rng, pattern, n, suspended=True)
        force = drawn.mass * cable_robots.GRAVITY
        for fraction in (0.02, 30.0):
            low, high = np.full(n, fraction * force), np.full(n, max(1.5, 1.1 * fraction) * force)
            fault = slack_at_rest(centred(made(drawn))[0], Limits(tension_min=low, tension_max=high))
            assert (fault is None) == hangs(drawn, low, high), (drawn.name, fraction, fault)
            verdicts.add(fault is None)
    assert False in verdicts
