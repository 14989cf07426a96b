"""Random motions of twelve kinds of robots, with pulleys, winches and bodies, and their certificates."""

import numpy as np
from motions.test_any_motion import robot_of
from oracles.any_motion_cases import random_case
from oracles.winch_cases import random_limit, random_winch

import cspr_jax
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.verification.attained import attained
from cspr_jax.verification.certificates.certificate import certificate
from cspr_jax.verification.proved_answers import proof_of

MOTORS = ("motor_speed_max", "motor_torque_max", "motor_power_max", "motor_load_max")


def random_motion(rng, kind, *, pulleys=False, winches=False):
    """A problem and the motion through the samples of a random case."""
    case = random_case(rng, pulleys, kind)
    robot, motors = robot_of(case), {}
    if winches:
        winch, _ = random_winch(rng, case, False)
        robot = cspr_jax.with_cables(robot, winch=winch)
        motors = {name: 3.0 * random_limit(rng, winch, name) for name in MOTORS}
    robot, frame = centred(robot)
    if robot.n_cables > robot.dof:
        motors = {name: value for name, value in motors.items() if name == "motor_speed_max"}
    samples, limits = case.samples, dict(case.limits)
    limits = Limits(**limits | {"floor": np.asarray(frame.depth(limits["floor"]))} | motors)
    rotated, rates, derivatives = samples.get("quaternions"), samples.get("rates"), {}
    if rotated is not None:
        rotated = rotated * np.concatenate([[1.0], frame.signs])
    if rates is not None:
        names = ("velocities", "accelerations")[: rates.shape[1]]
        derivatives = {name: rates[:, i] * frame.signs for i, name in enumerate(names)}
    how = {"interpolation": samples["interpolation"], "ends": samples["ends"]}
    motion = interpolated(samples["times"], frame.inward(samples["positions"]), rotated, **derivatives, **how)
    return Problem(robot, limits, None), motion


def certified(problem, motion, scene=None):
    """The proof of a motion, and its certificate."""
    proof = attained(problem, motion, proof_of(problem, motion, scene), scene)
    return proof, certificate(problem, [motion.formulas()], [proof], scene)
