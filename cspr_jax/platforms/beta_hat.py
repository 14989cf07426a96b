"""Values of beta-hat to try at the ends of segments, poses where none can end, and the choice along a sequence."""

from functools import partial

import jax
import numpy as np

from cspr_jax.arithmetic import rotations
from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.platforms.end_acceleration import endpoint
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.point_mass import plane_normal
from cspr_jax.robots.wrench_balance import determinant_share, is_regular

# Larger values of beta-hat have never gained anything, docs/theory.md.
LARGEST = 12.0
OPTIONS = 11
# Poses that are computed in one call.
BATCH = 1024
# Arcs tried beyond the first number that some values allow: more are rarely better.
BEYOND = 4


def options(preferred: np.ndarray, lowest: np.ndarray, highest: np.ndarray, count: int = OPTIONS) -> np.ndarray:
    """Values of beta-hat in the order in which they are tried.

    First the preferred one of (3.91), if it keeps every cable taut, else the middle of the interval (3.92); then
    values that divide the interval evenly, the nearest to the first one first. The interval is cut at +-12.

    Args:
        preferred: (n,) beta-hat of (3.91).
        lowest: (n,) start of the interval (3.92).
        highest: (n,) end of the interval (3.92).
        count: how many values in all.

    Returns:
        (n, count) values; NaN for missing ones, a whole row where no value keeps every cable taut.
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
    # Return for each pose (3.91), the interval (3.92), the determinant over its value at the same depth in the middle,
    # and the depth.
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
        (n, count) of `options`; (n,) whether a motion can end there: below the spools, and not beyond a
        singularity.
    """
    preferred, lowest, highest, share, depth = in_batches(
        partial(_ends, robot), (positions, quaternions, z0), size=BATCH
    )
    return options(preferred, lowest, highest, count), (depth > 0.0) & is_regular(share)


def cheapest_path(costs: list[np.ndarray]) -> list[int]:
    """Choose an option for each pose of a sequence, so that the segments cost least in sum.

    Among equal sums the options that are tried first win; where no path is feasible, the path with the fewest
    infeasible segments.

    Args:
        costs: of each segment, (n_options_at_start, n_options_at_end); inf where it is infeasible.

    Returns:
        the option of each pose.
    """
    # An infeasible segment costs more than everything else together.
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
