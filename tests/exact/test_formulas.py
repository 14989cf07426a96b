"""Formulas of motions in rational numbers say what the motions do."""

import dataclasses
import itertools
from fractions import Fraction

import jax
import numpy as np
import pytest

import cspr_jax
from cspr_jax.families.ellipses.rotation import Rotation
from cspr_jax.motion.motion import Backwards
from cspr_jax.verification.exact.series import SeriesPiece, ball, precision

THOROUGH = pytest.mark.thorough
TIMES = 5
TOLERANCE = 1e-12


def largest_difference(motion) -> float:
    """Largest difference between a motion and its formulas, of positions, rotations and their derivatives."""
    pieces, duration = motion.formulas(), float(motion.duration())
    assert pieces[0].start == 0
    assert abs(float(pieces[-1].end) - duration) <= TOLERANCE * duration
    assert all(before.end == after.start for before, after in itertools.pairwise(pieces))
    state_at, worst = jax.jit(motion.state), 0.0
    with precision(128):
        series = [SeriesPiece(piece) for piece in pieces]
        for tau in [0.0, 1.0, *np.random.default_rng(0).uniform(0.0, 1.0, TIMES)]:
            t = Fraction(float(tau)) * pieces[-1].end
            piece = next(p for p in series if p.start <= t <= p.end)
            state, expected = piece.state(ball(t - piece.start)), state_at(float(tau))

            def numbers(vector):
                return np.array([float(x[0].mid()) for x in vector])

            pairs = [(state.position, expected.position), (state.velocity, expected.velocity)]
            pairs += [(state.acceleration, expected.acceleration)]
            if state.rotation is not None:
                pairs += list(zip(state.rotation, expected.rotation, strict=True))
                pairs += [(state.angular_velocity, expected.angular_velocity)]
                pairs += [(state.angular_acceleration, expected.angular_acceleration)]
            for computed, given in pairs:
                given = np.asarray(given)
                worst = max(worst, float(np.abs(numbers(computed) - given).max() / max(1.0, np.abs(given).max())))
    return worst


def inner(motion):
    """The motion in the axes of the kernels."""
    return motion.motion if hasattr(motion, "frame") else motion


def prototype():
    return cspr_jax.load_robot("prototype")


def spline():
    rng = np.random.default_rng(1)
    return cspr_jax.spline(prototype(), np.arange(5.0), np.array([0.0, 0.0, 1.4]) + rng.uniform(-0.1, 0.1, (5, 3)))


def platform_spline(offset):
    rng = np.random.default_rng(2)
    positions = np.array([0.0, 0.0, 1.4]) + rng.uniform(-0.1, 0.1, (5, 3))
    quaternions = np.concatenate([np.ones((5, 1)), rng.uniform(-0.2, 0.2, (5, 3))], axis=1)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    mssm = cspr_jax.load_robot("laval-mssm")
    centre = [0.01, 0.02, -0.03] if offset else [0.0, 0.0, 0.0]
    robot = cspr_jax.platform(
        mssm.base_points, mssm.platform_points, mass=1.0, inertia=mssm.inertia, centre_of_mass=centre
    )
    check = cspr_jax.check(robot, np.arange(5.0), positions, quaternions, point="origin" if offset else None)
    (motion,) = check.plan.legs[0].motions
    assert (motion.offset is not None) == offset
    return motion


def bezier():
    return cspr_jax.bezier(prototype(), [0.0, 0.0, 1.4], [0.1, 0.0, 1.5], [0.1, 0.1, 1.4], duration=2.0)


def line(law):
    time = 0.7 if law == "s-curve" else None
    return cspr_jax.straight_line(
        prototype(), [0.0, 0.0, 1.4], [0.1, 0.0, 1.5], duration=2.0, law=law, acceleration_time=time
    )


def hypocycloid(arcs, start=(0.5, 0.3, 1.6)):
    return cspr_jax.hypocycloid(prototype(), start, [-0.6, 0.4, 1.8], z0=1.7, arcs=arcs)


def transition(amplitude="quintic"):
    return cspr_jax.transition(prototype(), [0.4, 0.2, 1.5], z0=1.4, oscillations=3, amplitude=amplitude)


def backwards():
    return Backwards(inner(transition()))


def turns():
    robot = prototype()
    return cspr_jax.ellipse(
        robot, [0.0, 0.0, 1.6], [0.5, 0.1, 0.0], [0.0, 0.3, 0.1], frequency=2.0, phase=0.3, turns=1.3
    )


def planned_leg(keys, index):
    """A motion of a plan."""
    plan = cspr_jax.plan({"schema": 1} | keys)
    motions = [motion for leg in plan.legs for motion in leg.motions]
    return motions[index]


ELLIPSES = [
    {"rest": True, "position": [0.0, 0.0, 1.6]},
    {
        "ellipse": {"centre": [0.0, 0.0, 1.6], "half_axes": [[0.3, 0.0, 0.0], [0.0, 0.2, 0.05]], "frequency": 2.4},
        "turns": 0.5,
    },
    {"ellipse": {"centre": [0.02, 0.0, 1.7], "radius": 0.2, "frequency": 2.3}},
    {"rest": True, "position": [0.0, 0.0, 1.6]},
]


def transfer(index):
    return planned_leg({"robot": "prototype", "family": "ellipse", "pose": ELLIPSES}, index)


def rotating_ellipse():
    """From one mean orientation to another, with an oscillation, on the motion that a plan without a rotation has."""
    motion = inner(transfer(1))
    axis = np.array([0.6, 0.0, 0.8])
    start = np.array([0.8, 0.0, 0.6, 0.0])
    rotation = Rotation(start, np.array([0.2, -0.1, 0.4]), axis, np.array([0.1, 0.0]), np.array([0.05, 0.2]))
    return dataclasses.replace(motion, rotation=jax.tree.map(np.asarray, rotation))


def about(axis, angle):
    """Unit quaternion of a rotation."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return [np.cos(0.5 * angle), *(np.sin(0.5 * angle) * axis)]


LEVEL, TILTED, OTHER = about([0, 0, 1], 0.0), about([1, 0.5, 0.2], 0.4), about([0.1, 1, 0.3], 0.6)
HALF_TURN = about([0, 0, 1], np.pi)


def platform(start, end, first=LEVEL, last=LEVEL, **keys):
    mssm = cspr_jax.load_robot("laval-mssm")
    return cspr_jax.platform_motion(mssm, start, end, z0=1.4, arcs=4, orientations=(first, last), **keys)


QUICK = {
    "spline": spline,
    "bezier": bezier,
    "s-curve": lambda: line("s-curve"),
    "hypocycloid, p odd": lambda: hypocycloid(5),
    "ellipse": turns,
}
OTHERS = {
    "platform spline": lambda: platform_spline(False),
    "platform spline with an offset": lambda: platform_spline(True),
    "quintic line": lambda: line("quintic"),
    "cubic line": lambda: line("cubic"),
    "hypocycloid, p even": lambda: hypocycloid(4),
    "hypocycloid from rest": lambda: hypocycloid(5, None),
    "transition": transition,
    "transition with pieces": lambda: transition("A3"),
    "backwards": backwards,
    "from rest to an ellipse": lambda: transfer(0),
    "from an ellipse to another": lambda: transfer(1),
    "from an ellipse to rest": lambda: transfer(2),
    "rotation on an ellipse": rotating_ellipse,
    "platform from rest": lambda: platform(None, [0.3, 0.2, 1.4], LEVEL, TILTED),
    "platform between poses": lambda: platform([0.3, 0.2, 1.4], [-0.2, 0.3, 1.5], TILTED, OTHER, beta_hat=(-1.5, -2.0)),
    "platform to rest": lambda: platform([0.3, 0.2, 1.4], [0.0, 0.0, 1.4], TILTED, LEVEL),
    "platform without a turn": lambda: platform([0.3, 0.2, 1.4], [-0.2, 0.3, 1.5], TILTED, TILTED),
    "platform by half a turn": lambda: platform([0.3, 0.2, 1.4], [-0.2, 0.3, 1.5], LEVEL, HALF_TURN),
    "platform on a standard hypocycloid": lambda: platform(
        [0.3, 0.2, 1.4], [-0.2, 0.3, 1.5], LEVEL, OTHER, variable=False
    ),
}


@pytest.mark.parametrize("make", QUICK.values(), ids=QUICK)
def test_formulas(make):
    assert largest_difference(inner(make())) < TOLERANCE


@THOROUGH
@pytest.mark.parametrize("make", OTHERS.values(), ids=OTHERS)
def test_formulas_of_other_motions(make):
    assert largest_difference(inner(make())) < TOLERANCE
