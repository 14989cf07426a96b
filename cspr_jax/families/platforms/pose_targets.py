"""Smallest numbers of arcs of a platform's motions to many poses, over values of beta-hat at the ends."""

from __future__ import annotations

from typing import Literal

import numpy as np

from cspr_jax.families.platforms.answers import PlatformMotionAnswers, reached
from cspr_jax.families.platforms.arcs import CANDIDATES, Candidates
from cspr_jax.families.platforms.beta_hat import OPTIONS
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.motion_checker import MotionChecker
from cspr_jax.motion.answers import joined
from cspr_jax.numerics.batches import in_parts
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.schema.families import WITHOUT_BETA_HAT

# Rotation laws with a separate beta-hat at each end; None is the default law.
_SEPARATE = (None, "beta_ff")
Poses = tuple[np.ndarray, np.ndarray]


def rest_poses(z0: Float[np.ndarray, "n"]) -> Poses:
    """Poses at rest in P0."""
    return rest_point(z0), np.tile(IDENTITY, (len(z0), 1))


def start_beta_hat(checker: MotionChecker, starts: Poses, z0: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Beta-hat at starts other than P0: that of (3.91) or of the largest margin; if there is none, that at rest."""
    # There are few different starts: compute the options once for each.
    distinct, inverse = np.unique(np.c_[starts[0], starts[1], z0], axis=0, return_inverse=True)
    values = checker.end_options(distinct[:, :3], distinct[:, 3:7], distinct[:, 7], 1)[0][:, 0]
    return np.where(np.isnan(values), AT_REST, values)[inverse.ravel()]


def pose_arcs(
    checker: MotionChecker,
    motions: Candidates,
    *,
    beta_hat: float | Literal["preferred"] | None = None,
    beat: str | None = None,
    max_arcs: int = 30,
    fixed: np.ndarray | None = None,
) -> PlatformMotionAnswers:
    """Smallest number of arcs of each motion."""

    def part(piece: slice) -> PlatformMotionAnswers:
        targets = motions.motions(np.arange(len(motions.z0))[piece])
        count = 1 if beta_hat == "preferred" else OPTIONS
        values, can_end = checker.end_options(*targets.end, targets.z0, count)
        if beat in WITHOUT_BETA_HAT:
            values = np.zeros((len(targets.z0), 1))
        elif isinstance(beta_hat, float):
            values = np.full((len(targets.z0), 1), beta_hat)
        values = np.where(can_end[:, None], values, np.nan)
        only = None if fixed is None else fixed[piece]
        return reached(checker, targets, values, max_arcs=max_arcs, same=beat not in _SEPARATE, fixed=only)

    return joined(in_parts(part, len(motions.z0), CANDIDATES // (OPTIONS if beta_hat is None else 1)))
