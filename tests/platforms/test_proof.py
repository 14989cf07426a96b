"""Proofs on all six-cable robots of the catalogue, and one without symmetry, against dense samples, in the soak.

Samples are those of the readable functions where a motion is refuted, and of lanes, which tests compare with these,
where one is proved: 20,001 instants.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from oracles import platform as oracle
from support.platforms import FROM_REST, general, ours

from cspr_jax.build.robots import kernel_robot
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import resolve_robot
from cspr_jax.families.platforms.arcs import Candidates, segments_with
from cspr_jax.families.platforms.beta_hat import end_options
from cspr_jax.families.platforms.platform_segment import Motions
from cspr_jax.families.platforms.redundant import redundant_kernels
from cspr_jax.families.platforms.redundant.crossings import crossings
from cspr_jax.families.platforms.six_cable_proof import tension_proof
from cspr_jax.families.platforms.six_cable_proof.checker import PlatformChecker, slacks_at
from cspr_jax.families.platforms.six_cable_proof.pose_blocks import STEPS
from cspr_jax.families.platforms.six_cable_proof.pose_proof import PARTS
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.platform_kind import USUAL
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.robots.contacts.interference import contacts
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.reference_pose import aligned
from cspr_jax.schema.verdicts import Verdict

ROBOTS = ("fast", "greenline", "laval-mssm", "nist-robocrane", "without symmetry")
INSTANTS, BATCH = 20_001, 2048


def robot_of(name):
    """A robot with its mass centre, its reference axes and its rest point as the searches have them."""
    if name == ROBOTS[-1]:
        return aligned(ours(general(3)))[0]
    here = Path(__file__)
    return aligned(kernel_robot(resolve_robot(name, here, here.parent), TrajectoryKeys(), name))[0]


def drawn(robot, kind, count, seed):
    """Motions within one and a half times the robot's size, tilted by up to 0.8, that end as they prefer."""
    rng = np.random.default_rng(seed)
    size = max(
        np.linalg.norm(np.asarray(points)[:, :2], axis=1).max() for points in (robot.base_points, robot.platform_points)
    )
    z0 = np.full(count, 1.6 * size)

    def poses():
        # Large and small motions alike: some robots hardly turn.
        part = 10.0 ** rng.uniform(-2.0, 0.4, count)
        radius, angle = 1.5 * size * part * np.sqrt(rng.uniform(size=count)), rng.uniform(-np.pi, np.pi, count)
        depth = (1.0 + part * rng.uniform(-0.5, 0.6, count)) * z0
        place = np.stack([radius * np.cos(angle), radius * np.sin(angle), depth], axis=1)
        turns = rng.uniform([-np.pi, 0.0, -0.8], [np.pi, 0.8, 0.8], (count, 3)) * np.c_[np.ones(count), part, part]
        return place, np.stack([oracle.pose_quaternion(*pair) for pair in zip(place, turns, strict=True)])

    start, end = poses(), poses()
    if kind.from_rest:
        start = np.stack([0.0 * z0, 0.0 * z0, z0], axis=1), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    values = [np.nan_to_num(end_options(robot, *pose, z0, 1)[0][:, 0], nan=-1.0) for pose in (start, end)]
    arcs = rng.integers(3, 16, count)
    candidates = Candidates(start, end, z0, np.arange(count), (values[0], values[1]))
    return Motions(segments_with(robot, candidates, arcs), arcs)


class Samples:
    """Samples of motions of a robot."""

    def __init__(self, problem, kind):
        self._problem, self._kind, near = problem, kind, contacts(problem.robot)
        self._pairs, self._platform = near.pairs, (near.sides, near.normal)

    def slack(self, motions, row, tau):
        """Smallest slack at instants, (k,)."""
        pairs = tuple((int(i), int(j)) for i, j in self._pairs)

        def kernel(items):
            return np.min(slacks_at(self._problem, items, pairs=pairs, kind=self._kind), axis=0)

        return in_batches(kernel, (*motions.items(row), tau), batch_size=BATCH)

    def tension(self, motions, row, tau):
        """Smallest slack of taut cables, (k,), in other orders of these, of which one has digits everywhere."""
        orders = [order.problem for order in tension_proof._orders(self._problem)[1:3]]

        def kernel(problem, items):
            return slacks_at(problem, items, pairs=(), kind=self._kind)[0]

        items = (*motions.items(row), tau)
        return np.min([in_batches(partial(kernel, problem), items, batch_size=BATCH) for problem in orders], axis=0)

    def touches(self, motions, row, ends):
        """Motions in whose steps something meets, (n,)."""

        def vectors(which, tau):
            def kernel(items):
                return redundant_kernels.cable_vectors(self._problem, self._pairs, items, kind=self._kind)

            return in_batches(kernel, (*motions.items(which), tau), batch_size=BATCH)

        return np.logical_or(*crossings(vectors, self._platform, row, ends, len(motions.arcs)))


def against_samples(name, kind, count, seed=1):
    """How many motions are proved, refuted, undecided, and of how many a sample says the opposite."""
    robot = robot_of(name)
    problem = Problem(robot, Limits(), named("quintic"))
    motions, samples = drawn(robot, kind, count, seed), Samples(problem, kind)
    checks = PlatformChecker(problem, kind, batch=1024).check(*motions, margins=False)
    is_proved, is_unsure = checks.verdict == 0, checks.verdict == Verdict.UNDECIDED.value
    wrong = 0
    tau = np.linspace(0.0, 1.0, INSTANTS)
    for i in np.flatnonzero(is_proved):
        own = motions.take(np.array([i]))
        row = np.zeros(INSTANTS, int)
        wrong += bool(samples.slack(own, row, tau).min() <= 0.0)
        wrong += bool(samples.touches(own, row[1:], (tau[:-1], tau[1:])).any())
    refuted = np.flatnonzero(~is_proved & ~is_unsure)
    at = checks.refuted_tau[refuted]
    breaks = np.zeros(len(refuted), bool)
    for values in (samples.slack, samples.tension) if len(refuted) else ():
        breaks |= ~(values(motions, refuted, at) > 0.0)
    # Contacts lie within a step of the blocks in which they are looked for.
    rest = refuted[~breaks]
    step = 1.0 / (PARTS * STEPS * motions.arcs[rest])
    places = np.clip(at[~breaks] + np.linspace(-1.0, 1.0, 65)[:, None] * step, 0.0, 1.0)
    row = np.tile(rest, 64)
    touches = samples.touches(motions, row, (places[:-1].ravel(), places[1:].ravel()))
    wrong += int((~touches[rest]).sum())
    return {"proved": int(is_proved.sum()), "refuted": len(refuted), "undecided": int(is_unsure.sum()), "wrong": wrong}


@pytest.mark.soak
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("kind", [USUAL, FROM_REST], ids=["between", "from rest"])
def test_no_sample_contradicts_a_proof(name, kind):
    """5,000 motions of each robot and kind; less than 0.5 % undecided."""
    found = against_samples(name, kind, 5000)
    assert found["wrong"] == 0 and found["undecided"] < 25 and found["proved"] > 20, found


@pytest.mark.thorough
def test_no_motion_is_refuted_where_its_tensions_are_rounding():
    """At a node at 0.766 three cables lie nearly in one plane; a cable is slack elsewhere, and that is named."""
    robot = robot_of("laval-mssm")
    problem = Problem(robot, Limits(), named("quintic"))
    motions = drawn(robot, FROM_REST, 400, 9).take(np.array([107]))
    checks = PlatformChecker(problem, FROM_REST, batch=64).check(*motions, margins=False)
    assert checks.verdict[0] == Verdict.SLACK_CABLE.value
    assert Samples(problem, FROM_REST).slack(motions, np.array([0]), checks.refuted_tau)[0] < -0.01


@pytest.mark.thorough
def test_flags_are_the_same_with_margins_beside_a_singularity():
    """Beyond one a slack has no meaning, before it a cable may be slack: the flags say the same without margins."""
    robot = robot_of("laval-mssm")
    problem = Problem(robot, Limits(), named("quintic"))
    motions = drawn(robot, FROM_REST, 400, 9).take(np.array([6, 170, 249, 251, 356, 363]))
    checker = PlatformChecker(problem, FROM_REST, batch=64)
    with_margins, without = (checker.check(*motions, margins=x).verdict for x in (True, False))
    np.testing.assert_array_equal(with_margins, without)
    assert (without & Verdict.SINGULAR.value).all()
