"""MuJoCo judges the motions of a platform: the tensions that it asks for, and where ours take it."""

from typing import NamedTuple

import numpy as np
import pytest
from oracles import platform as oracle
from support.platforms import EFFECTIVE, SHORT, Z0, cables_at, general, made, ours, states

import cspr_jax
from cspr_jax.outputs import motion_files
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.trajectories.platform_segment import duration

mujoco = pytest.importorskip("mujoco")

# Steps of a play, a segment. Ten divides them and their half, so that the knots of "effective-c3" lie between steps.
STEPS = 1600
SAMPLES = 2 * STEPS + 1


class Motion(NamedTuple):
    """A robot, and the columns of its motion: (n_segments, SAMPLES, ...) named as by `motion_files.rows`."""

    robot: PlatformRobot
    columns: dict[str, np.ndarray]


def planned(folder):
    """Rest, a pose, rest: rows of a plan. The platform turns about one fixed axis."""
    (folder / "plan.toml").write_text(SHORT.replace("[[pose]]", f"samples = {SAMPLES}\n[[pose]]", 1))
    plan = cspr_jax.plan(folder / "plan.toml")
    rows = motion_files.rows(plan)
    assert (plan.answers.verdict == 0).all()
    return Motion(plan.problem.robot, {name: x.reshape(2, SAMPLES, *x.shape[1:]) for name, x in rows.items()})


def asymmetrical(_):
    """One segment between tilted poses of a robot without symmetry, whose axis of rotation turns too."""
    rng, robot, arcs = np.random.default_rng(2), ours(general()), 6
    poses = []
    for _ in range(2):
        position = np.array([*rng.uniform(-0.8, 0.8, 2), rng.uniform(1.1, 1.6)])
        angles = rng.uniform([-np.pi, 0.2, -0.5], [np.pi, 0.8, 0.5])
        poses.append((position, oracle.pose_quaternion(position, angles)))
    segment, tau = made(robot, *poses, Z0, (-3.0, -2.0), arcs), np.linspace(0.0, 1.0, SAMPLES)
    at = states(segment, EFFECTIVE, arcs, tau)
    cables = cables_at(robot, at)
    length, rate, _ = cables["motion"]
    quaternion = np.zeros((SAMPLES, 4))
    for q, rotation in zip(quaternion, np.asarray(at.rotation), strict=True):
        mujoco.mju_mat2Quat(q, rotation.ravel())
    columns = {
        "t": tau * float(duration(segment, float(arcs))),
        "position": at.position,
        "velocity": at.velocity,
        "acceleration": at.acceleration,
        "quaternion": quaternion,
        "omega": at.angular_velocity,
        "omega_dot": at.angular_acceleration,
        "length": length,
        "rate": rate,
        "tension": cables["tension"],
    }
    spread = np.linalg.svd(at.angular_velocity, compute_uv=False)
    assert spread[1] > 0.5 * spread[0] and columns["tension"].min() > 0.0
    return Motion(robot, {name: np.asarray(x)[None] for name, x in columns.items()})


@pytest.fixture(scope="module", params=[planned, asymmetrical])
def motion(request, tmp_path_factory):
    return request.param(tmp_path_factory.mktemp("plan"))


def model_of(robot):
    """A free body on six cables without mass, a motor each whose control is the tension in N; no contact, no loss."""

    def text(values):
        return " ".join(repr(float(x)) for x in np.ravel(values))

    def sites(name, points):
        return "".join(f'<site name="{name}{k}" pos="{text(point)}"/>' for k, point in enumerate(points))

    # Principal axes: MuJoCo 3 finds those of a full tensor to 6e-7 only.
    moments, axes = np.linalg.eigh(robot.inertia)
    turn = np.zeros(4)
    mujoco.mju_mat2Quat(turn, (axes * np.linalg.det(axes)).ravel())
    cables = "".join(
        f'<spatial name="cable{k}"><site site="spool{k}"/><site site="point{k}"/></spatial>' for k in range(6)
    )
    motors = "".join(f'<motor tendon="cable{k}" gear="-1"/>' for k in range(6))
    return mujoco.MjModel.from_xml_string(
        f"""
        <mujoco>
          <compiler inertiafromgeom="false"/>
          <option gravity="0 0 {text(robot.gravity)}"><flag constraint="disable" contact="disable"/></option>
          <worldbody>
            {sites("spool", np.asarray(robot.base_points))}
            <body>
              <freejoint/>
              <inertial pos="0 0 0" mass="{text(robot.mass)}" diaginertia="{text(moments)}" quat="{text(turn)}"/>
              {sites("point", np.asarray(robot.platform_points))}
            </body>
          </worldbody>
          <tendon>{cables}</tendon>
          <actuator>{motors}</actuator>
        </mujoco>
        """
    )


def test_mujoco_asks_for_the_same_tensions(motion):
    """Its inverse dynamics through its own tendon Jacobian; its cables' lengths and rates too."""
    model, columns = model_of(motion.robot), motion.columns
    data, largest = mujoco.MjData(model), columns["tension"].max()
    every = 53 * len(columns["t"])  # about 60 instants in all, out of step with the arcs
    for segment in range(len(columns["t"])):
        for i in range(0, SAMPLES, every):
            at = {name: x[segment, i] for name, x in columns.items()}
            # The angular velocity of a free joint is in platform axes; so is its derivative: omega x omega is nil.
            back = oracle.matrix(at["quaternion"]).T
            data.qpos[:] = *at["position"], *at["quaternion"]
            data.qvel[:] = *at["velocity"], *(back @ at["omega"])
            data.qacc[:] = *at["acceleration"], *(back @ at["omega_dot"])
            mujoco.mj_inverse(model, data)
            # Every cable depends on all six freedoms: a sparse Jacobian is laid out as a dense one.
            pull = -np.reshape(data.ten_J, (6, 6)).T
            tension = np.linalg.solve(pull, data.qfrc_inverse)
            np.testing.assert_allclose(tension, at["tension"], rtol=0.0, atol=1e-12 * largest)
            np.testing.assert_allclose(data.ten_length, at["length"], atol=1e-12)
            np.testing.assert_allclose(data.ten_velocity, at["rate"], atol=1e-12)


def played(motion, stride):
    """Errors of position, m, and of orientation, rad: our tensions alone move MuJoCo's platform, by Runge and Kutta."""
    # A step is 2 * stride samples long, and takes the tensions of its start, its middle and its end as they are.
    model, columns = model_of(motion.robot), motion.columns
    data, quaternion_rate = mujoco.MjData(model), np.zeros(4)

    def slope(state, tension):
        data.qpos[:], data.qvel[:], data.ctrl[:] = state[:7], state[7:], tension
        data.qpos[3:] /= np.linalg.norm(state[3:7])
        mujoco.mj_forward(model, data)
        omega = np.array([0.0, *state[10:]])  # in platform axes
        mujoco.mju_mulQuat(quaternion_rate, state[3:7], omega)
        return np.concatenate([state[7:10], 0.5 * quaternion_rate, data.qacc])

    first = {name: columns[name][0, 0] for name in ("position", "quaternion", "velocity", "omega")}
    assert not np.any(first["velocity"]) and np.abs(first["omega"]).max() < 1e-12
    state = np.concatenate([first["position"], first["quaternion"], np.zeros(6)])
    away, turned = 0.0, 0.0
    for segment in range(len(columns["t"])):
        times, tensions, places, turns = (
            columns[name][segment, ::stride] for name in ("t", "tension", "position", "quaternion")
        )
        for i in range(0, len(times) - 2, 2):
            h = times[i + 2] - times[i]
            k1 = slope(state, tensions[i])
            k2 = slope(state + 0.5 * h * k1, tensions[i + 1])
            k3 = slope(state + 0.5 * h * k2, tensions[i + 1])
            k4 = slope(state + h * k3, tensions[i + 2])
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            away = max(away, np.linalg.norm(state[:3] - places[i + 2]))
            turn = state[3:7] / np.linalg.norm(state[3:7])
            turned = max(turned, 2.0 * min(np.linalg.norm(turn - s * turns[i + 2]) for s in (-1.0, 1.0)))
    return np.array([away, turned])


def test_the_tensions_make_the_motion_in_mujoco(motion):
    """Open loop over the whole motion; what is left is the integrator's error, which falls with h to the fourth."""
    coarse, fine = played(motion, 2), played(motion, 1)
    assert fine[0] < 5e-9 and fine[1] < 2e-7
    np.testing.assert_allclose(coarse / fine, 16.0, rtol=0.1)
