"""Bounds of the states of every family over blocks of time: they contain samples, and close with their square."""

from functools import partial

import jax
import numpy as np
import pytest
from support.platforms import MSSM, Z0, made, ours, random_pose

import cspr_jax
from cspr_jax.families.beziers.motion import Bezier
from cspr_jax.families.lines.motion import TimedLine, fixed_law, s_curve
from cspr_jax.families.platforms.platform_segment import PlatformMotion
from cspr_jax.families.swings import hypocycloid
from cspr_jax.families.swings.hypocycloid import Hypocycloid
from cspr_jax.families.swings.transitions.transition import transition
from cspr_jax.motion import amplitudes
from cspr_jax.motion.motion import Backwards
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.verification.bounds.batch import batch_key
from cspr_jax.verification.proved_answers import bounds_together

# A polynomial of a user, whose end bends; it serves transitions alone.
BENT = amplitudes.from_polynomial([0.0, 0.0, 0.0, 4.0, -3.0])
EFFECTIVE, SMOOTH = amplitudes.named("effective", 0.15), amplitudes.named("effective-c3", 0.2)
S = np.linspace(-1.0, 1.0, 17)


def line(law, rng):
    law = s_curve(rng.uniform(0.2, 0.8)) if law == "s-curve" else fixed_law(law)
    return TimedLine(rng.normal(size=3), rng.normal(size=3), law, as_float64(rng.uniform(0.5, 5.0)))


def curve(rng):
    return Bezier(*rng.normal(size=(3, 3)), as_float64(rng.uniform(0.5, 5.0)), as_float64(1.0))


def swing(amplitude, rng):
    robot = centred(cspr_jax.load_robot("prototype"))[0]
    places, arcs = rng.uniform([-0.3, -0.3, 0.7], [0.3, 0.3, 1.3], (2, 3)), int(rng.integers(2, 13))
    segment = hypocycloid.segment(robot, *places, as_float64(0.8), odd=np.asarray(arcs % 2 == 1))
    return Hypocycloid(segment, amplitude, as_float64(arcs))


def from_rest(rng):
    robot = centred(cspr_jax.load_robot("prototype"))[0]
    segment = transition(robot, BENT, rng.uniform([-0.3, -0.3, 0.7], [0.3, 0.3, 1.3]), as_float64(0.8))
    return Backwards(Hypocycloid(segment, BENT, as_float64(2 * rng.integers(1, 6))))


def pose(kind, amplitude, rng):
    arcs = int(rng.integers(2, 13))
    ends = random_pose(rng), random_pose(rng)
    segment = made(ours(MSSM), *ends, Z0, tuple(rng.uniform(-6.0, 1.0, 2)), arcs)
    return PlatformMotion(segment, amplitude, as_float64(arcs), kind)


CASES = {
    "s-curve": partial(line, "s-curve"),
    "cubic": partial(line, "cubic"),
    "bezier": curve,
    "hypocycloid-standard": partial(swing, EFFECTIVE),
    "transition": from_rest,
    "hypocycloid": partial(pose, PlatformMotionKind(), SMOOTH),
    "plain": partial(pose, PlatformMotionKind(variable=False, plain=True), EFFECTIVE),
}


@jax.jit
def states(motion, tau):
    return jax.vmap(motion.state)(tau)


def excess(motion, rng, width, count=64):
    """How far states leave their bands over blocks of a share of the time, in parts of the largest; the radii."""
    time = float(motion.duration())
    start = rng.uniform(0.0, 1.0 - width, count) * time
    start[:2] = 0.0, (1.0 - width) * time
    end = start + width * time
    bands = jax.tree.map(np.asarray, motion.bounds(start, end))
    instants = 0.5 * (start + end)[:, None] + 0.5 * (end - start)[:, None] * S
    found = states(motion, np.clip(instants / time, 0.0, 1.0).ravel())
    worst, radii = -np.inf, []
    for name, band in bands._asdict().items():
        value = getattr(found, name)
        assert (band is None) == (value is None)
        if band is None:
            continue
        assert np.isfinite(band.radius).all()
        value = np.asarray(value).reshape(count, len(S), *value.shape[1:])
        s = S.reshape(1, -1, *(1,) * (value.ndim - 2))
        beside = np.abs(value - band.middle[:, None] - band.linear[:, None] * s) - band.radius[:, None]
        worst = max(worst, (beside / np.abs(value).max()).max())
        radii.append(band.radius.max() / np.abs(value).max())
    return worst, max(radii)


def drawn(name, seed):
    return CASES[name](np.random.default_rng(seed))


# Platforms compile for seconds.
@pytest.mark.quick("cubic", "transition", "hypocycloid-standard")
@pytest.mark.parametrize(
    "name", [name if name != "plain" else pytest.param(name, marks=pytest.mark.thorough) for name in CASES]
)
def test_bands_contain_states(name):
    for seed in range(4):
        rng = np.random.default_rng(100 + seed)
        for width in (1.0 / 40.0, 1.0 / 300.0, 1e-6):
            assert excess(drawn(name, seed), rng, width)[0] <= 1e-12


def test_motions_bounded_together_have_the_bounds_of_each():
    """Two swings of one amplitude function, one of another, and a line, in blocks that are mixed."""
    motions = [drawn("hypocycloid-standard", 1), drawn("cubic", 2), drawn("hypocycloid-standard", 3)]
    motions.append(swing(SMOOTH, np.random.default_rng(4)))
    together, rng = bounds_together(motions), np.random.default_rng(5)
    index = rng.integers(0, len(motions), 40)
    start, end = (np.array([float(motions[i].duration()) for i in index]) * x for x in (rng.random(40) / 2, 0.6))
    bounds = together(index, start, end)
    for i, motion in enumerate(motions):
        alone = motion.bounds(start[index == i], end[index == i])
        jax.tree.map(lambda a, b, i=i: np.testing.assert_array_equal(np.asarray(a)[index == i], b), bounds, alone)
    assert batch_key(motions[0]) == batch_key(motions[2]) != batch_key(motions[3])


# What does not compile another kernel is quick enough.
@pytest.mark.quick("s-curve", "hypocycloid-standard")
@pytest.mark.parametrize("name", ["s-curve", "bezier", "hypocycloid-standard", "hypocycloid"])
def test_bands_close_with_the_square_of_blocks(name):
    """Where no knot is near: the third derivative of s-curves jumps, and so does that of the amplitude."""
    motion = drawn(name, 7)
    wide, narrow = (excess(motion, np.random.default_rng(3), width)[1] for width in (2e-3, 2e-4))
    power = np.log10(wide / narrow)
    assert 1.7 < power < 2.3 or (name in ("s-curve", "hypocycloid-standard") and power > 0.9)
