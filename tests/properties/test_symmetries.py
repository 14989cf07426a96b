"""What nature does not notice: the same problem turned, moved, scaled, mirrored, reversed or relabelled."""

import itertools

import numpy as np
import pytest
from conftest import equilateral
from hypothesis import given, settings
from hypothesis import strategies as st

import cspr_jax
from cspr_jax.motion.amplitudes import named
from cspr_jax.robots.model import point_mass

N, EXAMPLES = 64, 10
QUINTIC = named("quintic")
DOWN = np.array([0.0, 0.0, 1.0])
SEEDS = st.integers(0, 2**16)
ANGLES = st.floats(-np.pi, np.pi)


class Problem:
    """A random triangle of spools, tilted, of either labelling, and points around the rest point; reach in z0."""

    def __init__(self, seed, base=None):
        rng = np.random.default_rng(seed)
        angles = np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.6, 0.6, 3)
        triangle = np.stack([np.cos(angles), np.sin(angles), rng.uniform(-0.3, 0.3, 3)], 1) * rng.uniform(0.2, 1.0)
        self.base = triangle[:: rng.choice([-1, 1])] + rng.normal(size=3) if base is None else base
        self.z0, self.mass, self.gravity = rng.uniform(1.2, 2.0), rng.uniform(0.1, 20.0), rng.uniform(1.6, 12.0)
        far = np.array([0.5, 0.5, 0.9]) * self.z0
        offsets = rng.uniform(-far, far, (2, N, 3))
        self.starts, self.ends = self.base.mean(0) + self.z0 * DOWN + offsets

    def answer(self, base=None, starts=None, ends=None, z0=None, **other):
        base, starts, ends = (
            own if v is None else v for v, own in ((base, self.base), (starts, self.starts), (ends, self.ends))
        )
        robot = point_mass.point_mass_robot(base, **{"mass": self.mass, "gravity": self.gravity} | other)
        return cspr_jax.minimum_arcs(robot, ends, start=starts, z0=self.z0 if z0 is None else z0, max_arcs=8)

    def of(self, change):
        """The answer after a change of space that takes robot and points along."""
        return self.answer(change(self.base), change(self.starts), change(self.ends))


def assert_same(one, other, time=1.0):
    """Same arcs and verdicts, margins to 1e-9, durations to rounding."""
    assert np.array_equal(one.arcs, other.arcs)
    assert np.array_equal(one.verdict, other.verdict)
    assert (one.arcs > 0).any()
    np.testing.assert_allclose(one.margin, other.margin, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(one.margin_bound, other.margin_bound, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(one.feasible_at_infinity, other.feasible_at_infinity, rtol=0, atol=1e-11)
    found = one.arcs > 0
    np.testing.assert_allclose(time * one.duration[found], other.duration[found], rtol=1e-10)


def turn(angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return lambda points: points @ matrix.T


@given(SEEDS, ANGLES)
@settings(max_examples=EXAMPLES)
def test_turned_about_the_vertical(seed, angle):
    """North is where the user puts it."""
    problem = Problem(seed)
    assert_same(problem.answer(), problem.of(turn(angle)))


@given(SEEDS)
@settings(max_examples=EXAMPLES)
def test_mirrored(seed):
    """A vertical mirror turns the labelling round; left-handed robots swing as well as right-handed ones."""
    problem = Problem(seed)
    assert_same(problem.answer(), problem.of(lambda points: points * np.array([-1.0, 1.0, 1.0])))


@given(SEEDS, st.tuples(*[st.floats(-20.0, 20.0)] * 3))
@settings(max_examples=EXAMPLES)
def test_moved(seed, offset):
    """The origin is where the user puts it, in height too."""
    problem = Problem(seed)
    assert_same(problem.answer(), problem.of(lambda points: points + np.array(offset)))


@given(SEEDS, st.floats(0.02, 50.0))
@settings(max_examples=EXAMPLES)
def test_scaled(seed, scale):
    """Lengths times s, time times the root of s: a crane and its model have the same arcs and margins."""
    problem = Problem(seed)
    larger = problem.answer(scale * problem.base, scale * problem.starts, scale * problem.ends, scale * problem.z0)
    assert_same(problem.answer(), larger, time=np.sqrt(scale))


@given(SEEDS)
@settings(max_examples=EXAMPLES)
def test_reversed(seed):
    """The way back is the way there, run backwards: accelerations are even in time."""
    problem = Problem(seed)
    assert_same(problem.answer(), problem.answer(starts=problem.ends, ends=problem.starts))


@pytest.mark.parametrize("order", list(itertools.permutations(range(3)))[1:])
def test_relabelled(order):
    """Which cable is called the first changes nothing."""
    problem = Problem(sum(order) + 10 * order[0] + 3)
    assert_same(problem.answer(), problem.answer(base=problem.base[list(order)]))


@given(SEEDS, st.sampled_from([-1, 1]), st.booleans())
@settings(max_examples=EXAMPLES)
def test_symmetries_of_the_equilateral_robot(seed, thirds, mirror):
    """120 degrees and the mirror x -> -x map the spools onto each other: points may be turned alone."""
    problem = Problem(seed, base=equilateral(0.26))
    sides = np.array([-1.0 if mirror else 1.0, 1.0, 1.0])
    third = turn(2.0 * np.pi / 3.0 * thirds)
    starts, ends = third(problem.starts * sides), third(problem.ends * sides)
    assert_same(problem.answer(), problem.answer(starts=starts, ends=ends))


@given(SEEDS, st.floats(0.01, 1000.0), st.floats(0.1, 30.0))
@settings(max_examples=EXAMPLES)
def test_mass_and_gravity(seed, mass, gravity):
    """Mass changes nothing but the tensions; gravity the pace alone, by its root."""
    problem = Problem(seed)
    one = problem.answer()
    heavier = problem.answer(mass=mass)
    for field in ("arcs", "margin", "duration", "verdict"):
        assert np.array_equal(getattr(one, field), getattr(heavier, field))
    assert_same(one, problem.answer(gravity=gravity), time=np.sqrt(problem.gravity / gravity))
