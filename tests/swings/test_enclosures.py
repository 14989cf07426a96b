"""Point masses within an uncertainty, against robots that are simulated one by one."""

import dataclasses

import jax
import numpy as np
import pytest
from support.other_robots import on_balls, uncertain

from cspr_jax.families.platforms.platform_segment import take_segments as some_of
from cspr_jax.families.swings.arcs import arcs_and_segments
from cspr_jax.families.swings.hypocycloid import motion as point_motion
from cspr_jax.families.swings.proof.enclosures import tolerated_by_point_masses
from cspr_jax.families.swings.transitions.oscillations import minimum_oscillations, transitions_to
from cspr_jax.families.swings.transitions.transition import steady
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import planar_robot, point_mass_robot

TAUTEN = np.array([[0.5, 0.0, 0.0], [-0.3, 0.45, 0.0], [-0.2, -0.45, 0.0]])


def in_the_plane(swings):
    """Transitions of two cables in the plane from rest, or swings beside it, feasible as planned."""
    robot = planar_robot([[-0.45, 0.0, 0.0], [0.45, 0.0, 0.0]], mass=0.3)
    problem = Problem(robot, Limits(uncertainty=uncertain(spool_positions=0.01)), named("quintic"))
    planned = problem._replace(limits=Limits())
    targets, z0 = np.array([[0.5, 0.0, 1.1], [0.9, 0.0, 1.3], [-0.7, 0.0, 0.8]]), np.ones(3)
    segments = transitions_to(planned, targets, z0)
    is_steady = np.full(3, swings)
    segments = steady(segments) if swings else segments
    answers = minimum_oscillations(planned, segments, z0, max_arcs=30, steady=is_steady)
    return problem, segments, answers


@pytest.mark.thorough
@pytest.mark.parametrize("swings", [False, True])
def test_no_robot_in_the_plane_within_a_proved_multiple_fails(swings):
    """A guide keeps the mass in the plane, wherever the spools are."""
    problem, segments, answers = in_the_plane(swings)
    which = np.flatnonzero(answers.arcs > 0)
    assert len(which) > 1
    found = tolerated_by_point_masses(problem, some_of(segments, which), answers.arcs[which])
    base, rng = np.asarray(problem.robot.base_points), np.random.default_rng(0)
    assert np.median(found.proved / found.refuted) > 0.9
    for i, proved, refuted in zip(which, *found, strict=True):
        position, _, acceleration = states(problem, segments, answers.arcs, i, 601)
        for size, spread in ((proved, 200), (1.02 * refuted, 2000)):
            others = base + on_balls(rng, (spread, 2), size * 0.01)
            others[: spread // 2, :, 1] = 0.0
            others = base + (others - base) / np.linalg.norm(others - base, axis=2, keepdims=True) * size * 0.01
            least = [tensions(own, 0.3, position, acceleration, plane=(0, 2)).min() for own in others]
            assert min(least) > 0.0 if size == proved else min(least) < 0.0


LEVELS = np.array([[0.9, 0.3, 1.3], [0.2, -0.8, 1.0], [-0.7, 0.5, 0.8], [0.4, 0.4, 1.2], [-1.2, -0.3, 1.1]])


def point_masses(limits, amplitude="quintic"):
    """Motions from one point, feasible as planned."""
    problem = Problem(point_mass_robot((TAUTEN - TAUTEN.mean(0)).tolist(), mass=0.3), limits, named(amplitude))
    planned = problem._replace(limits=dataclasses.replace(limits, uncertainty=None))
    starts = np.tile([0.3, 0.1, 1.1], (len(LEVELS), 1))
    answers, segments = arcs_and_segments(planned, starts, LEVELS, np.ones(len(LEVELS)), max_arcs=30)
    assert (answers.arcs > 0).all()
    return problem, segments, answers


@jax.jit
def _states(segment, amplitude, arcs, tau):
    return jax.vmap(lambda t: point_motion(segment, amplitude, arcs, t))(tau)


def states(problem, segments, arcs, i, samples=2001):
    found = _states(some_of(segments, i), problem.amplitude, np.asarray(float(arcs[i])), np.linspace(0.0, 1.0, samples))
    return tuple(map(np.asarray, found))


def tensions(base, mass, position, acceleration, plane=(0, 1, 2)):
    """Of a point mass by a solver, N; in a plane of axes in which it is kept."""
    rays = np.asarray(position)[:, None] - base
    units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    force = np.asarray(acceleration) - [0.0, 0.0, 9.81]
    axes = list(plane)
    return mass * np.linalg.solve(-np.swapaxes(units[..., axes], 1, 2), force[..., axes, None])[..., 0]


def test_no_point_mass_within_a_proved_multiple_fails():
    limits = Limits(uncertainty=uncertain(spool_positions=0.01))
    problem, segments, answers = point_masses(limits)
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    base, rng = np.asarray(problem.robot.base_points), np.random.default_rng(0)
    assert np.median(found.proved / found.refuted) > 0.9
    for i, (proved, refuted) in enumerate(zip(*found, strict=True)):
        position, _, acceleration = states(problem, segments, answers.arcs, i, 601)
        for _ in range(50):
            other = base + on_balls(rng, (3,), proved * 0.01)
            assert tensions(other, 0.3, position, acceleration).min() > 0.0
        # The multiples are no formality: a search for bad robots comes near to a slack cable.
        some = position[::4], acceleration[::4]
        worst = min(tensions(base + own, 0.3, *some).min() for own in climbed(base, *some, 0.01 * refuted))
        assert worst < 0.25 * tensions(base, 0.3, *some).min()


def climbed(base, position, acceleration, radius):
    """Displacements of a length that lower the least tension, step by step."""
    rng = np.random.default_rng(5)
    for _ in range(8):
        own = on_balls(rng, (3,), radius)
        for _ in range(15):
            slope = np.zeros((3, 3))
            for j, i in np.ndindex(3, 3):
                step = np.zeros((3, 3))
                step[j, i] = 1e-7
                both = [tensions(base + own + s * step, 0.3, position, acceleration).min() for s in (1.0, -1.0)]
                slope[j, i] = both[0] - both[1]
            own = -radius * slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-300)
        yield own


# One program for all tests of limits: each tightens those it is about.
LOOSE = {
    "tension_min": 1e-6,
    "tension_max": 1e6,
    "cable_length_max": 1e3,
    "cable_speed_max": 1e3,
    "cable_acceleration_max": 1e3,
}


def limited(uncertainty, **tight):
    return Limits(**{name: np.full(3, value) for name, value in (LOOSE | tight).items()}, uncertainty=uncertainty)


@pytest.mark.thorough
def test_a_factor_of_the_mass_is_that_of_the_tensions():
    """T is proportional to the mass: the multiple follows from the extremes of the planned tensions."""
    factor = 1.05
    without = point_masses(Limits())
    extremes = []
    for i in range(len(LEVELS)):
        position, _, acceleration = states(*without[:2], without[2].arcs, i, 20_001)
        own = tensions(np.asarray(without[0].robot.base_points), 0.3, position, acceleration)
        extremes.append((own.min(), own.max()))
    low, high = np.array(extremes).T
    limits = limited(uncertain(mass_factor=factor), tension_min=0.5 * low.min(), tension_max=1.7 * high.max())
    problem, segments, answers = point_masses(limits)
    assert (answers.arcs == without[2].arcs).all()
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    expected = np.minimum(np.log(low / (0.5 * low.min())), np.log(1.7 * high.max() / high)) / np.log(factor)
    assert found.proved == pytest.approx(expected, rel=0.015)
    assert (found.proved <= expected * (1.0 + 1e-5)).all()
    assert (found.refuted >= expected * (1.0 - 1e-4)).all()


@pytest.mark.thorough
def test_a_limit_of_lengths_gives_way_by_as_much_as_spools_move():
    without = point_masses(Limits())
    longest = []
    for i in range(len(LEVELS)):
        position = states(*without[:2], without[2].arcs, i)[0]
        rays = np.asarray(position)[:, None] - np.asarray(without[0].robot.base_points)
        longest.append(np.linalg.norm(rays, axis=2).max())
    limits = limited(uncertain(spool_positions=0.001), cable_length_max=max(longest) + 0.002)
    problem, segments, answers = point_masses(limits)
    i = int(np.argmax(longest))
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    assert 0.98 * 2.0 < found.proved[i] <= 2.01
    assert found.refuted[i] == pytest.approx(2.0, rel=0.01)


@pytest.mark.thorough
def test_speeds_and_accelerations_of_other_robots_keep_their_limits():
    without = point_masses(Limits())
    base, rng = np.asarray(without[0].robot.base_points), np.random.default_rng(3)

    planned = [states(*without[:2], without[2].arcs, i, 601) for i in range(len(LEVELS))]

    def fastest(spools, i):
        position, velocity, acceleration = planned[i]
        rays = position[:, None] - spools
        lengths = np.linalg.norm(rays, axis=2)
        rate = np.einsum("nki,ni->nk", rays, velocity) / lengths
        second_derivative = (
            np.sum(velocity**2, axis=1)[:, None] + np.einsum("nki,ni->nk", rays, acceleration) - rate**2
        ) / lengths
        return np.abs(rate).max(), np.abs(second_derivative).max()

    speed, second_derivative = 1.05 * np.array([fastest(base, i) for i in range(len(LEVELS))]).max(0)
    limits = limited(uncertain(spool_positions=0.01), cable_speed_max=speed, cable_acceleration_max=second_derivative)
    problem, segments, answers = point_masses(limits)
    found = tolerated_by_point_masses(problem, segments, answers.arcs)
    assert (found.proved > 0.3).all()
    assert (found.proved / found.refuted).min() > 0.5
    for i, proved in enumerate(found.proved):
        for _ in range(30):
            own = fastest(base + on_balls(rng, (3,), proved * 0.01), i)
            assert own[0] <= speed * (1.0 + 1e-5)
            assert own[1] <= second_derivative * (1.0 + 1e-5)
