"""Margins of poses one by one, by singular values: of any robot, and where the wrench matrix loses rank; no jax."""

import itertools

import numpy as np

from cspr_jax.feasibility.workspace.required import RequiredWrenches

# Of unit columns: smaller singular values, of the largest and at all, are zero.
RANK, NOTHING = 1e-9, 1e-13
# Of the largest component of a cocircuit: smaller ones are zero.
ZERO = 1e-10
# Of a wrench: what may lie outside of the span of the cables.
OUTSIDE = 1e-9


def cocircuits(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cocircuits of a wrench matrix, and a basis of its span.

    Args:
        matrix: (dof, n_cables).

    Returns:
        (k, n_cables) of unit length, one sign of each; (k, dof) the normals c with c^T W = y, in the span; (dof, rank)
        an orthonormal basis of the span.
    """
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
    found = normals @ rows
    found[np.abs(found) < ZERO * np.abs(found).max(1, keepdims=True)] = 0.0
    return found, (normals / sizes[:rank]) @ left[:, :rank].T, left[:, :rank]


def wrench_margin(
    matrix: np.ndarray, wrenches: RequiredWrenches, low: np.ndarray, high: np.ndarray, measure: str = "tensions"
) -> float:
    """Margin of wrenches: the largest s such that tensions between low + s and high - s give each of them; or capacity.

    Args:
        matrix: (dof, n_cables).
        wrenches: what the cables must supply.
        low: (n_cables,) N.
        high: (n_cables,) N; inf where there is none: a margin counts against finite limits alone.
        measure: "tensions"; "capacity": the distance of the wrenches from the faces of what can be supplied.

    Returns:
        N; inf where nothing bounds it, -inf where a wrench is outside of the span of the cables.
    """
    found, normals, basis = cocircuits(matrix)
    if any(_is_outside(some, basis) for some in wrenches.spanning):
        return -np.inf
    rows, normals = np.concatenate([found, -found]), np.concatenate([normals, -normals])
    finite = np.where(np.isfinite(high), high, 0.0)
    is_void = ((rows > 0.0) & np.isinf(high)).any(1)
    reach = np.where(rows > 0.0, rows * finite, rows * low).sum(1)
    slacks = reach - wrenches.supports(normals)
    if measure == "capacity":
        return float((slacks / np.linalg.norm(normals, axis=1))[~is_void].min(initial=np.inf))
    slacks = slacks / np.abs(rows).sum(1)
    return float(min(slacks[~is_void].min(initial=np.inf), 0.5 * (high - low).min()))


def _is_outside(wrenches: np.ndarray, basis: np.ndarray) -> bool:
    outside = np.linalg.norm(wrenches - wrenches @ basis @ basis.T, axis=1)
    return bool((outside > OUTSIDE * np.linalg.norm(wrenches, axis=1)).any())


def closure_margin(matrix: np.ndarray) -> float:
    """Margin of wrench closure; see `feasibility.workspace.margins.closure_margin`.

    Args:
        matrix: (dof, n_cables).

    Returns:
        the margin, in [-1, 1]; -1 where the cables do not span all components.
    """
    found, _, basis = cocircuits(matrix)
    if basis.shape[1] < len(matrix):
        return -1.0
    other = found != 0.0
    most, least = found.max(1, initial=-np.inf, where=other), found.min(1, initial=np.inf, where=other)
    rarer = np.minimum(most, -least) / np.abs(found).max(1)
    # A component that is zero beside those of a hyperplane's columns may have either sign.
    has_more = (~other).sum(1) >= len(matrix)
    return float(np.where(has_more, np.maximum(rarer, 0.0), rarer).min())
