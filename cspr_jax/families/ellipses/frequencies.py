"""Frequencies that a plan leaves open: natural, best, fastest and slowest within all limits.

Formulas give the frequencies that keep cables taut (`harmonics`). Limits, spools in several planes, pulleys and
obstacles are checked at samples of one turn; the verdict comes from the proof of the resulting motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import formula_hull
from cspr_jax.families.ellipses.rotation import Rotation, rotation_state
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.bounds.affine_bounds import constant
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.verification.bounds.block_slacks import block_slacks
from cspr_jax.verification.criteria import criteria

ANGLES = 128  # samples of a turn for each of many frequencies
FINE = 4096  # samples of a turn for a single frequency
GRID = 65  # number of frequencies tried first
HALVINGS = 40  # bisections after the grid
INSIDE = 1e-5  # relative distance from the ends of the feasible frequencies
# Where no formula bounds it, a frequency is searched for from 1 / WIDEST to WIDEST times the natural one.
WIDEST = 100.0
SLOWER = "a number: the slower this ellipse, the larger the margin"


def chosen_frequency(
    problem: Problem, ellipse: Ellipse, rule: str, scene: Scene | None = None, rotation: Rotation | None = None
) -> float:
    """Frequency that a rule chooses."""
    natural, hull = natural_frequency(problem, ellipse, rule), formula_hull(problem.robot)
    if rule == "natural":
        return natural
    if rule == "best" and hull is not None:
        best = float(harmonics.of_many(harmonics.best_frequency, hull, _batched(ellipse))[0])
        if best == 0.0:
            raise InputError("frequency", rule, SLOWER)
        return natural if math.isnan(best) else best
    low, high = natural / WIDEST, natural * WIDEST
    if hull is not None:
        first, last = (float(x[0]) for x in harmonics.of_many(harmonics.frequency_interval, hull, _batched(ellipse)))
        if math.isnan(first):
            return natural
        low, high = max(low, first), min(high, last)

    # Let limits be touched only if no frequency stays clear of all of them.
    for allowed in (problem, touchable(problem)):
        frequency = searched_frequency(
            lambda rates, allowed=allowed: sampled_slacks(allowed, ellipse, rates, scene, rotation),
            low,
            high,
            natural,
            rule,
        )
        if frequency != natural:
            break
    return frequency


def searched_frequency(slack: Callable, low: float, high: float, natural: float, rule: str) -> float:
    """Frequency that a rule chooses by the slacks of many frequencies."""
    if rule == "best":
        return _largest(slack, low, high, natural)
    return _outermost(slack, low, high, natural, rule)


def natural_frequency(problem: Problem, ellipse: Ellipse, rule: str = "natural") -> float:
    """Natural frequency of a pendulum as long as the centre of an ellipse is below the plane of the spools."""
    depth = float(np.asarray(ellipse.centre) @ np.asarray(plane_normal(problem.robot)))
    if not depth > 0.0:
        raise InputError("frequency", rule, "a number: the centre is not below the spools")
    return math.sqrt(float(problem.robot.gravity) / depth)


def _batched(ellipse: Ellipse) -> Ellipse:
    return Ellipse(*(np.asarray(array)[None] for array in ellipse))


def sampled_slacks(
    problem: Problem,
    ellipse: Ellipse,
    frequencies: Float[np.ndarray, "n"],
    scene: Scene | None,
    rotation: Rotation | None = None,
) -> Float[np.ndarray, "n"]:
    """Smallest slacks at samples of one turn."""
    count = ANGLES if len(frequencies) > 1 else FINE
    angle = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)[:, None]
    cosine, sine = np.cos(angle), np.sin(angle)
    outward = ellipse.cosine * cosine + ellipse.sine * sine
    forward = ellipse.sine * cosine - ellipse.cosine * sine
    rate = frequencies[:, None, None]
    position = np.broadcast_to(ellipse.centre + outward, (len(frequencies), count, 3))
    states = [x.reshape(-1, 3) for x in np.broadcast_arrays(position, rate * forward, -(rate**2) * outward)]
    if rotation is not None:
        angles = np.tile(angle[:, 0], len(frequencies)), np.repeat(frequencies, count)
        states += [np.asarray(x) for x in _rotations(rotation, *map(jnp.asarray, angles))]
    bounds = StateBounds(*(constant(jnp.asarray(x)) for x in states))
    tau = np.zeros(len(frequencies) * count)
    high = block_slacks(problem.robot, problem.limits, lambda start, end: bounds, tau, tau, scene).high
    minimum = high[:, -len(criteria(problem.robot, problem.limits, scene)) :].reshape(len(frequencies), count, -1)
    return minimum.min((1, 2))


@persistent_jit
def _rotations(rotation: Rotation, angles: Array, rates: Array) -> tuple[Array, ...]:
    # Return rotations, angular velocities and accelerations, leaves (n, ...), at angles that change at given rates.
    static = (jnp.ones(()), jnp.zeros(()), jnp.zeros(()))

    def one(angle: Array, rate: Array) -> tuple[Array, ...]:
        p, q = rotation.last
        cosine, sine = jnp.cos(angle), jnp.sin(angle)
        psi = p * cosine + q * sine
        return rotation_state(rotation, static, (psi, rate * (q * cosine - p * sine), -(rate**2) * psi))[:3]

    return jax.vmap(one)(angles, rates)


def _outermost(slack: Callable, low: float, high: float, natural: float, rule: str) -> float:
    # Return the fastest, or the slowest, frequency whose samples are feasible.
    grid = np.geomspace(max(low, natural / WIDEST), high, GRID)
    order = grid[::-1] if rule == "fastest" else grid
    feasible = np.flatnonzero(slack(order) > 0.0)
    if not len(feasible):
        return natural
    first = int(feasible[0])
    inside = float(order[first])
    if first == 0 and ((high >= natural * WIDEST) if rule == "fastest" else (low <= natural / WIDEST)):
        raise InputError("frequency", rule, "a number: nothing bounds the frequency")
    outside = float(order[max(first - 1, 0)])
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if slack(np.array([middle]))[0] > 0.0 else (inside, middle)
    return inside * (1.0 - INSIDE if rule == "fastest" else 1.0 + INSIDE)


def _largest(slack: Callable, low: float, high: float, natural: float) -> float:
    # Return the frequency with the largest smallest slack, by grids that narrow about the best point.
    grid = np.geomspace(low, high, GRID)
    values = slack(grid)
    if not values.max() > 0.0:
        return natural
    if values.argmax() == 0 and low <= natural / WIDEST:
        raise InputError("frequency", "best", SLOWER)
    for _ in range(HALVINGS // 4):
        best = int(values.argmax())
        grid = np.linspace(grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)], GRID)
        values = slack(grid)
    return float(grid[values.argmax()])
