"""Obstacles and shapes of platforms in plans: the scene that kernels take."""

from pathlib import Path

import numpy as np
import pytest

import cspr_jax
from cspr_jax.build.scenes import build_scene, robot_scene
from cspr_jax.config.plan import read_plan
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.shapes import hull, is_within, rotation_matrix
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.statics.reference_pose import aligned

PLAN = """schema = 1
robot = "{robot}"
family = "hypocycloid-standard"
z0 = 1.7
{more}
[[pose]]
rest = true
[[pose]]
position = [0.1, 0.05, 1.5]
"""
BALL = '[[obstacle]]\nkind = "sphere"\ncentre = [1.0, 2.0, 0.5]\nradius = 0.1\n'


def built(robot: str, more: str):
    path = Path("plan.toml")
    keys = read_plan(PLAN.format(robot=robot, more=more), path)
    file = resolve_robot(keys.robot, path, Path())
    moved, rotation = centred(cspr_jax.load_robot(robot))[0], None
    if file.is_platform:
        moved, rotation = aligned(moved)
    return build_scene(moved, file, frame_of(file.base_points, file.z_axis), keys, path, rotation=rotation)


def test_scenes_are_in_the_axes_of_the_kernels():
    """The shape of a platform turns with its axes, and obstacles have their place among the spools."""
    file = resolve_robot("nist-robocrane", Path("plan.toml"), Path())
    corners = [*file.platform_points, (0.0, 0.0, 1.0)]
    more = f"platform_hull = {[list(point) for point in corners]}\n{BALL}"
    scene = built("nist-robocrane", more)
    assert is_within(scene.body, scene.platform_points).all()
    assert not is_within(scene.body, 1.01 * scene.platform_points).any()
    middle = np.mean(file.base_points, axis=0)
    away = np.linalg.norm(np.array(file.base_points) - [1.0, 2.0, 0.5], axis=1)
    np.testing.assert_allclose(np.linalg.norm(scene.base_points - scene.obstacles[0].centre, axis=1), away)
    assert abs(scene.obstacles[0].centre[2]) == pytest.approx(abs(0.5 - middle[2]))


def test_shapes_turn_with_the_axes_of_a_platform():
    """Kernels take a platform in its reference axes."""
    known = cspr_jax.load_robot("laval-mssm")
    turn = rotation_matrix(np.array([np.cos(0.3), 0.0, 0.0, np.sin(0.3)]))
    points = np.asarray(known.platform_points) @ turn.T
    robot, frame = centred(platform_robot(known.base_points, points, mass=1.0, inertia=np.eye(3)))
    moved, rotation = aligned(robot)
    assert np.abs(rotation - np.eye(3)).max() > 0.1
    body = hull(np.vstack([points, [0.0, 0.0, 0.2]]))
    scene = robot_scene(moved, frame, (), body, rotation)
    assert is_within(scene.body, scene.platform_points).all()


def test_shapes_that_cannot_be():
    with pytest.raises(ConfigError, match="platform_box: must be absent: a point mass has no shape"):
        built("prototype", "platform_box = [[-0.1, -0.1, 0.0], [0.1, 0.1, 0.1]]")
    with pytest.raises(ConfigError, match="platform_hull = true: must be points"):
        built("nist-robocrane", "platform_hull = true")
