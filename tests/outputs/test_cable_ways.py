"""Ways of cables in pictures: around their pulleys as kernels have them, and in what pages send to browsers."""

import jax
import numpy as np
import pytest
from support.browsers import unpacked

from cspr_jax.config.robot import RobotFile
from cspr_jax.outputs.plots.pages.motions import motion_content
from cspr_jax.outputs.plots.robots.robot_at import ON_ARC, cable_points
from cspr_jax.robots.model.pulleys import exits

BASE = [[2.0, 0.0, 3.0], [-1.0, 2.0, 3.0], [-1.0, -2.0, 3.0]]
RADII, AXES = [0.1, 0.4, 0.0], [[0.0, 0.0, 1.0], [0.4, -0.7, -0.9], [0.0, 1.0, 0.0]]


def robot(**keys) -> RobotFile:
    return RobotFile(name="wheels", base_points=BASE, mass=1.0, z_axis="up", **keys)


@pytest.mark.parametrize("axes", [None, AXES])
def test_ways_are_those_of_the_kernels(axes):
    places = np.random.default_rng(0).uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0], (50, 1, 3))
    attached = np.broadcast_to(places, (50, 3, 3))
    ways = cable_points(robot(pulley_radius=RADII, pulley_axes=axes), attached)
    assert ways.shape == (50, 3, ON_ARC + 1, 3)
    units = np.broadcast_to([0.0, 0.0, 1.0] if axes is None else axes, (3, 3))
    units = units / np.linalg.norm(units, axis=1, keepdims=True)
    exits_to = jax.jit(jax.vmap(lambda target: exits(np.array(BASE), units, np.array(RADII), target)))
    way = jax.tree.map(np.asarray, exits_to(attached))
    np.testing.assert_allclose(ways[:, :, 0], np.broadcast_to(BASE, (50, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(ways[:, :, -2], way.point, atol=1e-12)
    np.testing.assert_array_equal(ways[:, :, -1], attached)
    chords = np.linalg.norm(np.diff(ways[:, :, :-1], axis=2), axis=3)
    # A chord of an angle x on a circle of radius r has the length 2 r sin(x / 2).
    steps = way.wrapped / (ON_ARC - 1) / np.maximum(RADII, 1e-300)
    np.testing.assert_allclose(
        chords, (2.0 * np.array(RADII) * np.sin(0.5 * steps))[..., None] + 0.0 * chords, atol=1e-12
    )


def test_cables_without_pulleys_are_straight():
    attached = np.zeros((4, 3, 3))
    np.testing.assert_array_equal(cable_points(robot(), attached)[:, :, 0], np.broadcast_to(BASE, (4, 3, 3)))
    assert cable_points(robot(), attached).shape == (4, 3, 2, 3)


def test_pages_have_the_arcs():
    columns = {"t": np.linspace(0.0, 1.0, 5), "position": np.linspace([0.0, 0.0, 1.0], [0.2, 0.1, 1.2], 5)}
    columns |= {"tension": np.ones((5, 3))}
    file = robot(pulley_radius=RADII)
    page = motion_content("motion", columns, {}, file, None)
    ways = cable_points(file, np.repeat(columns["position"][:, None], 3, axis=1))
    assert page["onArc"] == ON_ARC - 1
    np.testing.assert_allclose(unpacked(page["arcs"]).reshape(5, 3, -1, 3), ways[:, :, 1:-1], rtol=1e-6)
    assert motion_content("motion", columns, {}, robot(), None)["onArc"] == 0
