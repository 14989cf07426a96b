"""MuJoCo checks the motions of a platform: the tensions that it asks for, and where ours take it."""

from typing import NamedTuple

import numpy as np
import pytest
from oracles import platform as oracle
from scipy.spatial.transform import Rotation
from support.platforms import EFFECTIVE, SHORT, Z0, cables_at, general, made, ours, states

import cspr_jax
from cspr_jax.families.platforms.platform_segment import duration
from cspr_jax.outputs.mujoco.mjcf import model_xml
from cspr_jax.outputs.mujoco.motion import Played, Suspended, in_world, played, suspended, upward
from cspr_jax.outputs.mujoco.replay import ends_of_steps, path_of, tension_deviation

mujoco = pytest.importorskip("mujoco")

# Steps of a play, a segment.
STEPS = 1600


class Scene(NamedTuple):
    """A robot, and its motion in few steps and in twice as many."""

    body: Suspended
    coarse: Played
    fine: Played


def planned(folder):
    """Rest, a pose, rest: a plan. The platform turns about one fixed axis."""
    (folder / "plan.toml").write_text(SHORT)
    plan = cspr_jax.plan(folder / "plan.toml")
    assert plan.feasible
    step = float(plan.answers.duration.max()) / STEPS
    return Scene(suspended(plan), *(played(plan, size) for size in (2.0 * step, step)))


def asymmetrical(_):
    """One segment between tilted poses of a robot without symmetry, whose axis of rotation turns too."""
    rng, robot, arcs = np.random.default_rng(2), ours(general()), 6
    poses = []
    for _ in range(2):
        position = np.array([*rng.uniform(-0.8, 0.8, 2), rng.uniform(1.1, 1.6)])
        angles = rng.uniform([-np.pi, 0.2, -0.5], [np.pi, 0.8, 0.5])
        poses.append((position, oracle.pose_quaternion(position, angles)))
    segment, world = made(robot, *poses, Z0, (-3.0, -2.0), arcs), upward("down")
    points, inertia = world.rotated(np.asarray(robot.platform_points)), world.rotated_tensor(np.asarray(robot.inertia))
    body = Suspended(
        *("mine", "down", (), float(robot.mass), inertia, float(robot.gravity)),
        *(world.inward(np.asarray(robot.base_points)), points, np.full(6, np.inf)),
    )

    def motion(steps):
        # Ten divides the steps: the knots of "effective-c3" lie between them.
        tau = np.linspace(0.0, 1.0, 2 * steps + 1)
        at = states(segment, EFFECTIVE, arcs, tau)
        spread = np.linalg.svd(at.angular_velocity, compute_uv=False)
        assert spread[1] > 0.5 * spread[0]
        columns = {
            "t": tau * float(duration(segment, float(arcs))),
            "position": at.position,
            "velocity": at.velocity,
            "acceleration": at.acceleration,
            "quaternion": np.roll(Rotation.from_matrix(at.rotation).as_quat(), 1, axis=1),
            "omega": at.angular_velocity,
            "omega_dot": at.angular_acceleration,
            "tension": cables_at(robot, at)["tension"],
        }
        return in_world({name: np.asarray(x) for name, x in columns.items()}, np.ones(len(tau), int), "down")

    scene = Scene(body, motion(STEPS // 2), motion(STEPS))
    assert scene.fine.tension.min() > 0.0
    return scene


@pytest.fixture(scope="module", params=[pytest.param(planned, marks=pytest.mark.thorough), asymmetrical])
def scene(request, tmp_path_factory):
    return request.param(tmp_path_factory.mktemp("plan"))


def test_mujoco_asks_for_the_same_tensions(scene):
    """Its inverse dynamics through its own tendon Jacobian; what a cable is off by is found in that cable."""
    body, moved = scene.body, scene.coarse
    assert np.abs(tension_deviation(body, moved)).max() < 1e-12 * moved.tension.max()
    wrong = moved.tension + np.eye(6)[3] * 0.1
    found = tension_deviation(body, Played(**vars(moved) | {"tension": wrong}))
    np.testing.assert_allclose(found, np.broadcast_to(-0.1 * np.eye(6)[3], found.shape), atol=1e-9)


def test_the_model_is_the_robot(scene):
    """By the oracle's own rotations: lengths of the cables; gravity and inertia move what nothing pulls."""
    body, moved = scene.body, scene.fine
    model = mujoco.MjModel.from_xml_string(model_xml(body, moved))
    data, places = mujoco.MjData(model), moved.coordinates(())[0]
    rng = np.random.default_rng(1)
    for row in range(0, len(moved.time), 53 * len(moved.time) // 2000):
        turn = oracle.matrix(places[row, 3:])
        data.qpos[:], data.qvel[:], data.ctrl[:] = places[row], rng.normal(size=6), 0.0
        mujoco.mj_forward(model, data)
        lengths = np.linalg.norm(places[row, :3] + body.points @ turn.T - body.spools, axis=1)
        np.testing.assert_allclose(data.ten_length, lengths, atol=1e-12)
        omega = data.qvel[3:]
        spin = -np.linalg.solve(body.inertia, np.cross(omega, body.inertia @ omega))
        np.testing.assert_allclose(data.qacc, [0.0, 0.0, -body.gravity, *spin], atol=1e-10)


def test_the_tensions_make_the_motion_in_mujoco(scene):
    """Open loop over the whole motion; what is left is the integrator's error, which falls with h to the fourth."""
    errors = []
    for moved in (scene.coarse, scene.fine):
        way = path_of(scene.body, moved, by_segment=False)
        planned = moved.position[ends_of_steps(moved)]
        errors.append([np.linalg.norm(way.position - planned, axis=1).max(), way.rotated.max()])
    coarse, fine = np.array(errors)
    assert fine[0] < 5e-9 and fine[1] < 2e-7
    np.testing.assert_allclose(coarse / fine, 16.0, rtol=0.1)
