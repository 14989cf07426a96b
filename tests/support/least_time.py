"""How tests ask the package for least times along paths: one function, which knows the package's names and axes."""

import dataclasses
from collections.abc import Callable


@dataclasses.dataclass(frozen=True)
class Answer:
    """What the package says of a path.

    verdict: "feasible" if the motion is proved, "undecided", or a reason why there is none. time, s: infinite without a
    motion. lower: lower bound of the least time, s. motion: motion(times) gives, for times (k,) from 0 to `time`, an
    `oracles.sampled_motion.State` of the mass centre in the axes of the robot's base points; None without a motion.
    """

    verdict: str
    time: float
    lower: float
    motion: Callable | None


def solve(robot, path, limits, grid=500, ramp_time=0.0):
    """Answer of the package.

    Args:
        robot: dict of `oracles.any_motion`.
        path: `oracles.path_rows.Path` of the mass centre: `positions.knots` (n,), m, and `positions.coefficients`
            (n - 1, degree + 1, 3), powers of s less its piece's knot; `quaternions` alike, (w, x, y, z), or None.
        limits: dict of `oracles.path_rows`: tension_min, tension_max, cable_speed_max, cable_acceleration_max, each
            (n,) or a number, speed_max and acceleration_max of the mass centre; a limit that is absent is none.
        grid: number of cells.
        ramp_time: s, 0 for accelerations that may jump.
    """
    raise NotImplementedError("least times along paths")
