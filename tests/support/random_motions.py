"""Random motions of platforms on six cables as the package and the oracle have them, for tests of proofs.

The oracle knows complex time too: NumPy's version of the printed formulas.
"""

import dataclasses

import numpy as np
from oracles import platform as oracle

from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.reference_pose import aligned
from support.platforms import MSSM, Z0, general, made, ours, random_pose, stacked

QUINTIC = named("quintic")
# Blocks of a call.
BATCH = 64


def rotated(robot):
    """An oracle's robot in the axes of its reference orientation."""
    mine = aligned(ours(robot))[0]
    return dataclasses.replace(robot, platform=np.asarray(mine.platform_points), inertia=np.asarray(mine.inertia))


ROBOTS = {"mssm": rotated(MSSM), "general": rotated(general())}


def quintic(tau):
    """The jet of A, at complex times too."""
    every = [np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])]
    for _ in range(3):
        every.append(every[-1].deriv())
    return np.array([one(tau) for one in every])


def drawn(rng, robot, kind, count):
    """Random motions: segments of the package and of the oracle, numbers of arcs, values of beta-hat."""
    ours_, theirs, arcs, betas = [], [], [], []
    for _ in range(count):
        p = int(rng.integers(2, 13))
        start, end = random_pose(rng, rest=kind.from_rest), random_pose(rng)
        beta = (-1.0 if kind.from_rest else rng.uniform(-9.0, 1.0), rng.uniform(-9.0, 1.0))
        segment = oracle.Segment(start[0], end[0], Z0, start[1], end[1], quintic, standard=not kind.variable)
        ours_.append(made(ours(robot), start, end, Z0, beta, p))
        theirs.append(segment)
        arcs.append(p)
        betas.append(beta)
    return stacked(ours_), theirs, np.array(arcs), betas


def jets(robot, segment, p, beta, tau):
    """Position and quaternion with derivatives in tau, which may be complex, and beta: (3, n, 3), (3, n, 4), (n,)."""
    theta, cusps, _ = oracle.plan(robot, segment, p)
    seconds = beta[0] * theta**2 * (cusps - 1), beta[1] * theta**2 * (cusps - 1)
    env = oracle.envelope(segment, p, tau)
    beta = oracle.beta_ff(tau, p, seconds)
    return oracle.translation(robot, segment, p, tau), oracle.orientation_jet(env, beta), beta[0]


def problem_of(robot, limits=None):
    return Problem(aligned(ours(robot))[0], limits or Limits(), QUINTIC)


def motions_of(rng, robot, kind, count):
    """Motions as the searches ask for them: with the preferred values of beta-hat, and arcs that may do."""
    some = []
    for _ in range(count):
        p = int(rng.integers(3, 16))
        start, end = random_pose(rng, rest=kind.from_rest), random_pose(rng)
        segment = oracle.Segment(start[0], end[0], Z0, start[1], end[1])
        beta = oracle.end_beta_hats(robot, segment)
        beta = (-1.0 if kind.from_rest else beta[0], beta[1])
        some.append((segment, p, beta, made(ours(robot), start, end, Z0, beta, p)))
    return some
