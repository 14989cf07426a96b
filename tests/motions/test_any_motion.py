"""Proofs of random motions of twelve robots against a reference that was written without a look at them."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from oracles import any_motion
from oracles.any_motion_cases import KINDS, random_case

import cspr_jax
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.attained import attained
from cspr_jax.verification.bounds.block_slacks import block_slacks
from cspr_jax.verification.criteria import criteria
from cspr_jax.verification.proved_answers import MotionProof
from cspr_jax.verification.time_proof import time_proof

# Two robots have pulleys.
PULLEYS = True
NAMES = {
    Verdict.SLACK_CABLE: "tension",
    Verdict.OVER_TENSION: "tension",
    Verdict.WRENCH_INFEASIBLE: "tension",
    Verdict.BELOW_FLOOR: "floor",
    Verdict.CABLE_TOO_LONG: "cable_length_max",
    Verdict.CABLE_TOO_FAST: "cable_speed_max",
    Verdict.CABLE_OVER_ACCELERATION: "cable_acceleration_max",
}
# Ends of intervals agree to this, s; the margin lies within its bounds but for this share of a criterion's size.
TIME, SHARE = 1e-6, 1e-7


def robot_of(case):
    """The robot of a case."""
    numbers = {name: case.robot[name] for name in ("mass", "gravity", "z_axis")}
    pattern, points = case.robot["pattern"], case.robot["platform_points"]
    if points is None:
        robot = cspr_jax.point_mass(case.robot["base_points"], planar=pattern == "2T", **numbers)
    else:
        numbers |= {"inertia": case.robot["inertia"], "centre_of_mass": case.robot["centre_of_mass"]}
        robot = cspr_jax.platform(case.robot["base_points"], points, pattern=pattern, **numbers)
    if case.robot["pulley_radius"] is None:
        return robot
    pulleys = {name: case.robot[name] for name in ("pulley_radius", "pulley_axes")}
    return cspr_jax.with_cables(robot, **pulleys)


def proof_of(case):
    """The proof of a case, the slacks that its motion attains, its criteria, and the start of the motion, s."""
    robot, frame = centred(robot_of(case))
    samples, limits = case.samples, dict(case.limits)
    floor = limits.pop("floor")
    limits = Limits(**limits, floor=np.asarray(frame.depth(floor)))
    rotated = samples.get("quaternions")
    if rotated is not None:
        # The axes of both, the robot's and the platform's, turn by half a turn about x, or not at all.
        rotated = rotated * np.concatenate([[1.0], frame.signs])
    rates = samples.get("rates")
    given = {}
    if rates is not None:
        names = ("velocities", "accelerations")[: rates.shape[1]]
        given = {name: rates[:, i] * frame.signs for i, name in enumerate(names)}
    motion = interpolated(
        samples["times"],
        frame.inward(samples["positions"]),
        rotated,
        **given,
        interpolation=samples["interpolation"],
        ends=samples["ends"],
    )
    slacks = partial(block_slacks, robot, limits, motion.bounds)
    proof = time_proof(slacks, float(motion.duration()), jumps=motion.jumps())
    rows = tuple(criteria(robot, limits))
    problem = Problem(robot, limits, None)  # type: ignore[arg-type]
    reached = attained(problem, motion, MotionProof(rows, proof, np.ones(len(rows)))).proof
    return proof, reached, rows, samples["times"][0]


def joined(intervals):
    """Intervals (k, 2) without overlaps, in order."""
    result = []
    for start, end in sorted(map(tuple, intervals)):
        if result and start <= result[-1][1] + 1e-9:
            result[-1][1] = max(result[-1][1], end)
        else:
            result.append([start, end])
    return np.array(result).reshape(-1, 2)


def lies_in(inner, outer):
    """Whether each interval lies in one of others, but for `TIME` at each end."""
    return all(((outer[:, 0] - TIME <= a) & (b <= outer[:, 1] + TIME)).any() for a, b in inner if b - a > TIME)


def compare(case):
    """Check the proof of a case; whether it decides."""
    proof, reached, rows, start = proof_of(case)
    expected = any_motion.verified(case.robot, case.limits, case.motion)
    # The reference knows neither contacts, singularities nor the plane of the spools.
    known = [k for k, row in enumerate(rows) if row.flag in NAMES]
    proof = dataclasses.replace(
        proof,
        low=proof.low[known],
        high=proof.high[known],
        failing=[proof.failing[k] for k in known],
        open=[proof.open[k] for k in known],
    )
    compare_attained(case, expected, {k: NAMES[rows[k].flag] for k in known}, reached, start)
    failing = joined(np.concatenate(proof.failing) + start)
    unknown = joined(np.concatenate([*proof.failing, *proof.open]) + start)
    names = np.array([NAMES[rows[k].flag] for k in known])
    assert set(names) == set(expected.slacks)
    for name, slack in expected.slacks.items():
        low, high = proof.low[names == name].min(), proof.high[names == name].min()
        size = SHARE * (np.abs(slack) + np.max(np.abs(case.limits.get(name, case.limits["tension_max"]))))
        assert low - size <= slack <= high + size, (name, low, slack, high)
    # A proof of feasibility or of its contrary, and where.
    if proof.low.min() > 0.0:
        assert expected.feasible
        return True
    assert lies_in(failing, expected.failing), (failing, expected.failing)
    assert lies_in(expected.failing, unknown), (expected.failing, unknown)
    return bool(len(failing)) and all(np.diff(each, axis=1).max(initial=0.0) <= 4.0 * TIME for each in proof.open)


def compare_attained(case, expected, names, reached, start):
    """Smallest slacks, and those at their times, against the reference: to a millionth of the size of the criterion."""
    verifier = any_motion.verifier(case.robot, case.limits, case.motion)
    for name, slack in expected.slacks.items():
        columns = [k for k, other in names.items() if other == name]
        k = columns[int(np.argmin(reached.high[columns]))]
        size = 1e-6 * np.max(np.abs(case.limits.get(name, case.limits["tension_max"])))
        # The later side of a joint is at its time, the earlier one just before it.
        sides = [verifier.slacks(start + reached.when[k] + shift)[name][0] for shift in (-1e-12, 0.0, 1e-12)]
        assert abs(reached.high[k] - slack) <= size, (name, reached.high[k], slack)
        assert np.min(np.abs(sides - reached.high[k])) <= size, (name, reached.high[k], sides)


@pytest.mark.ci("3T-4", "3R3T-6s")
@pytest.mark.quick("2T-2")
@pytest.mark.parametrize("kind", KINDS)
def test_proofs_agree_with_the_reference(kind):
    rng = np.random.default_rng([46, KINDS.index(kind)])
    decided = [compare(random_case(rng, PULLEYS, kind)) for _ in range(10)]
    assert all(decided)


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_many_proofs_agree_with_the_reference(kind, count=834):
    rng = np.random.default_rng([47, KINDS.index(kind)])
    decided = [compare(random_case(rng, PULLEYS, kind)) for _ in range(count)]
    assert np.mean(decided) > 0.995
