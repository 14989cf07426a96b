"""MuJoCo checks cables over pulleys: their lengths, the tensions that it asks for, and where ours take it."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles.pulleys import length
from robots.test_pulley_motions import AXES, wheels
from support.splines import random_spline

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.mujoco.mjcf import LEAD, model_xml
from cspr_jax.outputs.mujoco.motion import Suspended, attachments, coordinates, in_world, upward
from cspr_jax.outputs.mujoco.replay import ends_of_steps, path_of, tension_deviation
from cspr_jax.robots import cables
from cspr_jax.robots.model.pulleys import Pulleys
from cspr_jax.robots.statics.kernel_axes import centred

mujoco = pytest.importorskip("mujoco")
STEPS = 1000


def scene(pattern: str, name: str, size: float = 0.3):
    """A robot on pulleys and its motion along a spline, in MuJoCo's axes."""
    world, middle, tilt = upward("down"), (0.1, 0.2, 1.5), 0.0
    if pattern == "3T":
        robot = wheels(axes=AXES[name])
    else:  # all of its cables are taut
        robot = cspr_jax.with_cables(cspr_jax.load_robot("laval-mssm"), pulley_radius=0.05, pulley_axes=AXES[name])
        middle, tilt, size = (0.0, 0.0, 1.7), 0.02, 0.1
    robot = centred(robot)[0]
    spline, table = random_spline(1, middle=middle, size=size, tilt=tilt, duration=4.0)

    @jax.jit
    @jax.vmap
    def states(tau):
        state = spline.state(tau)
        return state, cables.tensions(robot, state)

    state, tension = jax.tree.map(np.asarray, states(jnp.linspace(0.0, 1.0, 2 * STEPS + 1)))
    assert pattern == "3T" or (tension > 0.0).all()
    columns = {"position": state.position, "velocity": state.velocity, "acceleration": state.acceleration}
    if pattern != "3T":
        columns |= {"quaternion": state.quaternion, "omega": state.angular_velocity}
        columns["omega_dot"] = state.angular_acceleration
    columns |= {"t": np.linspace(0.0, float(table.x[-1]), 2 * STEPS + 1), "tension": tension}
    is_body = pattern != "3T"
    body = Suspended(
        name="wheels",
        z_axis="down",
        axes=() if is_body else (0, 1, 2),
        mass=float(robot.mass),
        inertia=world.rotated_tensor(np.asarray(robot.inertia)) if is_body else None,
        gravity=float(robot.gravity),
        spools=world.inward(np.asarray(robot.base_points)),
        points=world.rotated(np.asarray(robot.platform_points)) if is_body else np.zeros((3, 3)),
        tension_max=np.full(robot.n_cables, np.inf),
        pulleys=Pulleys(np.asarray(robot.pulleys.radius), world.rotated(np.asarray(robot.pulleys.axes))),
    )
    return body, in_world(columns, np.ones(2 * STEPS + 1, int), "down")


def lengths(body, moved, row):
    parts = body.spools, body.pulleys.axes, body.pulleys.radius, attachments(body, moved)[row]
    return np.array([length(*one)[0] for one in zip(*parts, strict=True)])


@pytest.mark.quick("3R3T-up")
@pytest.mark.parametrize(("pattern", "name"), [("3T", "up"), ("3T", "aslant"), ("3T", "down"), ("3R3T", "up")])
def test_mujoco_has_the_same_cables_over_pulleys(pattern, name):
    """The same lengths and tensions; the tensions take the robot along its motion, the pulleys follow by themselves."""
    body, moved = scene(pattern, name)
    step = float(moved.time[2])
    model = mujoco.MjModel.from_xml_string(model_xml(body, moved, step))
    data = mujoco.MjData(model)
    places = coordinates(body, moved)[0]
    for row in (0, 500, 2 * STEPS):
        data.qpos[:] = places[row]
        mujoco.mj_forward(model, data)
        wanted = lengths(body, moved, row) + LEAD * body.pulleys.radius
        np.testing.assert_allclose(data.ten_length[: model.nu], wanted, atol=1e-11)
        np.testing.assert_allclose(data.ten_length[model.nu :: 2], data.ten_length[model.nu + 1 :: 2], atol=1e-13)
    assert np.abs(tension_deviation(body, moved)).max() < 1e-8 * np.abs(moved.tension).max()
    found = path_of(body, moved, step, by_segment=True)
    off = np.linalg.norm(found.position - moved.position[ends_of_steps(moved)], axis=1)
    assert np.isfinite(off).all() and off.max() < 1e-7
    # The same tensions without pulleys take it elsewhere.
    astray = path_of(body._replace(pulleys=None), moved, step, by_segment=True)
    assert np.linalg.norm(astray.position - moved.position[ends_of_steps(moved)], axis=1).max() > 100.0 * off.max()


def along_the_axis(body, moved, aside: float):
    """A motion from above the entry point of cable 1 to below it, at a distance from its swivel axis."""
    axis = body.pulleys.axes[0]
    way = np.linspace(3.0, -3.0, len(moved.position))[:, None] * axis
    return dataclasses.replace(moved, position=body.spools[0] + aside * np.cross(axis, [0.0, 0.0, 1.0]) + way)


@pytest.mark.parametrize("aside", [0.3, 0.05])
def test_arcs_from_nothing_to_half_a_turn(aside):
    """MuJoCo chooses the same way around all the time."""
    body, moved = scene("3T", "level")
    moved = along_the_axis(body, moved, aside)
    model = mujoco.MjModel.from_xml_string(model_xml(body, moved))
    data, places = mujoco.MjData(model), coordinates(body, moved)[0]
    for row in range(0, len(places), 100):
        data.qpos[:] = places[row]
        mujoco.mj_forward(model, data)
        wanted = lengths(body, moved, row) + LEAD * body.pulleys.radius
        np.testing.assert_allclose(data.ten_length[: model.nu], wanted, atol=1e-11)


def test_pulleys_that_mujoco_would_wrap_the_other_way():
    """Refused in one line, rather than a model that is another robot."""
    body, moved = scene("3T", "level")
    within = along_the_axis(body, moved, 1e-5)
    within = dataclasses.replace(within, position=body.spools[0] + 1e-3 * (within.position - body.spools[0]))
    with pytest.raises(ConfigError, match="has no model for MuJoCo: MuJoCo cannot wrap cable 1 around its pulley"):
        model_xml(body, within)
