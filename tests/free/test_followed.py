"""Splines that follow motions of other families: of platforms that turn further than Rodrigues vectors say."""

import dataclasses

import numpy as np
import pytest
from support.motions import states_along

import cspr_jax
from cspr_jax.families.free import no_slower as module
from cspr_jax.families.free.closed_forms import ClosedForm, form_starts
from cspr_jax.families.free.no_slower import energy_along, followed
from cspr_jax.families.free.poses import FreePoses, segments_of
from cspr_jax.families.free.problem import FreeQuestion, FreeSettings
from cspr_jax.motion.motion import states_at
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.verification.proved_answers import proved_answers

# Targets 1 and 2 of Table 3.2 of the Dion-Gauvin thesis.
POSES = [
    {"position": [3.464, 0.0, 1.3], "tilt_torsion": [1.5707963267948966, 2.6179938779914944, 0.0]},
    {"position": [-0.866, -1.5, 1.3], "tilt_torsion": [3.141592653589793, 1.0471975511965976, 1.0471975511965976]},
]
KEYS = {"schema": 1, "robot": "laval-mssm", "family": "hypocycloid", "z0": 1.4, "max_arcs": 9, "pose": POSES}
AMPLITUDE = {"amplitude": {"name": "effective-c3", "epsilon": 0.1}}


@pytest.fixture(scope="module")
def turning():
    """A hypocycloid, the question of a search between its poses, and its duration."""
    planned = cspr_jax.plan(KEYS | AMPLITUDE | {"limits": {"tension_max": 7.05, "cable_speed_max": 7.63}})
    assert planned.feasible
    (motion,), duration = planned.legs[0].motions, planned.answers.duration
    ends = states_along(motion, [0.0, 1.0])
    poses = FreePoses(ends.position, ends.quaternion, np.zeros((2, 3)), np.full((2, 6), np.nan), KEYS["z0"])
    with double_precision():
        question = FreeQuestion.of(planned.problem, None, poses, FreeSettings())
    return motion, question, duration, planned


@pytest.mark.thorough
def test_it_follows_and_ends_at_the_poses(turning):
    motion, question, duration, planned = turning
    tau = np.linspace(0.0, 1.0, 501)
    with double_precision():
        tasks = question.tasks(112, 3)
        (spline,) = followed(tasks, [motion], duration, KEYS["z0"])
        at, expected = states_along(spline, tau), states_along(motion, tau)
        energy = energy_along(tasks, spline)
    np.testing.assert_allclose(at.position, expected.position, atol=1e-5)
    np.testing.assert_allclose(at.rotation, expected.rotation, atol=1e-4)
    np.testing.assert_allclose(at.angular_velocity, expected.angular_velocity, atol=0.01)
    np.testing.assert_allclose(at.angular_velocity[[0, -1]], 0.0, atol=1e-10)
    np.testing.assert_allclose(at.angular_acceleration[[0, -1]], expected.angular_acceleration[[0, -1]], atol=1e-8)
    rows = planned.rows(rate=500.0)
    squares = np.sum(rows["tension"] ** 2, axis=1)
    assert energy == pytest.approx(np.trapezoid(squares, rows["t"]), rel=1e-3)


@pytest.mark.thorough
def test_quaternions_may_jump_to_their_negatives(turning, monkeypatch):
    """Both stand for one orientation."""
    motion, question, duration, _ = turning

    def jumping(motion, tau):
        state = states_at(motion, tau)
        signs = np.where(np.arange(len(tau)) % 3 == 1, -1.0, 1.0)[:, None]
        return state._replace(quaternion=np.asarray(state.quaternion) * signs)

    with double_precision():
        tasks = question.tasks(112, 3)
        expected = followed(tasks, [motion], duration, KEYS["z0"])[0].quaternion
        monkeypatch.setattr(module, "states_at", jumping)
        np.testing.assert_allclose(followed(tasks, [motion], duration, KEYS["z0"])[0].quaternion, expected, atol=1e-12)


@pytest.mark.thorough
def test_given_accelerations_are_those_at_the_poses(turning):
    motion, question, duration, _ = turning
    with double_precision():
        tasks = question.tasks(112, 3)
        accelerations = np.random.default_rng(0).normal(size=tasks.accelerations.shape)
        tasks = dataclasses.replace(tasks, accelerations=accelerations, is_free=np.zeros((1, 2), bool))
        ends = states_along(followed(tasks, [motion], duration, KEYS["z0"])[0], [0.0, 1.0])
    np.testing.assert_allclose(ends.acceleration, accelerations[0, :, :3], atol=1e-8)
    np.testing.assert_allclose(ends.angular_acceleration, accelerations[0, :, 3:], atol=1e-8)


@pytest.mark.thorough
def test_energy_is_that_of_the_tensions_that_are_printed():
    """Those of redundant cables depend on the limits of tensions."""
    poses = [{"position": [36.0, 11.0, -21.0]}, {"position": [60.0, 38.0, -60.0]}]
    keys = {"schema": 1, "robot": "boralugoda-rectangle", "family": "hypocycloid-standard", "z0": 80.0, "pose": poses}
    planned = cspr_jax.plan(keys | {"limits": {"tension_min": 0.1, "tension_max": 75.0}})
    (motion,) = planned.legs[0].motions
    ends = states_along(motion, [0.0, 1.0])
    places = FreePoses(ends.position, None, np.zeros((2, 3)), np.full((2, 3), np.nan), keys["z0"])
    with double_precision():
        tasks = FreeQuestion.of(planned.problem, None, places, FreeSettings()).tasks(48, 4)
        energy = energy_along(tasks, motion)
    rows = planned.rows(rate=200.0)
    squares = np.sum(rows["tension"] ** 2, axis=1)
    assert energy == pytest.approx(np.trapezoid(squares, rows["t"]), rel=1e-3)


@pytest.mark.thorough
def test_no_search_begins_where_rodrigues_vectors_end(turning):
    motion, question, duration, _ = turning
    form = ClosedForm("hypocycloid", [motion], np.array([True]), duration)
    with double_precision():
        begun = form_starts(segments_of(question.tasks(24, 3)), np.array([0]), [form])
    assert len(begun.task) == len(begun.controls) == len(begun.duration) == 0


@pytest.mark.thorough
def test_it_is_proved(turning):
    motion, question, duration, _ = turning
    with double_precision():
        splines = followed(question.tasks(112, 8), [motion], duration, KEYS["z0"])
        assert proved_answers(question.problem, splines, None).feasible.all()
