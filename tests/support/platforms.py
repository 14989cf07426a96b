"""Platforms on six cables, poses and motions that many tests share, and what these compile for them.

Compiling takes most of the time of such tests: so there is one amplitude function for all of them, `EFFECTIVE`, and
one number of instants, `INSTANTS`, to which what is asked for is padded.
"""

import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from oracles import platform as oracle

from cspr_jax.api.families.motions import sampled_margin
from cspr_jax.families.platforms import platform_segment as segments
from cspr_jax.families.platforms.six_cable_proof.checker import PlatformChecker
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics import wrench_balance
from cspr_jax.schema.limits import LIMITS

MSSM = oracle.mssm()
Z0 = 1.4
B = 0.86  # m, radius of the spools of the MSSM in the tables of orientations
FROM_REST = PlatformMotionKind(from_rest=True)
EFFECTIVE = named("effective-c3", 0.1)
INSTANTS = 64
# Every limit, so far off that none is broken: which limits there are is known when a function is compiled.
CHECKED = [row for row in LIMITS if not row.of_mass_centre and not row.of_winch]
LOOSE = {row.name: 0.0 if row.sense == "least" else 1e3 for row in CHECKED}
HEAD, *PARTS = (Path(__file__).parents[2] / "sweeps" / "table_3_2.toml").read_text("utf-8").split("[[pose]]\n")
# A plan: rest, the last pose of Table 3.2, rest.
SHORT = "[[pose]]\n".join([HEAD, PARTS[0], PARTS[-2], PARTS[-1]])


def ours(robot):
    """An oracle's robot as the package has it."""
    return platform_robot(
        robot.base, robot.platform, mass=robot.mass, inertia=robot.inertia, centre_of_mass=robot.com, name="mine"
    )


def general(seed=0):
    """A robot without any symmetry; its points centred on the mass centre, as the oracle's motion needs."""
    rng = np.random.default_rng(seed)
    base = MSSM.base + rng.normal(scale=0.1, size=(6, 3))
    base -= base.mean(0)
    turn = oracle.matrix(rng.normal(size=4) / 1.0)
    turn, _ = np.linalg.qr(turn)
    inertia = turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T
    return oracle.Robot(base, MSSM.platform + rng.normal(scale=0.02, size=(6, 3)), 2.5, inertia)


def random_pose(rng, *, rest=False):
    """Anywhere; many are beyond a singularity."""
    if rest:
        return np.array([0.0, 0.0, Z0]), np.array([1.0, 0.0, 0.0, 0.0])
    position = np.array([*rng.uniform(-1.8, 1.8, 2), rng.uniform(0.6, 2.2)])
    angles = rng.uniform([-np.pi, 0.0, -2.0], [np.pi, 1.2, 2.0])
    return position, oracle.pose_quaternion(position, angles)


def place(radius, azimuth, depth=1.7):
    """A place so many radii of the spools' circle off the middle, rad and m."""
    return np.array([radius * B * np.cos(azimuth), radius * B * np.sin(azimuth), depth])


def limits_of(**numbers):
    """All limits: loose but for some."""
    every = LOOSE | numbers
    return Limits(**{row.name: np.full((6,) if row.per_cable else (), every[row.name]) for row in CHECKED})


def checker_of(robot=MSSM, kind=USUAL, *, limits=None, amplitude=EFFECTIVE, batch=512):
    """A checker of motions of an oracle's robot."""
    return PlatformChecker(Problem(ours(robot), limits or Limits(), amplitude), kind, batch=batch)


@jax.jit
def _made(robot, start, end, z0, beta_hats, odd):
    return segments.pose_segment(robot, start, end, z0, beta_hats, odd=odd)


def made(robot, start, end, z0, beta_hats, p):
    """A segment of the package, as NumPy arrays."""
    poses = [tuple(np.asarray(x) for x in pose) for pose in (start, end)]
    found = _made(robot, *poses, np.asarray(z0), tuple(np.asarray(float(b)) for b in beta_hats), np.asarray(p % 2 == 1))
    return jax.tree.map(np.asarray, found)


def stacked(some):
    """Many segments as one, leaves (n, ...)."""
    return jax.tree.map(lambda *x: np.stack(x), *some)


# The state of a motion at one instant, and its smallest slack, in one piece: eager operations would be compiled one by
# one.
state_of = jax.jit(lambda motion, tau: motion.state(tau))
margin_of = jax.jit(sampled_margin, static_argnums=2)


def _padded(function, arrays):
    # Of the leading axis, in pieces of one length.
    count = len(jax.tree.leaves(arrays)[0])
    full = [min(i, count - 1) for i in range(-(-count // INSTANTS) * INSTANTS)]
    parts = [
        jax.tree.map(np.asarray, function(jax.tree.map(lambda x, s=start: x[full[s : s + INSTANTS]], arrays)))
        for start in range(0, len(full), INSTANTS)
    ]
    return jax.tree.map(lambda *x: np.concatenate(x)[:count], *parts)


@functools.partial(jax.jit, static_argnames="kind")
def _states(segment, amplitude, arcs, tau, *, kind):
    return jax.vmap(lambda t: segments.motion(segment, amplitude, arcs, t, kind=kind))(tau)


def states(segment, amplitude, arcs, tau, *, kind=USUAL):
    """States of a segment at instants (n,), leaves (n, ...), NumPy arrays."""
    return _padded(lambda t: _states(segment, amplitude, np.asarray(float(arcs)), t, kind=kind), np.asarray(tau))


@jax.jit
def _cables(robot, state):
    def one(*leaves):
        pose = State(*leaves)
        return {
            "tension": wrench_balance.tensions(robot, pose),
            "per_length": wrench_balance.tensions_per_length(robot, pose),
            "determinant": wrench_balance.normalised_determinant(robot, pose.position, pose.rotation),
            "motion": wrench_balance.cable_motion(robot, pose),
        }

    return jax.vmap(one)(*state)


def cables_at(robot, state):
    """Tensions, N; tensions per mass and length; determinants; lengths, rates and accelerations of cables.

    By the readable functions, at states whose leaves are (n, ...).
    """
    # A quaternion is not asked for.
    return _padded(lambda x: _cables(robot, State(*x)), tuple(np.asarray(x) for x in state[:6]))


def _lowest(chosen, robot, amplitude, poses, p):
    z0, *beta_hats = chosen
    # A rest pose moves with z0.
    poses = [(jnp.where(jnp.isnan(x), jnp.stack([z0 * 0.0, z0 * 0.0, z0]), x), q) for x, q in poses]
    one = segments.pose_segment(robot, *poses, z0, tuple(beta_hats), odd=p % 2.0 == 1.0)
    at = jax.vmap(lambda t: segments.motion(one, amplitude, p, t))(jnp.linspace(0.0, 1.0, 201))
    return jnp.min(jax.vmap(lambda *leaves: wrench_balance.tensions(robot, State(*leaves)))(*at))


# The smallest tension of a segment, and its derivatives with respect to z0 and both values of beta-hat.
lowest_and_slopes = jax.jit(jax.value_and_grad(_lowest))


def crossed_robot(offset: float = 0.0):
    """A platform on six cables, the first two of which meet where it is turned about the vertical by nothing."""
    base = [[3, 0.5, -2], [3, -0.5, -2], [-3, 0.5, 2], [-3, -0.5, 2], [-3, 2, -2], [0, 3, -2]]
    points = [[0.2, -0.2, 0], [0.2, 0.2, offset], [-0.2, 0.2, 0], [-0.2, -0.2, 0], [-0.2, 0.2, 0.1], [0, 0.2, 0.1]]
    return platform_robot(np.array(base, float), np.array(points, float), mass=1.0, inertia=np.eye(3))
