"""Margins of poses one by one, by singular values: for any robot, and where the wrench matrix loses rank; no jax."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float
from cspr_jax.workspaces.poses.facet_normals import CableSubsets
from cspr_jax.workspaces.required_wrenches import RequiredWrenches

RANK = 1e-9  # largest singular values, over the largest of all, that count as zero
NOTHING = 1e-13  # largest singular values that count as zero, since columns are unit vectors
# Products of a facet normal with cables count as zero below this fraction of the largest one.
ZERO = 1e-10
# A wrench lies in the span of the cables if its distance from the span is below this fraction of its length.
OUTSIDE = 1e-9


def facet_normals(
    matrix: Float[np.ndarray, "dof n_cables"],
) -> tuple[Float[np.ndarray, "k n_cables"], Float[np.ndarray, "k dof"], Float[np.ndarray, "dof rank"]]:
    """Facet normals of a wrench matrix, given by their products with the cables, and a basis of its span."""
    left, sizes, right = np.linalg.svd(matrix, full_matrices=False)
    rank = int((sizes > max(RANK * sizes[0], NOTHING)).sum())
    rows = right[:rank]
    if rank == 0:
        return np.zeros((0, matrix.shape[1])), np.zeros((0, matrix.shape[0])), left[:, :0]
    if rank == 1:
        normals = np.ones((1, 1))
    else:
        chosen = np.array(list(itertools.combinations(range(matrix.shape[1]), rank - 1)))
        _, values, vectors = np.linalg.svd(rows.T[chosen])
        normals = vectors[values[:, -1] > RANK, -1]
    components = normals @ rows
    components[np.abs(components) < ZERO * np.abs(components).max(1, keepdims=True)] = 0.0
    return components, (normals / sizes[:rank]) @ left[:, :rank].T, left[:, :rank]


class Planes(NamedTuple):
    """Bounds of the margin of a wrench w: offsets - normals @ w, and half of the narrowest range of tensions.

    Fields:
        offsets: (k,) N.
        normals: (k, dof).
        half_range: N; inf without largest tensions.
        basis: (dof, rank) orthonormal basis of the wrenches that the cables span.
    """

    offsets: np.ndarray
    normals: np.ndarray
    half_range: float
    basis: np.ndarray


def margin_planes(
    matrix: Float[np.ndarray, "dof n_cables"], low: Float[np.ndarray, "n_cables"], high: Float[np.ndarray, "n_cables"]
) -> Planes:
    """Planes whose distances, in newtons of tension, bound the margin: one for each facet normal and sign."""
    components, normals, basis = facet_normals(matrix)
    rows, normals = np.concatenate([components, -components]), np.concatenate([normals, -normals])
    finite = np.where(np.isfinite(high), high, 0.0)
    bounds = ~((rows > 0.0) & np.isinf(high)).any(1)
    rows, normals = rows[bounds], normals[bounds]
    sizes = np.abs(rows).sum(1)
    support = np.where(rows > 0.0, rows * finite, rows * low).sum(1)
    return Planes(support / sizes, normals / sizes[:, None], float(0.5 * (high - low).min()), basis)


def wrench_margin(
    matrix: Float[np.ndarray, "dof n_cables"],
    wrenches: RequiredWrenches,
    low: Float[np.ndarray, "n_cables"],
    high: Float[np.ndarray, "n_cables"],
    measure: Float[np.ndarray, "dof"] | None = None,
) -> float:
    """Margin of wrenches: the largest s such that tensions from low + s to high - s give each; or capacity margin."""
    planes = margin_planes(matrix, low, high)
    if any(is_outside(loads, planes.basis) for loads in wrenches.spanning):
        return -np.inf
    slacks = planes.offsets - wrenches.supports(planes.normals)
    if measure is not None:
        return float((slacks / np.linalg.norm(planes.normals * measure, axis=1)).min(initial=np.inf))
    return float(min(slacks.min(initial=np.inf), planes.half_range))


def is_outside(wrenches: Float[np.ndarray, "n dof"], basis: Float[np.ndarray, "dof rank"]) -> bool:
    """Tell whether some wrench is outside of the span of the cables."""
    outside = np.linalg.norm(wrenches - wrenches @ basis @ basis.T, axis=1)
    return bool((outside > OUTSIDE * np.linalg.norm(wrenches, axis=1)).any())


def closure_margin(matrix: Float[np.ndarray, "dof n_cables"], choices: CableSubsets) -> float:
    """Margin of wrench closure; see `workspaces.poses.margins.closure_margin`."""
    components, _, basis = facet_normals(matrix)
    if basis.shape[1] < len(matrix):
        return -1.0
    other = components != 0.0
    maximum, minimum = components.max(1, initial=-np.inf, where=other), components.min(1, initial=np.inf, where=other)
    rarer = np.minimum(maximum, -minimum) / np.abs(components).max(1)
    # A component that is zero at this pose, but not at every pose, may have either sign.
    always = len(matrix) - 1 + _always_zero(components, choices)
    has_more = (~other).sum(1) > always
    return float(np.where(has_more, np.maximum(rarer, 0.0), rarer).min())


def _always_zero(components: np.ndarray, choices: CableSubsets) -> np.ndarray:
    # Number of components, besides those of a hyperplane's columns, that are zero at every pose of the robot.
    if choices.counts is None:
        return np.zeros(len(components), int)
    n_chosen = components.shape[1] - choices.counts.shape[1]
    more: dict[tuple[int, ...], int] = {}
    for row, counts in zip(choices.table, choices.counts, strict=True):
        support = tuple(sorted(row[n_chosen:][counts > 0.0].tolist()))
        more[support] = int((counts == 0.0).sum())
    return np.array([more.get(tuple(np.flatnonzero(row).tolist()), 0) for row in components])
