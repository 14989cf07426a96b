"""Set points as a table of counts of encoders, one row a cycle of the controller.

The first line names the cycle time, the second one the columns, separated by tabs: the count of each encoder and its
rate in counts per second, rounded to whole numbers, and the torque of each motor in N m. Every cycle has a row, the
last one at or just after the end of the motion, which then rests.
"""

from collections.abc import Iterator

import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.machine.setpoints import SetPoints
from cspr_jax.motion.ticks import SAME_TICK
from cspr_jax.robots.model.winches import STANDSTILL


def lines(points: SetPoints, rate: float, counts: np.ndarray | None) -> Iterator[str]:
    """Lines of the file, for encoders with some counts a turn of the motor."""
    if points.angle is None or points.speed is None or points.torque is None or counts is None:
        raise ConfigError("winch.encoder_counts", "missing: must be given for counts")
    _check_end(float(points.t[-1]), points.speed[-1], rate)
    per_radian = counts[None] / (2.0 * np.pi)
    integers = np.rint(np.hstack([points.angle * per_radian, points.speed * per_radian])).astype(np.int64)
    numbers = range(1, points.angle.shape[1] + 1)
    yield f"# cycle time {1.0 / rate!r} s"
    yield "\t".join(f"{head}_{k}" for head in ("count", "count_rate", "torque") for k in numbers)
    for counts_of_row, torque in zip(integers.tolist(), points.torque.tolist(), strict=True):
        yield "\t".join([*map(str, counts_of_row), *map(repr, torque)])


def _check_end(time: float, speeds: np.ndarray, rate: float) -> None:
    # The last row may come after the end of a motion that rests there.
    steps = time * rate
    is_off_grid = abs(steps - round(steps)) > SAME_TICK
    if is_off_grid and np.abs(speeds).max() > STANDSTILL:
        end = f"the motion ends moving at {time:.9g} s, between two cycles"
        raise ConfigError("--rate", f"{rate:g} Hz: {end}: must be one of which its duration is a multiple")
