"""Ends of segments in many poses: values of beta-hat to try, and whether any motion can end there."""

from functools import partial

import jax
import numpy as np

from cspr_jax.arithmetic import rotations
from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.platforms.beta_hat import options
from cspr_jax.platforms.end_acceleration import endpoint
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import plane_normal
from cspr_jax.robots.wrench_balance import determinant_share, is_regular

BATCH = 1024


@jax.jit
def _ends(robot: PlatformRobot, poses) -> tuple[jax.Array, ...]:
    # Return for each pose (3.91), the interval (3.92), the determinant over that at the same depth in the middle, and
    # the depth.
    def one(position, quaternion, z0):
        end, depth = endpoint(robot, position, quaternion, z0), plane_normal(robot) @ position
        share = determinant_share(robot, position, rotations.matrix(quaternion))
        return end.preferred, end.lowest, end.highest, share, depth

    return jax.vmap(one)(*poses)


def end_options(
    robot: PlatformRobot, positions: np.ndarray, quaternions: np.ndarray, z0: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Values of beta-hat to try at poses.

    Args:
        robot: in its reference axes.
        positions: (n, 3) m.
        quaternions: (n, 4).
        z0: (n,) m.
        count: how many values for each.

    Returns:
        (n, count) of `beta_hat.options`; (n,) whether a motion can end there: below the spools, and not beyond a
        singularity.
    """
    preferred, lowest, highest, share, depth = in_batches(
        partial(_ends, robot), (positions, quaternions, z0), size=BATCH
    )
    return options(preferred, lowest, highest, count), (depth > 0.0) & is_regular(share)
