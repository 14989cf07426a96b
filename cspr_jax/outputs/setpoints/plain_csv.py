"""Set points as CSV: a header line and numbers, nothing else."""

from collections.abc import Iterator

import numpy as np

from cspr_jax.machine.setpoints import SetPoints

# Heads of the columns, one a cable: with winches, and without.
OF_MOTORS = {"angle": "angle", "speed": "speed", "torque": "torque"}
OF_CABLES = {"length": "length", "rate": "rate", "tension": "tension"}


def lines(points: SetPoints, rate: float, counts: np.ndarray | None) -> Iterator[str]:
    """Lines of the file: t, angles, speeds and torques of the motors; without winches lengths, rates and tensions."""
    del rate, counts
    names = OF_CABLES if points.angle is None else OF_MOTORS
    columns = {head: getattr(points, field) for head, field in names.items()}
    numbers = range(1, points.length.shape[1] + 1)
    yield ",".join(["t", *(f"{head}_{k}" for head in columns for k in numbers)])
    for row in np.column_stack([points.t, *columns.values()]).tolist():
        yield ",".join(map(repr, row))
