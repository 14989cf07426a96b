"""Maps of poses and of orientations on eight cables, beside plans of the same cells and linear programs."""

import numpy as np
import pytest
from oracles import any_motion, sampled_motion

import cspr_jax
from cspr_jax.config.reading import read_toml
from cspr_jax.numerics.linear.rotations import cylindrical_frames, from_tilt_torsion
from cspr_jax.robots.statics.kernel_axes import prepared
from cspr_jax.schema.verdicts import Verdict

TRAJECTORY = {"family": "hypocycloid", "amplitude": {"name": "effective-c3", "epsilon": 0.3}, "max_arcs": 2}
AXES = {"x": [1.5, 6.0], "y": [1.0], "z": [1.6], "tilt": [0.1, 1.5], "tilt_azimuth": [0.3], "torsion": [0.2]}
Z0, LOW, HIGH = 4.0, 100.0, 5000.0


def cogiro():
    """CoGiRo as its file has it, for the oracle."""
    keys = read_toml(cspr_jax.config.catalogue.CATALOGUE / "cogiro.toml")
    names = ("base_points", "platform_points", "centre_of_mass", "mass", "inertia", "z_axis")
    robot = {name: keys[name] for name in names} | {"gravity": 9.81, "pattern": "3R3T"}
    return {name: np.array(value) if isinstance(value, list) else value for name, value in robot.items()}


def least_distance(rows):
    """The least largest distance of tensions from their limits over the rows of a plan, N."""
    robot = cogiro()
    rotation = sampled_motion.rotations(rows["quaternion"])
    state = sampled_motion.State(
        rows["position"], rows["velocity"], rows["acceleration"], rotation, rows["omega"], rows["omega_dot"]
    )
    matrix, wrench = any_motion.balance(robot, state, any_motion.cables(robot, state))
    return float(any_motion.Centring(np.full(8, LOW), np.full(8, HIGH)).largest(matrix, wrench).min())


@pytest.mark.thorough
def test_cells_of_maps_of_poses_have_the_verdicts_of_plans():
    robot = {"robot": "cogiro"}
    data = cspr_jax.compute_sweep(
        {"schema": 1, "map": "poses", "axes": AXES | {"z0": [Z0]}, "trajectory": TRAJECTORY} | robot
    )
    found = set()
    for cell in (data.isel(x=i, tilt=j).squeeze() for i in range(2) for j in range(2)):
        pose = {"position": [float(cell[axis]) for axis in "xyz"]}
        pose["tilt_torsion"] = [float(cell[axis]) for axis in ("tilt_azimuth", "tilt", "torsion")]
        keys = {"schema": 1, "z0": Z0, "samples": 100, "pose": [{"rest": True}, pose]} | TRAJECTORY | robot
        planned = cspr_jax.plan(keys)
        answers = planned.answers
        assert cell.verdict == answers.verdict[0] and cell.arcs == answers.arcs[0]
        found.add(int(cell.arcs))
        if cell.arcs == 0:
            assert Verdict(int(cell.verdict)) & Verdict.NO_ARCS
            continue
        assert cell.duration == pytest.approx(answers.duration[0]) and cell.beta_hat == answers.beta_hat[0, 1]
        assert float(cell.margin) == pytest.approx(answers.margin[0], rel=1e-3)
        weight = 91.058 * 9.81 / 8
        sampled = least_distance(planned.rows())
        assert 0.0 < answers.margin_bound[0] * weight <= sampled * (1.0 + 1e-6)
        assert float(cell.margin) * weight == pytest.approx(sampled, rel=0.05)
    assert found == {0, 1, 2}


@pytest.mark.thorough
def test_searches_from_python_take_eight_cables():
    robot = cspr_jax.load_robot("cogiro")
    amplitude = cspr_jax.amplitude("effective-c3", 0.3)
    answers = cspr_jax.minimum_pose_arcs(robot, [[1.5, 1.0, 1.6]], z0=Z0, amplitude=amplitude, max_arcs=2)
    pose = {"position": [1.5, 1.0, 1.6]}
    planned = cspr_jax.plan({"schema": 1, "z0": Z0, "pose": [{"rest": True}, pose], "robot": "cogiro"} | TRAJECTORY)
    assert answers.verdict[0] == planned.answers.verdict[0] == 0 and answers.arcs[0] == planned.answers.arcs[0]
    assert answers.margin[0] == pytest.approx(planned.answers.margin[0], rel=1e-3)


@pytest.mark.thorough
def test_accessible_orientations_of_eight_cables():
    """Small tilts are, and none is singular, by singular values; those beyond are kept apart by cables that meet."""
    robot, place = cspr_jax.load_robot("cogiro"), np.array([1.5, 1.0, 1.6])
    inside = cspr_jax.accessible(robot, place, definition="grid", divisions=8)
    steps = {tuple(row) for row in np.round(inside.angles * 8 / np.pi).astype(int).tolist()}
    assert {theta for _, theta, sigma in steps if sigma == 0} >= {0, 1} and 200 < len(steps) < 1800
    # In the axes of the kernels, as the angles are.
    own, frame = prepared(robot)
    ends = {"base_points": np.asarray(own.base_points), "platform_points": np.asarray(own.platform_points)}
    kernels = cogiro() | ends | {"centre_of_mass": np.zeros(3), "z_axis": "down"}
    where = np.asarray(frame.inward(place))
    quaternions = from_tilt_torsion(inside.angles + cylindrical_frames(where))
    count = len(quaternions)
    still = np.zeros((count, 3))
    turns = sampled_motion.rotations(np.asarray(quaternions))
    state = sampled_motion.State(np.tile(where, (count, 1)), still, still, turns, still, still)
    matrix, _ = any_motion.balance(kernels, state, any_motion.cables(kernels, state))
    assert np.linalg.svd(matrix)[1].min() > 1e-3
