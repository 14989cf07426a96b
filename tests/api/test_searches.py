"""Searches from Python: their answers are those of sweeps and plans, and their motions are those of the answers."""

import dataclasses
import json

import jax
import numpy as np
import pytest
from support.platforms import EFFECTIVE

import cspr_jax
from cspr_jax.errors import InputError

PLACES = np.array([[0.5, 0.3, 1.4], [1.2, 0.2, 1.5], [-0.4, 0.6, 1.3]])
TURNS = np.array([[1.0, 0.0, 0.0, 0.0], [np.cos(0.1), np.sin(0.1), 0.0, 0.0], [np.cos(0.05), 0.0, 0.0, np.sin(0.05)]])


states_reached = jax.jit(jax.vmap(lambda motion, tau: motion.state(tau), (0, None)))
# What other tests of platforms compile for, as a plan writes it.
WRITTEN = {"name": "effective-c3", "epsilon": 0.1}


def reached(answers) -> np.ndarray:
    """Where the motions of answers end."""
    return np.asarray(states_reached(answers.motions(), 1.0).position)


@pytest.mark.parametrize("amplitude", ["quintic", pytest.param("A1", marks=pytest.mark.soak)])
def test_transitions_are_those_of_a_plan(amplitude):
    robot, target = cspr_jax.load_robot("transition-prototype"), [0.9, 0.2, 1.5]
    found = cspr_jax.minimum_oscillations(robot, [target], z0=1.5, amplitude=amplitude)
    plan = cspr_jax.plan(
        {
            "schema": 1,
            "robot": "transition-prototype",
            "family": "transition",
            "amplitude": amplitude,
            "z0": 1.5,
            "pose": [{"rest": True}, {"position": target}],
        }
    )
    assert found.oscillations[0] == plan.answers.oscillations[0] > 0
    assert found.duration[0] == plan.answers.duration[0]
    assert found.margin[0] == pytest.approx(plan.answers.margin[0], rel=1e-9)
    np.testing.assert_allclose(reached(found), [target], atol=1e-12)


@pytest.mark.soak
def test_poses_are_those_of_a_plan():
    """One pose with the preferred beta-hat, as in a plan of one segment that fixes the same."""
    robot = cspr_jax.load_robot("laval-mssm")
    found = cspr_jax.minimum_pose_arcs(robot, PLACES, TURNS, z0=1.4, beta_hat="preferred", amplitude=EFFECTIVE)
    np.testing.assert_allclose(reached(found), PLACES, atol=1e-12)
    turned = states_reached(found.motions(), 1.0).quaternion
    np.testing.assert_allclose(np.abs(np.sum(np.asarray(turned) * TURNS, axis=1)), 1.0, atol=1e-12)
    i = 1
    plan = cspr_jax.plan(
        {
            "schema": 1,
            "robot": "laval-mssm",
            "family": "hypocycloid",
            "amplitude": WRITTEN,
            "z0": 1.4,
            "pose": [
                {"rest": True},
                {"position": PLACES[i], "quaternion": TURNS[i], "beta_hat": float(found.beta_hat[i, 1])},
            ],
        }
    )
    assert plan.answers.arcs[0] == found.arcs[i] and plan.answers.duration[0] == found.duration[i]
    assert plan.answers.margin[0] == pytest.approx(found.margin[i], rel=1e-9)
    assert plan.answers.det_margin[0] == pytest.approx(found.det_margin[i], rel=1e-9)


@pytest.mark.thorough
def test_z_up_and_far_away():
    """The same robot with z up, a hundred metres off: the same answers, and motions in its own axes."""
    robot, signs, offset = cspr_jax.load_robot("laval-mssm"), np.array([1.0, -1.0, -1.0]), np.array([100.0, -30.0, 5.0])
    turned = cspr_jax.platform(
        np.asarray(robot.base_points) * signs + offset,
        np.asarray(robot.platform_points) * signs,
        mass=float(robot.mass),
        inertia=np.asarray(robot.inertia) * np.outer(signs, signs),
        z_axis="up",
    )
    mirrored = TURNS * np.append(1.0, signs)
    here = cspr_jax.minimum_pose_arcs(robot, PLACES, TURNS, z0=1.4, amplitude=EFFECTIVE)
    there = cspr_jax.minimum_pose_arcs(turned, PLACES * signs + offset, mirrored, z0=1.4, amplitude=EFFECTIVE)
    np.testing.assert_array_equal(here.arcs, there.arcs)
    np.testing.assert_allclose(here.margin, there.margin, rtol=1e-9)
    np.testing.assert_allclose(reached(there), PLACES * signs + offset, atol=1e-10)


@pytest.mark.thorough
def test_attainable_orientations_are_those_of_a_sweep(tmp_path):
    robot, place = cspr_jax.load_robot("laval-mssm"), [0.5, 0.3, 1.4]
    inside, answers = cspr_jax.attainable(robot, place, definition="grid", divisions=4, amplitude=EFFECTIVE)
    assert len(inside.angles) == len(answers.arcs)
    sweep = {
        "schema": 1,
        "map": "attainability",
        "robot": "laval-mssm",
        "axes": {"x": [0.5], "y": [0.3], "z": [1.4]},
        "trajectory": {"family": "hypocycloid", "amplitude": WRITTEN},
        "orientations": {"definition": "grid", "divisions": 4},
    }
    data = cspr_jax.compute(sweep)
    assert int(data.accessible.item()) == len(inside.angles)
    assert int(data.attainable.item()) == int((answers.arcs > 0).sum())
    volume = cspr_jax.accessible(robot, place, definition="grid", divisions=4).volume.sum()
    assert float(data.accessible_volume.item()) == pytest.approx(volume)


def test_settings_of_jax_do_not_matter():
    """With 64 bits off answers are the same bits, and the settings stay."""
    robot = cspr_jax.load_robot("prototype")
    wanted = cspr_jax.minimum_oscillations(robot, [[0.7, 0.7, 1.7]], z0=1.7)
    with jax.enable_x64(False):
        found = cspr_jax.minimum_oscillations(robot, [[0.7, 0.7, 1.7]], z0=1.7)
        assert not jax.config.read("jax_enable_x64")
    for field in dataclasses.fields(wanted):
        if isinstance(getattr(wanted, field.name), np.ndarray):
            np.testing.assert_array_equal(getattr(wanted, field.name), getattr(found, field.name))


@pytest.mark.parametrize(
    "refused",
    [
        lambda point, mssm: cspr_jax.minimum_oscillations(mssm, PLACES, z0=1.0),
        lambda point, mssm: cspr_jax.minimum_oscillations(point, PLACES, z0=-1.0),
        lambda point, mssm: cspr_jax.minimum_oscillations(point, PLACES, z0=1.0, amplitude="ideal"),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(point, PLACES, z0=1.4),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, TURNS[:2], z0=1.4),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, 2.0 * TURNS, z0=1.4),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, z0=[1.4, 1.5]),
        lambda point, mssm: cspr_jax.minimum_pose_arcs(mssm, PLACES, z0=1.4, amplitude="A1"),
        lambda point, mssm: cspr_jax.accessible(point, PLACES[0]),
        lambda point, mssm: cspr_jax.accessible(mssm, PLACES[0], definition="all"),
        lambda point, mssm: cspr_jax.accessible(mssm, PLACES[0], divisions=5),
        lambda point, mssm: cspr_jax.attainable(mssm, [np.nan, 0.0, 1.0]),
        lambda point, mssm: cspr_jax.attainable(mssm, [0.0, 0.0, -1.0], divisions=4),
        lambda point, mssm: cspr_jax.point_mass([[0, 0, 0], [1, 0, 0]], mass=1.0),
        lambda point, mssm: jax.jit(lambda x: cspr_jax.point_mass(x, mass=1.0).mass)(np.eye(3)),
    ],
)
def test_what_cannot_be_searched_is_refused(refused):
    robots = cspr_jax.load_robot("prototype"), cspr_jax.load_robot("laval-mssm")
    with pytest.raises(InputError) as caught:
        refused(*robots)
    assert "\n" not in str(caught.value) and json.dumps(str(caught.value))
