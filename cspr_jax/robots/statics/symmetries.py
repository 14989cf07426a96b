"""Rotations about the vertical and mirror planes that leave a platform robot unchanged, found by trying them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.linear.rotations import about_vertical
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.model.platform import PlatformRobot

LARGEST_FOLD = 6
# Points closer together than this fraction of the robot's largest coordinate are the same.
SAME = 1e-9
ANGLE_ERROR = 1e-9
KEY_DIGITS = 9


class Symmetries(NamedTuple):
    """Symmetries that leave a robot unchanged except for the order of its cables.

    Fields:
        fold: largest k for which a rotation by 2 pi / k about the vertical through the centroid is a symmetry.
        mirrors: azimuths, in [0, pi[, of the vertical mirror planes through the centroid.
    """

    fold: int
    mirrors: tuple[float, ...]


NONE = Symmetries(1, ())


def symmetries(robot: PlatformRobot) -> Symmetries:
    """The symmetries of a robot."""
    fold = next(k for k in range(LARGEST_FOLD, 0, -1) if _maps(robot, about_vertical(2.0 * math.pi / k)))
    # A mirror plane goes through a spool or halves the angle between two.
    base = np.asarray(robot.base_points)[:, :2]
    azimuth = np.arctan2(base[:, 1], base[:, 0])
    halves = np.unique(np.round((0.5 * (azimuth[:, None] + azimuth[None, :])) % math.pi, 12))
    azimuths = sorted({float(x) for h in halves for x in (h, (h + 0.5 * math.pi) % math.pi)})
    mirrors: list[float] = []
    for x in azimuths:
        if _maps(robot, _mirror(x)) and all(abs(math.sin(x - y)) > 1e-6 for y in mirrors):
            mirrors.append(x)
    return Symmetries(fold, tuple(mirrors))


def folded(symmetry: Symmetries, azimuths: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """For each azimuth, the equivalent one that represents all azimuths at which the robot behaves alike."""
    width = 2.0 * math.pi / symmetry.fold
    images = np.mod(np.stack([azimuths, *(2.0 * mirror - azimuths for mirror in symmetry.mirrors)]), width)
    return np.where(width - images < ANGLE_ERROR, 0.0, images).min(0)


def alike(
    symmetry: Symmetries, positions: Float[np.ndarray, "n m"], angles: Float[np.ndarray, "n 3"]
) -> Int[np.ndarray, "n"]:
    """Orientations that represent others: at positions on a mirror plane, orientations are equivalent in pairs."""
    azimuths, stands = np.arctan2(positions[:, 1], positions[:, 0]), np.arange(len(positions))
    mirrored = np.flatnonzero((np.abs(np.sin(azimuths[:, None] - np.asarray(symmetry.mirrors))) < ANGLE_ERROR).any(1))
    if not len(mirrored):
        return stands
    # Mirroring reverses rotations, so that phi becomes pi - phi, and sigma -sigma.
    both = np.concatenate([angles[mirrored], np.array([math.pi, 0.0, 0.0]) + angles[mirrored] * [-1.0, 1.0, -1.0]])
    units = [f(both[:, i]) for i in (0, 2) for f in (np.cos, np.sin)]
    rounded = (
        np.round(np.stack([*units, both[:, 1], *np.tile(positions[mirrored], (2, 1)).T], axis=1), KEY_DIGITS) + 0.0
    )
    same = np.unique(rounded, axis=0, return_inverse=True)[1].reshape(2, -1).min(0)
    _, first, group = np.unique(same, return_index=True, return_inverse=True)
    stands[mirrored] = mirrored[first[group]]
    return stands


def _mirror(azimuth: float) -> np.ndarray:
    return about_vertical(azimuth) @ np.diag([1.0, -1.0, 1.0]) @ about_vertical(-azimuth)


def _maps(robot: PlatformRobot, change: np.ndarray) -> bool:
    # Tell whether the rotated or mirrored robot has the same cables and the same inertia.
    base, points = np.asarray(robot.base_points), np.asarray(robot.platform_points)
    cables = np.concatenate([base, points], axis=1)
    other = np.concatenate([base @ change.T, points @ change.T], axis=1)
    largest = np.abs(cables).max()
    distances = np.linalg.norm(cables[:, None] - other[None, :], axis=2)
    inertia = np.asarray(robot.inertia)
    moved = change @ inertia @ change.T - inertia
    return bool((distances.min(0) <= SAME * largest).all() and np.abs(moved).max() <= SAME * np.abs(inertia).max())
