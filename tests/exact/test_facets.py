"""Margins of redundant cables by facets, against linear programs."""

import flint
import numpy as np
import pytest
from scipy.optimize import linprog

from cspr_jax.verification.exact.facets import facet_slacks
from cspr_jax.verification.exact.kinematics import balls


def largest_margin(matrix, wrench, low, high):
    """Largest distance that tensions which balance a wrench can all have from their limits."""
    count = matrix.shape[1]
    sides = [np.column_stack([-np.eye(count), np.ones(count)])]
    rest = [-low]
    if high is not None:
        sides.append(np.column_stack([np.eye(count), np.ones(count)]))
        rest.append(high)
    answer = linprog(
        np.append(np.zeros(count), -1.0),
        A_ub=np.vstack(sides),
        b_ub=np.concatenate(rest),
        A_eq=np.column_stack([matrix, np.zeros(len(matrix))]),
        b_eq=wrench,
        bounds=(None, None),
    )
    assert answer.success
    return -answer.fun


def series(numbers):
    """Numbers as series that are constant."""
    return [flint.arb_series([x]) for x in balls(numbers)]


@pytest.mark.parametrize("dof", [2, 3, 6])
@pytest.mark.parametrize("more", [1, 2])
@pytest.mark.parametrize("is_limited", [True, False])
def test_margins_by_facets(dof, more, is_limited):
    rng = np.random.default_rng([dof, more, is_limited])
    for _ in range(20 if dof < 6 else 3):
        matrix = rng.normal(size=(dof, dof + more))
        matrix[0] = np.abs(matrix[0])  # all cables pull to one side, so that without largest tensions there are facets
        low, high = rng.uniform(0.5, 2.0, dof + more), rng.uniform(5.0, 9.0, dof + more)
        wrench = matrix @ rng.uniform(-2.0, 12.0, dof + more)
        margin = largest_margin(matrix, wrench, low, high if is_limited else None)
        columns = [series(column) for column in matrix.T]
        slacks = facet_slacks(columns, series(wrench), balls(low), balls(high) if is_limited else None)
        smallest = min(float(slack[0].mid()) for slack, exists in slacks if exists)
        assert smallest == pytest.approx(margin, abs=1e-7)
