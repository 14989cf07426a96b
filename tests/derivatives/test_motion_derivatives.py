"""Derivatives of durations, states and margins of motions, and of margins of ellipses, against differences."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.derivatives import ESTIMATE, differences
from support.ellipses import ellipses, flat_spools

import cspr_jax

COUNT = 24
PROMISED = 1e-6
BASE = np.array([[1.3, 0.2, -0.1], [-0.4, 1.1, 0.25], [-0.9, -0.8, 0.05]])


def agree(value, numbers, moves):
    """Derivatives of values of n cases along lines are differences of them; the share that no kink hides."""
    each = jax.jit(jax.vmap(value))
    gradients = jax.jit(jax.vmap(jax.grad(value)))(numbers)
    flat = {k: (np.asarray(g) * moves[k]).reshape(len(g), -1).sum(1) for k, g in gradients.items()}
    scale = 1.0 + np.abs(np.asarray(each(numbers))) + np.max([np.abs(x) for x in flat.values()], axis=0)
    shares = []
    for name, found in flat.items():
        direction = {other: move * (other == name) for other, move in moves.items()}
        wanted, estimate = differences(lambda own: np.asarray(each(own)), numbers, direction)
        smooth = estimate <= ESTIMATE * scale
        assert np.isfinite(found).all()
        assert (np.abs(found - wanted)[smooth] <= PROMISED * scale[smooth]).all(), name
        shares.append(smooth.mean())
    return min(shares)


def moves_of(rng, numbers, size=0.3):
    return {name: size * rng.uniform(-1.0, 1.0, value.shape) for name, value in numbers.items()}


@pytest.mark.quick("4-False")
@pytest.mark.parametrize(
    ("count", "planar"),
    # A point mass in space hangs on three cables or more.
    [(count, planar) for count in (2, 3, 4, 7) for planar in (False, True) if count > 2 or planar],
)
def test_margins_of_ellipses(count, planar):
    """By the ellipse, the frequency, gravity and spools in their plane, on any number of cables; as by `of_many`."""
    rng = np.random.default_rng([count, planar])
    spools = flat_spools(rng, count, planar=planar)
    robot = cspr_jax.point_mass(spools, mass=0.7, pattern="2T" if planar else "3T")
    centre, a, b, frequency = (x[:COUNT] for x in ellipses(rng, spools, 9.81, 200, above=False))
    frequency = 1.07 * frequency  # at the natural one, ellipses parallel to the spools have a kink
    own = {"centre": centre, "a": a, "b": b, "frequency": frequency, "gravity": np.full(COUNT, 9.81)}
    # A stretch of the plane of the spools, and a shear along the vertical.
    own |= {"stretch": np.zeros((COUNT, 2)), "tilt": np.zeros((COUNT, 2))}

    def value(own):
        level = spools[:, :2] - spools[:, :2].mean(0)
        change = jnp.concatenate([level * own["stretch"][None], (level @ own["tilt"])[:, None]], axis=1)
        other = dataclasses.replace(robot, base_points=spools + change, gravity=own["gravity"])
        return cspr_jax.ellipse_margin(other, *(own[name] for name in ("centre", "a", "b", "frequency")))

    listed = cspr_jax.ellipse_margins(robot, centre, a, b, frequency)
    np.testing.assert_allclose(jax.jit(jax.vmap(value))(own), listed, rtol=1e-9, atol=1e-9)
    moves = moves_of(rng, own) | {"frequency": 0.3 * frequency}
    kept = np.array([1.0, 0.0, 1.0]) if planar else np.ones(3)
    moves = moves | {name: moves[name] * kept for name in ("centre", "a", "b")}
    if planar:
        moves["tilt"] *= [1.0, 0.0] if count > 2 else 0.0
    assert agree(value, own, moves) > 0.8  # where an axis is zero its norm has a kink


def test_level_ellipses_have_finite_gradients():
    """Their depth does not swing; nor does an ellipse that is a point."""
    robot = cspr_jax.point_mass(BASE * [1.0, 1.0, 0.0], mass=1.7)
    for a, b in (([0.3, 0.0, 0.0], [0.0, 0.2, 0.0]), ([0.3, 0.0, 0.0], [0.0, 0.0, 0.0]), ([0.0] * 3, [0.0] * 3)):
        given = (np.array([0.1, 0.1, 1.5]), np.array(a), np.array(b), 2.0)
        found = jax.grad(lambda *x: cspr_jax.ellipse_margin(robot, *x), argnums=(0, 1, 2, 3))(*given)
        assert all(np.isfinite(x).all() for x in found)


MOTIONS = {
    "hypocycloid": lambda robot, own: cspr_jax.hypocycloid(robot, [0.7, 0.3, 1.6], own["target"], z0=own["z0"], arcs=4),
    "transition": lambda robot, own: cspr_jax.transition(robot, own["target"], z0=own["z0"], oscillations=5),
    "ellipse": lambda robot, own: cspr_jax.ellipse(
        robot, own["target"], [0.2, 0.1, 0.05], [0.0, 0.2, 0.1], frequency=own["z0"], turns=2.0
    ),
    "straight_line": lambda robot, own: cspr_jax.straight_line(
        robot, [0.2, 0.1, 1.5], own["target"], duration=own["z0"]
    ),
}
OF_MOTIONS = {
    "duration": lambda robot, problem, motion: motion.duration(),
    "position": lambda robot, problem, motion: jnp.dot(motion.state(0.37).position, jnp.asarray([0.3, -0.7, 0.5])),
    "tensions": lambda robot, problem, motion: jnp.sum(cspr_jax.tensions(robot, motion.state(0.37))[:2]),
    "margin": lambda robot, problem, motion: cspr_jax.sampled_margin(problem, motion),
}


@pytest.mark.quick("duration-hypocycloid", "margin-straight_line")
@pytest.mark.parametrize("family", MOTIONS)
@pytest.mark.parametrize("name", OF_MOTIONS)
def test_motions(name, family):
    """By z0, a frequency or a duration, by the target, the spools, mass and gravity."""
    rng = np.random.default_rng(4)
    own = {"z0": rng.uniform(1.5, 2.0, COUNT), "target": np.array([0.2, -0.3, 1.8]) + rng.normal(size=(COUNT, 3)) / 9.0}
    own |= {"base_points": BASE + rng.normal(size=(COUNT, 3, 3)) / 9.0}
    own |= {"mass": rng.uniform(1.0, 2.0, COUNT), "gravity": rng.uniform(9.0, 10.0, COUNT)}
    robot = cspr_jax.point_mass(BASE, mass=1.7)

    def value(own):
        numbers = {key: own[key] for key in ("base_points", "mass", "gravity")}
        other = dataclasses.replace(robot, **numbers)
        problem = cspr_jax.make_problem(other)
        return OF_MOTIONS[name](other, problem, MOTIONS[family](other, own))

    assert agree(value, own, moves_of(rng, own)) > 0.8
