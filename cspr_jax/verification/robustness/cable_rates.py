"""Speeds and accelerations of the cables of all robots whose spools are displaced a little, over blocks of time."""

from __future__ import annotations

import numpy as np

from cspr_jax.numerics.elementary import unit_vectors
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.model.limits import Limits
from cspr_jax.verification.bounds.enclosures import Enclosure, Influence


def rates_hold(
    enclosure: Enclosure, influence: Influence, limits: Limits, spools: Float[np.ndarray, "k"]
) -> Bool[np.ndarray, "k"]:
    """Prove that every cable of every robot keeps its limits of speed and acceleration within blocks."""
    is_met, largest = np.ones(len(spools), bool), _limits_of_rates(limits)
    if largest is None:
        return is_met
    # Within the block each ray of every robot lies in a ball around the planned ray in the middle.
    ball = np.minimum((enclosure.moved + spools[:, None]) / influence.lengths, 1.0)
    units, rates = enclosure.rays / influence.lengths[..., None], enclosure.rates
    slowest, fastest = _along(units, rates.velocity, ball)
    minimum, maximum = _along(units, rates.acceleration, ball)
    norm = np.linalg.norm(rates.velocity, axis=2)
    short, long = influence.lengths * (1.0 - ball), influence.lengths * (1.0 + ball)
    speed = np.maximum(np.abs(slowest), np.abs(fastest)) + rates.velocity_change
    low = np.where(slowest * fastest > 0.0, np.minimum(np.abs(slowest), np.abs(fastest)), 0.0) - rates.velocity_change
    across = (norm + rates.velocity_change) ** 2 - np.maximum(low, 0.0) ** 2
    inward = np.maximum(np.maximum(norm - rates.velocity_change, 0.0) ** 2 - speed**2, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        up = across / short + maximum + rates.acceleration_change
        down = inward / long + minimum - rates.acceleration_change
    second_derivative = np.where(short > 0.0, np.maximum(np.abs(up), np.abs(down)), np.inf)
    return ((speed <= largest[0]) & (second_derivative <= largest[1])).all(1)


def _limits_of_rates(limits: Limits) -> tuple[np.ndarray, np.ndarray] | None:
    rate_limits = limits.cable_speed_max, limits.cable_acceleration_max
    if all(x is None for x in rate_limits):
        return None
    speed, acceleration = (np.array(np.inf) if x is None else np.asarray(x) for x in rate_limits)
    return speed, acceleration


def _along(units: np.ndarray, vectors: np.ndarray, ball: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # Bound components of vectors along all rays within balls around given rays, of radii `ball` times their lengths.
    component, norm = np.sum(units * vectors, axis=2), np.linalg.norm(vectors, axis=2)
    across = np.sqrt(np.maximum(norm**2 - component**2, 0.0))
    angle, inclination = np.arcsin(ball), np.arctan2(across, component)
    return norm * np.cos(np.minimum(inclination + angle, np.pi)), norm * np.cos(np.maximum(inclination - angle, 0.0))


def rates_fail(
    enclosure: Enclosure, influence: Influence, limits: Limits, spools: Float[np.ndarray, "k"]
) -> Bool[np.ndarray, "k"]:
    """Tell whether a cable of some robot exceeds a limit of speed or acceleration in the middle of each block.

    Spools are displaced along their rays, and across them in the direction of the velocity or the acceleration.
    """
    broken, largest = np.zeros(len(spools), bool), _limits_of_rates(limits)
    if largest is None:
        return broken
    units, (velocity, acceleration, _, _) = enclosure.rays / influence.lengths[..., None], enclosure.rates
    directions = [units]
    for vectors in (velocity, acceleration):
        directions.append(unit_vectors(vectors - np.sum(vectors * units, axis=2, keepdims=True) * units))
    for direction in directions:
        for sign in (1.0, -1.0):
            rays = enclosure.rays - sign * spools[:, None, None] * direction
            lengths = np.linalg.norm(rays, axis=2)
            rate = np.sum(rays * velocity, axis=2) / lengths
            second_derivative = (np.sum(velocity**2 + rays * acceleration, axis=2) - rate**2) / lengths
            broken |= ((np.abs(rate) > largest[0]) | (np.abs(second_derivative) > largest[1])).any(1)
    return broken
