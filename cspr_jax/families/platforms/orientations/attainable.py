"""Accessible orientations at a position that a horizontal transition from rest attains, thesis section 3.12.3."""

from __future__ import annotations

import numpy as np

from cspr_jax.families.platforms.answers import PlatformMotionAnswers, reached, trials
from cspr_jax.families.platforms.arcs import CANDIDATES, Candidates, smallest_arcs
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.motion_checker import MotionChecker
from cspr_jax.motion.answers import joined
from cspr_jax.numerics.batches import in_parts
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.linear.rotations import cylindrical_frames, from_tilt_torsion
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.robots.statics.symmetries import NONE, Symmetries, alike

# Number of values of beta-hat tried at the target.
VALUES = 20
# The preferred value is tried first, then every fifth of the others, then the rest.
FEWER = 5
# Numbers of cases in a part of the work, enough to fill batches.
LARGE = 4 * CANDIDATES  # candidates of a search for the smallest numbers of arcs
PART = CANDIDATES // 4  # motions of a search that only tells whether there is one
MIXED = 16  # stride that spreads orientations over the parts of such a search


def attainable(
    checker: MotionChecker,
    positions: Float[np.ndarray, "n 3"],
    angles: Float[np.ndarray, "n 3"],
    z0: Float[np.ndarray, "n"],
    *,
    max_arcs: int,
    values: int = VALUES,
    symmetry: Symmetries = NONE,
    margins: bool = True,
) -> PlatformMotionAnswers:
    """Smallest numbers of arcs from rest to orientations at positions."""
    representatives, inverse = _once(positions, angles, z0, symmetry)

    def part(indices):
        indices = representatives[indices]
        motions, beta_hats = _motions(checker, positions[indices], angles[indices], z0[indices], values)
        return reached(checker, motions, beta_hats, max_arcs=max_arcs, margins=margins)

    return joined(in_parts(part, len(representatives), LARGE // values)).rows(inverse)


def attained(
    checker: MotionChecker,
    positions: Float[np.ndarray, "n 3"],
    angles: Float[np.ndarray, "n 3"],
    z0: Float[np.ndarray, "n"],
    *,
    max_arcs: int,
    values: int = VALUES,
    tried: Int[np.ndarray, "k"] | None = None,
    symmetry: Symmetries = NONE,
) -> Float[np.ndarray, "n"]:
    """Orientations at positions that are attained with some number of arcs and some value of beta-hat.

    `attainable` also tells how, or why not; this function takes half as long.
    """
    representatives, inverse = _once(positions, angles, z0, symmetry)
    each = rounds(values) if tried is None else (tried,)

    def part(indices):
        indices = representatives[indices]
        motions, beta_hats = _motions(checker, positions[indices], angles[indices], z0[indices], values)
        is_attained = np.zeros(len(indices), bool)
        for numbers in each:
            left, options = np.flatnonzero(~is_attained), beta_hats[:, numbers]
            chunk = max(CANDIDATES // max(options.shape[1], 1), 1)
            for piece in (left[k : k + chunk] for k in range(0, len(left), chunk)):
                cell, trial = trials(motions.motions(piece), options[piece])
                arcs = smallest_arcs(checker, trial, max_arcs=max_arcs, margins=False).arcs
                is_attained[piece[cell[arcs > 0]]] = True
        return is_attained

    # Some positions take longer than others: give each part orientations of all positions.
    mixed = np.argsort(np.arange(len(representatives)) % MIXED, kind="stable")
    flags = np.empty(len(representatives), bool)
    representatives[:] = representatives[mixed]
    flags[mixed] = np.concatenate(in_parts(part, len(representatives), PART))
    return flags[inverse]


def rounds(values: int = VALUES) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rounds of values of beta-hat, each tried with every number of arcs where the previous round fails."""
    numbers = np.arange(1, values)
    return np.array([0]), numbers[numbers % FEWER == 0], numbers[numbers % FEWER != 0]


def _once(positions: np.ndarray, angles: np.ndarray, z0: np.ndarray, symmetry: Symmetries):
    # Find representatives of all orientations, and the index of each orientation's representative.
    representatives, inverse = np.unique(alike(symmetry, np.c_[positions, z0], angles), return_inverse=True)
    return representatives, inverse.ravel()


def _motions(
    checker: MotionChecker, positions: np.ndarray, angles: np.ndarray, z0: np.ndarray, values: int
) -> tuple[Candidates, np.ndarray]:
    # Return transitions from rest, and values (n, n_values) of beta-hat at their ends.
    count = len(angles)
    ends = (positions, from_tilt_torsion(angles + cylindrical_frames(positions)))
    beta_hats, can_end = checker.end_options(*ends, z0, values)
    start = (rest_point(z0), np.tile(IDENTITY, (count, 1)))
    rest = np.full(count, AT_REST)
    return Candidates(start, ends, z0, np.arange(count), (rest, rest)), np.where(can_end[:, None], beta_hats, np.nan)
