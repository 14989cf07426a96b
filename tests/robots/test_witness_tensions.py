"""Bounds of cables, balances and tensions over blocks against instants, and against linear programs by HiGHS."""

from functools import partial

import jax
import numpy as np
import pytest
from scipy.optimize import linprog
from support.splines import random_spline

import cspr_jax
from cspr_jax.curves.spline import SplineBatch
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.robots import cables
from cspr_jax.robots.bounds.state_bounds import balance_bounds, cable_bounds
from cspr_jax.robots.bounds.witness_tensions import witness_tensions
from cspr_jax.robots.statics.kernel_axes import centred

S = np.linspace(-1.0, 1.0, 9)
# Of each robot a place and how far motions go from there, m, and the tilt.
ROBOTS = {
    "transition-planar": ((0.0, 0.0, 2.0), 0.3, 0.0),
    "prototype": ((0.0, 0.0, 1.0), 0.1, 0.0),
    "boralugoda-rectangle": ((0.0, 0.0, 2.0), 0.4, 0.0),
    "laval-mssm": ((0.0, 0.0, 1.7), 0.2, 0.05),
    "cogiro": ((0.0, 0.0, 4.0), 1.0, 0.05),
}


@jax.jit
def EXACT(robot, spline, taus):
    unit = cables.wrench_units(robot)

    def one(tau):
        state = spline.state(tau)
        balance = robot.wrench_matrix(state) / unit[:, None], robot.inertial_wrench(state) / unit
        return *cables.cable_motion(robot, state), *balance

    return jax.vmap(jax.vmap(one))(taus)


@jax.jit
def BOUNDS(robot, limits, states):
    unit = 1.0 / cables.wrench_units(robot)

    def one(state):
        known = cable_bounds(robot, state)
        matrix, wrench = balance_bounds(robot, state, known)
        matrix, wrench = matrix * unit[:, None], wrench * unit
        return known.length, known.rate, known.acceleration, matrix, wrench, witness_tensions(matrix, wrench, *limits)

    return jax.vmap(one)(states)


def results(name: str, seed: int, count: int, low: float, high: float, *, parabolas: bool = False):
    """Exact balances at instants of random blocks, and the bounds of these blocks."""
    robot = centred(cspr_jax.load_robot(name))[0]
    middle, size, tilt = ROBOTS[name]
    spline, table = random_spline(seed, middle=middle, size=size, tilt=tilt)
    edges = np.linspace(0.0, table.x[-1], count + 1)
    if parabolas:  # of blocks within one piece
        parts = np.linspace(table.x[:-1], table.x[1:], count // (len(table.x) - 1), endpoint=False)
        edges = np.append(parts.T.ravel(), table.x[-1])
    times = 0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * S
    limits = np.full(robot.n_cables, low), np.full(robot.n_cables, high)
    instants = in_batches(partial(EXACT, robot, spline), times / table.x[-1], batch_size=10)
    several = SplineBatch([spline])
    states = several.bounds(np.zeros(count, int), edges[:-1], edges[1:], parabolas=parabolas)
    return instants, in_batches(partial(BOUNDS, robot, limits), states, batch_size=10)


def largest_distance(matrix, wrench, low: float, high: float) -> float:
    """Largest r such that tensions r from their limits balance, by a linear program."""
    count = matrix.shape[1]
    above = np.concatenate([-np.eye(count), np.ones((count, 1))], axis=1)
    rows, sides = [above], [np.full(count, -low)]
    if np.isfinite(high):
        rows.append(np.concatenate([np.eye(count), np.ones((count, 1))], axis=1))
        sides.append(np.full(count, high))
    answer = linprog(
        np.append(np.zeros(count), -1.0),
        np.concatenate(rows),
        np.concatenate(sides),
        np.concatenate([matrix, np.zeros((len(matrix), 1))], axis=1),
        wrench,
        bounds=[(None, None)] * (count + 1),
    )
    return {0: lambda: answer.x[-1], 2: lambda: -np.inf, 3: lambda: np.inf}[answer.status]()


# Kernels of redundant cables take long to compile.
EACH = [
    name if name in ("prototype", "laval-mssm") else pytest.param(name, marks=pytest.mark.thorough) for name in ROBOTS
]


@pytest.mark.quick("laval-mssm-True")
@pytest.mark.parametrize("parabolas", [False, True])
@pytest.mark.parametrize("name", EACH)
def test_bounds_of_cables_and_balances(name, parabolas):
    for seed in range(3):
        for count in (12, 78):
            instants, found = results(name, seed, count, 0.0, np.inf, parabolas=parabolas)
            for values, band in zip(instants, found[:5], strict=True):
                s = S.reshape(1, -1, *(1,) * (values.ndim - 2))
                curve = band.square[:, None] * s**2 if parabolas else 0.0
                over = np.abs(values - band.middle[:, None] - band.linear[:, None] * s - curve) - band.radius[:, None]
                assert np.nanmax(over) < 1e-11 * np.abs(values).max()


@pytest.mark.parametrize("parabolas", [False, True])
@pytest.mark.parametrize("name", EACH)
@pytest.mark.parametrize("high", [np.inf, 60.0])
def test_margins_of_tensions_against_highs(name, high, parabolas):
    scale = 30.0 if name == "cogiro" else 1.0
    proved = 0
    for seed in range(2):
        low, top = 1.0 * scale, high * scale
        instants, found = results(name, seed, 42 if parabolas else 40, low, top, parabolas=parabolas)
        matrices, wrenches, tensions = *instants[3:], found[5]
        for i in range(0, 40, 3):
            exact = [largest_distance(matrices[i, j], wrenches[i, j], low, top) for j in (0, 4, 8)]
            allowance = 1e-6 * (1.0 + np.abs(wrenches[i]).max())
            assert min(exact) >= tensions.margin_low[i] - allowance
            assert max(exact) <= tensions.margin_high[i] + allowance
            proved += bool(tensions.margin_low[i] > 0.0 or tensions.margin_high[i] < 0.0)
    # Most blocks are decided at once.
    assert proved >= 14


@pytest.mark.parametrize("parabolas", [False, True])
@pytest.mark.parametrize("name", ["prototype", "laval-mssm"])
def test_the_only_tensions(name, parabolas):
    """On as many cables as components the bounds hold the tensions themselves."""
    instants, found = results(name, 4, 78, 0.0, np.inf, parabolas=parabolas)
    matrices, wrenches, tensions = *instants[3:], found[5]
    exact = np.linalg.solve(matrices, wrenches[..., None])[..., 0]
    over = exact - tensions.tension.middle[:, None] - tensions.tension.linear[:, None] * S[:, None]
    over = np.abs(over - (tensions.tension.square[:, None] * S[:, None] ** 2 if parabolas else 0.0))
    known = tensions.is_regular
    assert known.mean() > 0.9
    assert (over <= tensions.tension.radius[:, None] + 1e-9 * np.abs(exact).max())[known].all()


def loose(middle, radius) -> AffineBounds:
    middle = np.asarray(middle, float)
    return AffineBounds(middle, np.zeros_like(middle), np.full_like(middle, radius))


@pytest.mark.parametrize(("pull", "load"), [(0.05, 0.1), (0.3, 0.02)])
def test_wide_bounds_hold_the_quotients_at_their_ends(pull, load):
    """Cables along one axis, whose pulls and load are known to so much: one alone, and two that share the load."""
    one = jax.jit(witness_tensions)(loose([[1.0]], pull), loose([1.0], load), np.zeros(1), np.full(1, np.inf))
    assert float(one.tension.high()[0]) == pytest.approx((1.0 + load) / (1.0 - pull), rel=1e-12)
    for sign, ends in ((1.0, (1.0 + load) / (2.0 - 2.0 * pull)), (-1.0, (load - 1.0) / (2.0 + 2.0 * pull))):
        two = jax.jit(witness_tensions)(loose([[1.0, 1.0]], pull), loose([sign], load), np.zeros(2), np.full(2, np.inf))
        assert ends <= float(two.margin_high) <= ends + 0.1 * abs(ends)


@pytest.mark.parametrize(("parabolas", "least", "most"), [(False, 3.0, 5.0), (True, 6.0, 10.0)])
def test_how_fast_bounds_of_tensions_shrink(parabolas, least, most):
    """With the square of the length of a block around lines, with the third power around parabolas."""
    radii = [
        np.nanmedian(results("prototype", 4, count, 0.0, np.inf, parabolas=parabolas)[1][5].tension.radius)
        for count in (120, 240)
    ]
    assert least < radii[0] / radii[1] < most
