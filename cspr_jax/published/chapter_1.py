"""Tables 1.1 to 1.3 of the thesis: real numbers of oscillations that the envelopes require."""

import math

import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.build.robots import kernel_robot
from cspr_jax.config.catalogue import CATALOGUE
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.robot import read_robot
from cspr_jax.families.swings.transitions import zero_tension
from cspr_jax.families.swings.transitions.envelope_oscillations import (
    best_epsilon,
    best_inclination,
    horizontal_oscillations,
    least_oscillations,
    many_oscillations,
)
from cspr_jax.families.swings.transitions.transition import transition, weights
from cspr_jax.motion.amplitudes import Amplitude, named
from cspr_jax.numerics.elementary import maximum_of
from cspr_jax.runtime.stages import stage

Key = tuple[str, str, str]  # row, column, reading of the table; "" where there is one reading
DISTANCE = 4.0  # of the target of Table 1.1 from P0, in radii of the spools
_READINGS = {"w_max = 5 sqrt(3)": 5.0 * math.sqrt(3.0), "w_max = 10": 10.0}


def _horizontal(amplitude: Amplitude, w: Array) -> float:
    return float(horizontal_oscillations(amplitude, w))


def _weights(name: str, direction: list[float]) -> Array:
    # Return the weights of a robot of the catalogue for a target on the level of P0; they do not depend on z0.
    path = CATALOGUE / f"{name}.toml"
    robot = kernel_robot(read_robot(path), TrajectoryKeys(), path)
    radius = np.linalg.norm(np.asarray(robot.base_points)[0, :2])
    z0 = jnp.asarray(2.0)
    target = jnp.asarray([DISTANCE * radius * direction[0], DISTANCE * radius * direction[1], 2.0])
    return weights(transition(robot, named("A1"), target, z0))


def table_1_1() -> dict[Key, float | None]:
    """Numbers for planar and spatial robots; the target is four radii away on the level of P0, the amplitude is A1."""
    cases = {
        "Planar": _weights("transition-planar", [1.0, 0.0]),
        "H_0": _weights("transition-prototype", [1.0, 0.0]),  # between two spools
        "H_1": _weights("transition-prototype", [0.0, 1.0]),  # under a spool
    }
    cells: dict[Key, float | None] = {}
    for name, w in cases.items():
        stage(name)
        cells["w_max", name, ""] = float(maximum_of(jnp.abs(w)))
        cells["n", name, ""] = _horizontal(named("A1"), w)
    return cells


def table_1_2() -> dict[Key, float | None]:
    """Numbers by inclination, for the target that gains most from it: sigma R = 1, xi = 1 of (1.114)."""
    w = jnp.array([1.0, 1.0, -2.0])
    cells: dict[Key, float | None] = {}
    for name in ("A1", "A2", "A3"):
        stage(name)
        amplitude = named(name)
        best, minimum = best_inclination(amplitude, w)
        cells[name, "optimal inclination", ""] = float(best)
        for column, v in (
            ("-v_opt", -best),
            ("0", 0.0),
            ("v_opt", best),
            ("0.8", 0.8),
            ("0.999", 0.999),
        ):
            cells[name, column, ""] = float(least_oscillations(amplitude, w, jnp.asarray(v)))
        cells[name, "v_opt", ""] = float(minimum)
    return cells


def table_1_3() -> dict[Key, float | None]:
    """Numbers by amplitude function for a far target, in both readings of its position."""
    cells: dict[Key, float | None] = {}
    for reading, largest in _READINGS.items():
        w = jnp.array([largest, -largest, 0.0])
        cells["n", "A_idl", reading] = float(zero_tension.least_oscillations(w, jnp.asarray(0.0)))
        for name in ("A1", "A2", "A3"):
            stage(f"{reading}, {name}")
            cells["n", name, reading] = _horizontal(named(name), w)
            cells["n of (1.55)", name, reading] = float(many_oscillations(named(name), w))
        stage(f"{reading}, A_eff")
        epsilon, minimum = best_epsilon(w)
        cells["n", "A_eff", reading], cells["epsilon", "A_eff", reading] = minimum, epsilon
        cells["n of (1.55)", "A_eff", reading] = float(many_oscillations(named("effective", epsilon), w))
    return cells


# Copied digit by digit from print.
PUBLISHED: dict[str, dict[Key, str]] = {
    "1.1": {("n", "Planar", ""): "2.15", ("n", "H_0", ""): "3.86", ("n", "H_1", ""): "4.47"},
    "1.2": {
        (row, column, ""): value
        for row, values in {
            "A1": ("0.5681", "1.21", "0.85", "0.69", "0.76", "2.82"),
            "A2": ("0.48798", "1.54", "1.1", "0.93", "1.29", "8.25"),
            "A3": ("0.71002", "1.41", "0.90", "0.61", "0.73", "1.62"),
        }.items()
        for column, value in zip(("optimal inclination", "-v_opt", "0", "v_opt", "0.8", "0.999"), values, strict=True)
    },
    "1.3": {
        (row, column, reading): value
        for reading in _READINGS
        for row, column, value in (
            ("n", "A_idl", "2.76"),
            ("n", "A1", "4.85"),
            ("n", "A2", "5.17"),
            ("n", "A3", "4.72"),
            ("n", "A_eff", "2.94"),
            ("epsilon", "A_eff", "0.0399"),
        )
    },
}
