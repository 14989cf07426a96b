"""Grids of orientations with their neighbours: tilt and torsion, and cells of equal volume in SO(3)."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from cspr_jax.numerics.linear.rotations import from_tilt_torsion

# Largest distance of neighbours on the grid of equal volumes, in steps.
NEAR = 1.5


class OrientationGrid(NamedTuple):
    """Orientations, and pairs of neighbours among them.

    Fields:
        angles: (n, 3) tilt and torsion (phi, theta, sigma), rad.
        volume: (n,) fraction of SO(3) that each orientation represents.
        neighbours: (m, 2) indices of pairs of neighbours.
        start: index of the reference orientation.
    """

    angles: np.ndarray
    volume: np.ndarray
    neighbours: np.ndarray
    start: int


def tilt_torsion_grid(divisions: int) -> OrientationGrid:
    """All multiples of pi / divisions of the three angles, theta below pi; at theta = 0 one for each torsion.

    The volume of SO(3) is sin(theta) d phi d theta d sigma / (8 pi^2): the angles are Euler angles ZXZ, and sigma is
    the sum of the outer two.
    """
    count, step = 2 * divisions, math.pi / divisions
    circle = np.arange(count) * step
    torsion = np.where(circle > math.pi, circle - 2.0 * math.pi, circle)
    tilts = np.arange(1, divisions) * step
    # Indices of the tilted orientations (tilt, azimuth, torsion), which follow the untilted ones.
    index = count + np.arange(len(tilts) * count * count).reshape(len(tilts), count, count)
    mesh = np.meshgrid(tilts, circle, torsion, indexing="ij")
    tilted = np.stack([mesh[1].ravel(), mesh[0].ravel(), mesh[2].ravel()], axis=1)
    upright = np.stack([np.zeros(count), np.zeros(count), torsion], axis=1)
    steps = [
        (index[:-1], index[1:]),
        (index, np.roll(index, -1, axis=1)),
        (index, np.roll(index, -1, axis=2)),
        (np.broadcast_to(np.arange(count), (count, count)), index[0]),
        (np.arange(count), np.roll(np.arange(count), -1)),
    ]
    neighbours = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in steps])
    # Each tilt represents a band of tilts around it, whose area on the sphere is this.
    area = np.cos(tilts - 0.5 * step) - np.cos(tilts + 0.5 * step)
    volume = np.repeat(area * step**2 / (8.0 * math.pi**2), count * count)
    cap = (1.0 - math.cos(0.5 * step)) * 2.0 * math.pi * step / (8.0 * math.pi**2)
    return OrientationGrid(np.concatenate([upright, tilted]), np.append(np.full(count, cap), volume), neighbours, 0)


def equal_volume_grid(divisions: int) -> OrientationGrid:
    """Cells of equal volume and nearly equal extent in all directions, some pi / divisions apart.

    They are products of cells of equal area on the sphere of tilts (in bands of equal cells) with equal steps of
    torsion, since torsion is orthogonal to tilt in the metric of SO(3).
    """
    count, step = 2 * divisions, math.pi / divisions
    cells = [1]  # numbers of cells of the bands; the first band is one cell around the vertical
    cap = math.acos(1.0 - 2.0 / (4.0 * math.pi / step**2))
    rings = max(1, round((math.pi - 2.0 * cap) / step))
    height = (math.pi - 2.0 * cap) / rings
    for i in range(rings):
        area = math.cos(cap + i * height) - math.cos(cap + (i + 1) * height)
        cells.append(max(1, round(2.0 * math.pi * area / step**2)))
    cells.append(1)
    edges = np.concatenate([[0], np.cumsum(cells)]) / sum(cells)
    # Move the edges of bands so that all cells have the same area; each orientation halves the area of its band.
    middle = np.arccos(1.0 - (edges[:-1] + edges[1:]))
    middle[0], middle[-1] = 0.0, math.pi
    tilt = np.repeat(middle, cells)
    azimuth = np.concatenate([(np.arange(n) + 0.5 * (i % 2)) * 2.0 * math.pi / n for i, n in enumerate(cells)])
    circle = np.arange(count) * step
    torsion = np.where(circle > math.pi, circle - 2.0 * math.pi, circle)
    angles = np.stack([np.repeat(azimuth, count), np.repeat(tilt, count), np.tile(torsion, len(tilt))], axis=1)
    return OrientationGrid(angles, np.full(len(angles), 1.0 / len(angles)), _near(angles, NEAR * step), 0)


def cone_grid(divisions: int, tilt: float, torsion: float) -> tuple[np.ndarray, np.ndarray]:
    """Orientations of a cone of tilts, its boundary included, some pi / divisions apart.

    They are products of rings of tilts with torsions. Each is at the middle of the part of SO(3) that it represents,
    except on the boundary.
    """
    step = math.pi / divisions
    rings = math.ceil(tilt / step - 1e-9)
    tilts = np.linspace(0.0, tilt, rings + 1)
    edges = np.concatenate([[0.0], 0.5 * (tilts[1:] + tilts[:-1]), [tilt]])
    areas = np.diff(-np.cos(edges)) if rings else np.ones(1)
    counts = [max(1, math.ceil(2.0 * math.pi * math.sin(x) / step - 1e-9)) for x in tilts]
    azimuth = np.concatenate([np.arange(n) * 2.0 * math.pi / n for n in counts])
    steps = math.ceil(torsion / step - 1e-9)
    sigma = np.linspace(-torsion, torsion, 2 * steps + 1)
    widths = np.ones(len(sigma))
    if steps:
        widths[[0, -1]] = 0.5
    angles = np.stack(
        [np.repeat(azimuth, len(sigma)), np.repeat(np.repeat(tilts, counts), len(sigma)), np.tile(sigma, len(azimuth))],
        axis=1,
    )
    volume = np.repeat(np.repeat(areas / np.array(counts), counts), len(sigma)) * np.tile(widths, len(azimuth))
    return angles, volume / volume.sum()


def planar_grid(divisions: int, largest: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotations about y, some pi / divisions apart."""
    steps = math.ceil(largest * divisions / math.pi - 1e-9)
    theta, widths = np.linspace(-largest, largest, 2 * steps + 1), np.ones(2 * steps + 1)
    if steps:
        widths[[0, -1]] = 0.5
    return np.stack([np.full_like(theta, 0.5 * math.pi), theta, np.zeros_like(theta)], axis=1), widths / widths.sum()


def _near(angles: np.ndarray, angle: float) -> np.ndarray:
    # The tree contains both quaternions of each orientation; keep each pair of neighbours once.
    quaternions = from_tilt_torsion(angles)
    tree = cKDTree(np.concatenate([quaternions, -quaternions]))
    pairs = tree.query_pairs(2.0 * math.sin(0.25 * angle), output_type="ndarray") % len(quaternions)
    pairs = np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1)
    return np.unique(pairs, axis=0)
