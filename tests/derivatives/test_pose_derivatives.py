"""Derivatives of values at poses by every number of random robots, against differences that know their own error."""

import dataclasses
import itertools

import jax
import numpy as np
import pytest
from support.cable_robots import degenerate
from support.derivatives import compared, drawn, moved
from support.workspaces import made

import cspr_jax
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS

FUNCTIONS = {
    "lengths": cspr_jax.pose_lengths,
    "matrix": cspr_jax.pose_wrench_matrix,
    "tensions": cspr_jax.pose_tensions,
    "margin": cspr_jax.pose_margin,
    "frequencies": cspr_jax.pose_frequencies,
}
EXTRA = (0, 1, 2, 3)  # cables beyond degrees of freedom; those with one have pulleys
# Robots of each case; natural frequencies exist only where all cables are taut, and some margins are unbounded.
MANY, FEW = 250, 4
TIMES = {"frequencies": 6, "margin": 2}
PROMISED = 1e-6
# Share of derivatives along which no kink lies within the smallest step.
SMOOTH = 0.97
ALL = [(name, pattern, extra, "many") for name, pattern, extra in itertools.product(FUNCTIONS, PATTERNS, EXTRA)]
SOME = [(n, p, 1 + (i + k) % 2, "few") for i, n in enumerate(FUNCTIONS) for k, p in enumerate(PATTERNS)]
CI = ["-".join(map(str, case)) for case in SOME]
QUICK = ("lengths-3T-1-few", "matrix-2R3T-2-few", "tensions-1T-1-few", "margin-3T-2-few", "frequencies-2T-2-few")
# The package takes no robots with fewer cables than degrees of freedom, nor those that no cable turns.
REFUSED = ("too few cables, in their plane", "planar, one attachment point", "four cables at a point")
SYMMETRIC = [case for case in degenerate() if case.name not in REFUSED]


@pytest.mark.quick(*QUICK)
@pytest.mark.ci(*CI)
@pytest.mark.parametrize(
    ("name", "pattern", "extra", "count"), SOME + ALL, ids=["-".join(map(str, case)) for case in SOME + ALL]
)
def test_derivatives_are_differences(name, pattern, extra, count):
    """By the reverse mode under vmap over robots; a number of which a value does not depend has the derivative 0."""
    number = MANY if count == "many" else FEW
    robots, numbers = drawn(pattern, PATTERNS[pattern].dof + extra, number * TIMES.get(name, 1), wheels=extra == 1)
    errors, smooth, held = compared(FUNCTIONS[name], robots, numbers)
    worst = max(errors, key=errors.get)
    print(f"{name} {pattern} {extra} {held} {errors[worst]:.1e} {worst} {min(smooth.values()):.3f}")  # with pytest -s
    assert held >= (0.2 * number if count == "many" else 1)
    assert max(errors.values()) <= PROMISED, errors
    assert min(smooth.values()) >= (SMOOTH if count == "many" else 0.0), smooth


@pytest.mark.quick("margin")
@pytest.mark.parametrize("name", FUNCTIONS)
def test_jit_vmap_and_both_modes_agree(name):
    """One robot after the other, all under vmap, and both modes; the same numbers from NumPy and from tracers."""
    robots, numbers = drawn("3T", 5, 5, seed=3)

    def value(own, robot):
        return FUNCTIONS[name](*moved(robot, own))

    together = jax.jit(jax.vmap(value))(numbers, robots)
    forward = jax.vmap(jax.jacfwd(value))(numbers, robots)
    backward = jax.vmap(jax.jacrev(value))(numbers, robots)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9), forward, backward)
    for k in range(5):
        own, robot = jax.tree.map(lambda x, k=k: x[k], (numbers, robots))
        np.testing.assert_allclose(value(own, robot), together[k], rtol=1e-10, atol=1e-10)
        alone = jax.jacrev(value)(own, robot)
        jax.tree.map(lambda a, b, k=k: np.testing.assert_allclose(a, b[k], rtol=1e-8, atol=1e-8), alone, backward)


def test_values_are_those_of_searches():
    """On a platform that turns, with z up, its mass centre away from its origin."""
    robots, numbers = drawn("3R3T", 8, 6, seed=5)
    for k in range(6):
        robot, position, turn = moved(*jax.tree.map(lambda x, k=k: x[k], (robots, numbers)))
        robot = dataclasses.replace(robot, centre_of_mass=np.array([0.1, -0.2, 0.15]))
        for point in ("origin", "mass-centre"):
            poses = {"point": point}
            margin = cspr_jax.workspace(robot, [position], [turn], **poses).margin[0]
            np.testing.assert_allclose(cspr_jax.pose_margin(robot, position, 2.0 * turn, **poses), margin, atol=1e-9)
            rest = cspr_jax.natural_frequencies(robot, [position], [turn], **poses)
            ours = cspr_jax.pose_frequencies(robot, position, turn, **poses)
            np.testing.assert_allclose(ours, rest.frequencies[0], rtol=1e-9)
            stiff = cspr_jax.stiffness(robot, [position], [turn], **poses)
            tensions = cspr_jax.pose_tensions(robot, position, turn, **poses)
            if np.isfinite(rest.frequencies).all():
                np.testing.assert_allclose(tensions, stiff.tensions[0], rtol=1e-9)
                matrix = np.asarray(cspr_jax.pose_wrench_matrix(robot, position, turn, **poses))
                lengths = cspr_jax.pose_lengths(robot, position, turn, **poses)
                springs = (robot.axial_stiffness + np.asarray(tensions)) / np.asarray(lengths)
                np.testing.assert_allclose((matrix * springs) @ matrix.T, stiff.elastic[0], rtol=1e-9, atol=1e-7)


def test_limits_that_symmetry_alone_reaches_are_followed():
    """On a guide with two cables up and two down all limits are reached together, at a distance r, and smoothly.

    r = (h1 + h3 - l2 - l4 - m g) / 4, with tensions h - r above and l + r below.
    """
    base = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, -2.0], [0.0, 0.0, 2.1], [0.0, 0.0, -2.1]])
    robot = cspr_jax.point_mass(base, mass=1.0, gravity=5.0, pattern="1T", z_axis="up")

    def tensions(highest):
        limits = Limits(tension_min=np.full(4, 0.1), tension_max=highest)
        return cspr_jax.pose_tensions(dataclasses.replace(robot, limits=limits), np.zeros(3))

    quarter = np.full((4, 1), 0.25) * [1.0, 0.0, 1.0, 0.0]
    signs = np.array([[-1.0], [1.0], [-1.0], [1.0]])
    highest = np.full(4, 8.0)
    np.testing.assert_allclose(tensions(highest), [8.0 - 2.7, 2.8, 8.0 - 2.7, 2.8], atol=1e-12)
    wanted = signs * quarter + np.diag([1.0, 0.0, 1.0, 0.0])
    for jacobian in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(jacobian(tensions)(highest), wanted, atol=1e-12)


def _one_sided(value, at, direction):
    # Derivatives to the right and to the left, by Richardson's extrapolation.
    middle, ends = value(at), []
    for sign in (1.0, -1.0):
        rates = [sign * (value(at + sign * h * direction) - middle) / h for h in (1e-4, 5e-5, 2.5e-5)]
        first = [2.0 * b - a for a, b in itertools.pairwise(rates)]
        ends.append((4.0 * first[1] - first[0]) / 3.0)
    return ends


@pytest.mark.quick("box", "planar square")
@pytest.mark.parametrize("case", SYMMETRIC, ids=[case.name for case in SYMMETRIC])
def test_at_kinks_a_derivative_is_between_both_sides(case):
    """In symmetric poses many facets are equally near: by each coordinate, and to and fro between."""
    robot = cspr_jax.with_cables(made(case), axial_stiffness=1e5)
    limits = Limits(tension_min=case.low, tension_max=case.high)
    robot = jax.tree.map(np.asarray, robot.__class__(**{**vars(robot), "limits": limits}))
    position, turn = case.pose(np.random.default_rng(0))[0], np.array([1.0, 0.0, 0.0, 0.0])
    body = (turn,) if PATTERNS[case.pattern].is_body else ()
    value = jax.jit(lambda at: cspr_jax.pose_margin(robot, at, *body))
    matrix = np.asarray(cspr_jax.pose_wrench_matrix(robot, position, *body))
    if np.linalg.matrix_rank(matrix) < len(matrix):
        pytest.skip("the cables do not span all wrenches")
    assert np.isfinite(float(value(position)))
    gradient = np.asarray(jax.grad(value)(position))
    of_robot = jax.grad(lambda one: cspr_jax.pose_margin(one, position, *body), allow_int=True)(robot)
    assert all(np.isfinite(x).all() for x in (gradient, *jax.tree.leaves(of_robot)))
    forces = PATTERNS[case.pattern].forces
    for direction in np.eye(3)[list(forces)] if forces else ():
        right, left = _one_sided(lambda at: float(value(at)), position, direction)
        low, high = min(right, left), max(right, left)
        assert low - 1e-5 <= gradient @ direction <= high + 1e-5, (right, left, gradient @ direction)


@pytest.mark.quick("3T-4")
@pytest.mark.parametrize(("pattern", "count"), [("2T", 2), ("2T", 3), ("3T", 4)], ids=["2T-2", "2T-3", "3T-4"])
def test_at_the_kink_of_two_facets_a_derivative_is_one_sided(pattern, count):
    """A point mass where the facet that is nearest changes, between two poses that were drawn until it does."""
    robots, numbers = drawn(pattern, count, 40, seed=7)
    rng, seen = np.random.default_rng(1), 0
    value = jax.jit(lambda own, robot: cspr_jax.pose_margin(*moved(robot, own)))
    gradient = jax.jit(jax.grad(value))
    for k in range(40):
        own, robot = jax.tree.map(lambda x, k=k: x[k], (numbers, robots))
        direction = rng.uniform(-1.0, 1.0, 3) * (np.ptp(robot.base_points, axis=0) > 0.0)

        def along(s, own=own, robot=robot, direction=direction):
            at = {**own, "position": own["position"] + s * direction}
            return float(value(at, robot)), float(np.asarray(gradient(at, robot)["position"]) @ direction)

        samples = [along(s)[1] for s in np.linspace(0.0, 0.5, 51)]
        jumps = np.abs(np.diff(samples))
        first = int(jumps.argmax())
        if not np.isfinite(along(0.01 * first)[0]) or jumps[first] < 0.1 * np.abs(samples).max():
            continue
        low, high = 0.01 * first, 0.01 * (first + 1)
        for _ in range(60):
            middle = 0.5 * (low + high)
            is_low = abs(along(middle)[1] - samples[first]) < abs(along(middle)[1] - samples[first + 1])
            low, high = (middle, high) if is_low else (low, middle)
        right, left = _one_sided(lambda at: along(float(at))[0], high, 1.0)
        if not np.isfinite(right + left):  # nothing bounds the margin beyond
            continue
        assert min(abs(along(high)[1] - right), abs(along(high)[1] - left)) < 1e-5 * (1.0 + abs(right) + abs(left))
        seen += abs(right - left) > 0.05 * abs(left)
    assert seen >= 3
