"""Values of beta-hat to try at the ends of segments, poses at which none can end, and choices for a sequence."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np

from cspr_jax.families.platforms.end_acceleration import endpoint
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.linear import rotations
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import plane_normal
from cspr_jax.robots.statics.wrench_balance import determinant_ratio, is_regular

# Larger values of beta-hat never helped, see docs/theory.md.
LARGEST = 12.0
OPTIONS = 11
# Number of poses computed in one call.
BATCH = 1024
# Number of arcs tried beyond the first number that some values allow; more are rarely better.
BEYOND = 4


def options(
    preferred: Float[np.ndarray, "n"],
    lowest: Float[np.ndarray, "n"],
    highest: Float[np.ndarray, "n"],
    count: int = OPTIONS,
) -> Float[np.ndarray, "n count"]:
    """Values of beta-hat to try, in order.

    The first is the preferred one of (3.91), if it keeps every cable taut, else the middle of the interval (3.92). The
    others divide the interval, cut at +-12, evenly; those nearest to the first one come first.
    """
    preferred, lowest, highest = (np.asarray(x, float) for x in (preferred, lowest, highest))
    low, high = np.maximum(lowest, -LARGEST)[:, None], np.minimum(highest, LARGEST)[:, None]
    is_inside = ((lowest < preferred) & (preferred < highest))[:, None]
    first = np.where(is_inside, preferred[:, None], np.where(low < high, 0.5 * (low + high), np.nan))
    others = low + (high - low) * (np.arange(count - 1) + 0.5) / max(count - 1, 1)
    nearest = np.argsort(np.abs(others - first), axis=1, kind="stable")
    others = np.where(low < high, np.take_along_axis(others, nearest, axis=1), np.nan)
    return np.concatenate([first, others], axis=1)


@jax.jit
def _ends(robot: PlatformRobot, poses) -> tuple[jax.Array, ...]:
    # Return for each pose (3.91), the interval (3.92), the determinant over its value in the middle at the same depth,
    # and the depth.
    def one(position, quaternion, z0):
        end, depth = endpoint(robot, position, quaternion, z0), plane_normal(robot) @ position
        fraction = determinant_ratio(robot, position, rotations.matrix(quaternion))
        return end.preferred, end.lowest, end.highest, fraction, depth

    return jax.vmap(one)(*poses)


def end_options(
    robot: PlatformRobot,
    positions: Float[np.ndarray, "n 3"],
    quaternions: Float[np.ndarray, "n 4"],
    z0: Float[np.ndarray, "n"],
    count: int,
) -> tuple[Float[np.ndarray, "n count"], Bool[np.ndarray, "n"]]:
    """Values of beta-hat to try at poses."""
    preferred, lowest, highest, fraction, depth = in_batches(
        partial(_ends, robot), (positions, quaternions, z0), batch_size=BATCH
    )
    return options(preferred, lowest, highest, count), (depth > 0.0) & is_regular(fraction)


def cheapest_path(costs: list[np.ndarray]) -> list[int]:
    """Choose an option for each pose of a sequence, so that the total cost of the segments is smallest.

    Among equal sums, options that are tried first win; if no path is feasible, the path with the fewest infeasible
    segments.
    """
    # Let an infeasible segment cost more than all feasible ones together.
    finite = [c[np.isfinite(c)] for c in costs]
    wall = 1.0 + 10.0 * sum(float(c.max()) if c.size else 0.0 for c in finite)
    total, back = np.arange(costs[0].shape[0]) * 1e-9, []
    for cost in costs:
        through = total[:, None] + np.where(np.isfinite(cost), cost, wall) + np.arange(cost.shape[1]) * 1e-9
        back.append(through.argmin(0))
        total = through.min(0)
    path = [int(total.argmin())]
    for choice in reversed(back):
        path.append(int(choice[path[-1]]))
    return path[::-1]
