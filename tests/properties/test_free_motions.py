"""Free motions of random pairs of poses of ten robots, and of Table 2.1, against collocation with ipopt."""

from functools import partial

import numpy as np
import pytest
from oracles import free_motion_times, motion_verifier
from support.free_motions import problem_of
from support.least_time import sampled_states

from cspr_jax.families.free.free_motion import free_motion
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.families.free.search.time_bounds import time_bounds
from cspr_jax.motion.motion import Placed
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.schema.verdicts import Verdict

# By how much a time may be below the reference's estimate of the least one, and above its motion.
BELOW, ABOVE = 0.002, 0.005
CONTACTS = int(Verdict.CABLE_CABLE | Verdict.CABLE_PLATFORM)
SLOW = ("3R3T", "1R2T", "8")


def marks(name):
    return [pytest.mark.soak if any(part in name for part in SLOW) else pytest.mark.thorough]


@pytest.mark.ci("segment 0", "2T-4 0 inside", "3T-3 0 outside", "segment 5")
@pytest.mark.parametrize("name", [pytest.param(name, marks=marks(name)) for name in free_motion_times.NAMES])
def test_times_are_those_of_collocation(name):
    reference = free_motion_times.reference(name)
    case, ends = reference.case, (reference.case.start, reference.case.end)
    with double_precision():
        problem, frame = problem_of(case.robot, case.limits)
        positions = np.asarray(frame.inward(np.array([pose.position for pose in ends])))
        quaternions, size = None, 3
        if isinstance(problem.robot, PlatformRobot):
            quaternions, size = np.asarray(frame.rotated_quaternions(np.array([pose.quaternion for pose in ends]))), 6
        still, free = np.zeros((2, 3)), np.full((2, size), np.nan)
        poses = FreePoses(positions, quaternions, still, free, float(positions[:, 2].mean()))
        free = free_motion(problem, None, poses)
        (bound,) = time_bounds(problem, free.motions)
    assert free.is_optimal
    assert (free.answers.verdict | CONTACTS == CONTACTS).all()
    assert max(bound, reference.below, (1.0 - BELOW) * reference.infimum) <= free.duration
    assert free.duration <= (1.0 + ABOVE) * reference.time
    assert bound <= reference.infimum
    motion = partial(sampled_states, Placed(free.motions[0], frame))
    verification = motion_verifier.verified(case.robot, case.limits, motion, free.duration, *ends, samples=5_001)
    assert verification.faults() == []
