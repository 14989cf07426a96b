"""Robots of any number of cables: what they are, their wrenches, and what needs as many cables as freedoms."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import TILTED, equilateral
from oracles import platform as oracle

from cspr_jax.errors import InputError
from cspr_jax.robots import force_balance, wrench_balance
from cspr_jax.robots.platform import platform_robot
from cspr_jax.robots.point_mass import planar_robot, plane_normal, point_mass_robot
from cspr_jax.robots.robot import check_determined
from cspr_jax.robots.state import State

RNG = np.random.default_rng(5)
RING = np.array([[np.cos(a), np.sin(a), 0.1 * np.sin(3.0 * a)] for a in np.arange(8) * 0.7])
BODY = {"mass": 2.0, "inertia": np.diag([0.02, 0.03, 0.04])}


def platform(n_cables, **more):
    turned = 0.3 * RING[:n_cables] @ oracle.matrix(np.array([0.9, 0.1, -0.2, 0.3])).T
    return platform_robot(2.0 * RING[:n_cables], turned, **BODY, **more)


ROBOTS = {
    "planar": planar_robot([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], mass=0.4),
    "planar of four": planar_robot([[1, 0, -1], [-1, 0, -0.8], [-1.1, 0, 1], [0.9, 0, 1.2]], mass=0.4),
    "three": point_mass_robot(TILTED, mass=0.7),
    "four": point_mass_robot(RING[:4], mass=0.7),
    "eight": point_mass_robot(RING, mass=0.7),
    "six": platform(6),
    "seven": platform(7),
    "platform of eight": platform(8),
}


def state(robot, rng):
    """A random state below the spools."""
    place = np.array([0.2, 0.3, 1.3]) + 0.2 * rng.normal(size=3)
    velocity, acceleration, omega, spin = rng.normal(size=(4, 3))
    if robot.dof == 2:
        place[1] = velocity[1] = acceleration[1] = 0.0
    if robot.dof < 6:
        return State(*map(jnp.asarray, (place, velocity, acceleration)))
    rotation = oracle.matrix(np.array([0.9, 0.2, 0.1, -0.1]))
    return State(*map(jnp.asarray, (place, velocity, acceleration, rotation, omega, spin)))


def tensions(robot, at):
    if robot.dof == 6:
        return wrench_balance.tensions(robot, at)
    return force_balance.tensions(robot, at.position, at.acceleration)


@pytest.mark.parametrize("name", ROBOTS)
def test_wrenches(name):
    """W t = w: of as many cables as freedoms with the tensions that the balance gives, of more with the least ones."""
    robot, rng = ROBOTS[name], np.random.default_rng(1)
    for _ in range(5):
        at = state(robot, rng)
        matrix, wrench = np.asarray(robot.wrench_matrix(at)), np.asarray(robot.inertial_wrench(at))
        assert matrix.shape == (robot.dof, robot.n_cables) and wrench.shape == (robot.dof,)
        if robot.n_cables == robot.dof:
            pull = np.asarray(tensions(robot, at))
        else:
            pull = np.linalg.lstsq(matrix, wrench, rcond=None)[0]
        np.testing.assert_allclose(matrix @ pull, wrench, atol=1e-11 * (1.0 + np.abs(pull).sum()))
        rays = np.asarray(robot.base_points - at.position)
        if robot.dof == 6:
            rays = rays - np.asarray(robot.platform_points) @ np.asarray(at.rotation).T
        units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        force = units.T[[0, 2]] if robot.dof == 2 else units.T
        np.testing.assert_allclose(matrix[:3], force, atol=1e-14)


@pytest.mark.parametrize("name", ROBOTS)
def test_freedoms_are_known_when_compiled(name):
    """What a robot is does not come from the shape of its arrays, and stays when it is changed or mapped over."""
    robot = ROBOTS[name]
    many = jax.tree.map(lambda leaf: np.stack([leaf, leaf]), robot)
    assert (many.dof, many.n_cables) == (robot.dof, robot.n_cables)
    assert dataclasses.replace(robot, mass=jnp.asarray(2.0)).dof == robot.dof
    assert jax.jit(lambda robot: jnp.asarray(robot.dof))(robot) == robot.dof


@pytest.mark.parametrize("name", [name for name, robot in ROBOTS.items() if robot.n_cables > robot.dof])
def test_tensions_need_as_many_cables_as_freedoms(name):
    """More cables share a wrench in many ways: no number is given for one of them."""
    robot = ROBOTS[name]
    for refused in (check_determined, lambda robot: tensions(robot, state(robot, RNG))):
        with pytest.raises(InputError, match=rf"base_points: {robot.n_cables} points: must be {robot.dof} \(what"):
            refused(robot)


def test_the_plane_of_many_spools():
    """The least-squares plane; of spools in one plane it is that plane, however many."""
    slope = np.array([0.2, -0.1])
    points = np.c_[RING[:, :2], RING[:, :2] @ slope]
    points -= points.mean(0)
    wanted = [*-slope, 1.0]
    for count in (3, 5, 8):
        some = points[:count] - points[:count].mean(0)
        np.testing.assert_allclose(plane_normal(point_mass_robot(some, mass=1.0)), wanted, atol=1e-12)
    line = np.array([[x, 0.0, 0.3 * x] for x in (-1.0, -0.5, 0.5, 1.0)])
    np.testing.assert_allclose(plane_normal(planar_robot(line, mass=1.0)), [-0.3, 0.0, 1.0], atol=1e-12)


LINE = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [3.0, 3.0, 3.0]]
UPRIGHT = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("make", "points", "line"),
    [
        (point_mass_robot, equilateral(1.0)[:2], "base_points: 2 points: must be 3 or more, one a cable"),
        (planar_robot, [[1.0, 0.0, 0.0]], "base_points: 1 points: must be 2 or more, one a cable"),
        (point_mass_robot, LINE, "not all on one line"),
        (point_mass_robot, UPRIGHT, "plane is not vertical"),
        (point_mass_robot, np.zeros((3, 2)), "three coordinates"),
        (planar_robot, [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "not on a vertical line"),
        (planar_robot, [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, 2.0]], "not on a vertical line"),
        (planar_robot, [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.1]], "two spools on a level line"),
        (lambda points, mass: platform_robot(points, RING[:6], **BODY), RING[:5], "base_points: 5 points: must be 6"),
        (lambda points, mass: platform_robot(points, RING[:6], **BODY), RING, "platform_points: 6 points: must be 8"),
        (lambda points, mass: platform_robot(RING, points, **BODY), np.tile(RING[0], (8, 1)), "or coincident"),
    ],
)
def test_geometry_that_is_none(make, points, line):
    with pytest.raises(InputError, match=line):
        make(points, mass=1.0)
