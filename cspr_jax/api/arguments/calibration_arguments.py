"""Arguments of calibrations, checked and converted to the kernels' axes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.api.arguments.check_keys import robot_table
from cspr_jax.config.keys.limits import LimitTable
from cspr_jax.config.measurements import MeasurementTable, read_distances, read_measurements
from cspr_jax.config.reading import checked, plain_values, read_toml
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError
from cspr_jax.machine.calibration.measurements import NO_DISTANCES, USUAL, Deviations, Measurements, SpoolDistances
from cspr_jax.motion.given_limits import limits_of
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import UNIT_NORM
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot


def measured_table(robot: AnyRobot, readings: Any, positions: Any, quaternions: Any, angles: bool) -> MeasurementTable:
    """Measurements of a file or of arrays, in the axes of the file."""
    if isinstance(readings, str | Path):
        for key, value in (("positions", positions), ("quaternions", quaternions), ("angles", angles or None)):
            if value is not None:
                raise InputError(
                    key, None, "must be absent: the file has columns for it", problem="given beside a file"
                )
        table = read_measurements(Path(readings), robot.n_cables)
    else:
        table = _from_arrays(robot, np.asarray(readings, float), positions, quaternions, angles)
    if not isinstance(robot, PlatformRobot) and np.isfinite(table.quaternions).any():
        raise InputError("quaternions", None, "must be absent: a point mass has none", problem="given")
    if not np.isfinite(table.readings).any():
        raise InputError("lengths", None, "numbers in some rows", problem="nothing was measured")
    return table


def _from_arrays(
    robot: AnyRobot, readings: np.ndarray, positions: Any, quaternions: Any, angles: bool
) -> MeasurementTable:
    count = len(readings)
    if readings.shape[1] != robot.n_cables:
        shape = f"must be (k, {robot.n_cables}), one column a cable"
        raise InputError("lengths", None, shape, problem=f"an array of shape {readings.shape}")
    points = np.full((count, 3), np.nan) if positions is None else np.asarray(positions, float)
    turns = np.full((count, 4), np.nan) if quaternions is None else np.asarray(quaternions, float)
    for key, values in (("positions", points), ("quaternions", turns)):
        if len(values) != count:
            raise InputError(key, None, f"must have {count} rows, as lengths", problem=f"{len(values)} rows")
    norms = np.linalg.norm(turns, axis=1)
    is_wrong = ~(np.isnan(turns).all(1) | (np.abs(norms - 1.0) <= UNIT_NORM))
    if is_wrong.any():
        raise InputError(
            "quaternions", turns[is_wrong][0].tolist(), "unit quaternions, scalar first, or four times NaN"
        )
    return MeasurementTable(readings, points, turns / norms[:, None], angles, tuple(range(count)))


def measurements_of(
    table: MeasurementTable,
    frame: Frame,
    deviations: Deviations,
    distances: SpoolDistances,
    prior: float | None,
    *,
    own_axes: bool,
) -> Measurements:
    """Measurements in the kernels' axes; with `own_axes`, a tracker's origin is not that of the file."""
    positions = frame.rotated(table.positions) if own_axes else frame.inward(table.positions)
    quaternions = frame.rotated_quaternions(table.quaternions)
    if prior is not None and not deviations.are_given:
        raise InputError("sigma", None, "must be given beside prior, to weigh both", problem="missing")
    deviation = np.inf if prior is None else float(prior)
    return Measurements(table.readings, positions, quaternions, table.are_angles, deviations, distances, deviation)


def deviations_of(sigma: Any) -> Deviations:
    """Standard deviations, with the usual ones behind those that are given."""
    values: list[float] = [] if sigma is None else np.asarray(sigma, float).ravel().tolist()
    if len(values) > len(USUAL):
        allowed = "must be one to three: of lengths, m, of positions, m, and of turns, rad"
        raise InputError("sigma", None, allowed, problem=f"{len(values)} numbers")
    if len(values) == 1:
        values = [values[0], values[0]]
    length, position, rotation = (*values, *USUAL[len(values) :])
    return Deviations(length, position, rotation, sigma is not None)


def distances_of(distances: Any, robot: AnyRobot) -> SpoolDistances:
    """SpoolDistances between spools, of a file or of an array."""
    if distances is None:
        return NO_DISTANCES
    is_file = isinstance(distances, str | Path)
    table = read_distances(Path(distances), robot.n_cables) if is_file else np.asarray(distances, float)
    cables = table[:, :2]
    is_cable = (cables == np.round(cables)) & (cables >= 1) & (cables <= robot.n_cables)
    if not is_cable.all() or (cables[:, 0] == cables[:, 1]).any() or not (table[:, 2:] > 0.0).all():
        allowed = f"two cables from 1 to {robot.n_cables}, a distance > 0 and a standard deviation > 0, m, in each row"
        raise InputError("distances", table.tolist(), allowed)
    first, second = (cables - 1).astype(int).T
    return SpoolDistances(first, second, table[:, 2], table[:, 3])


def target_of(robot: AnyRobot, point: str) -> Float[np.ndarray, "3"]:
    """Point that a tracker follows, from the mass centre or the joint; kernels' axes."""
    if not isinstance(robot, PlatformRobot) or robot.centre_of_mass is None:
        return np.zeros(3)
    if PATTERNS[robot.pattern].is_jointed:
        if point == "mass-centre":
            raise InputError("point", point, "origin for a robot on a joint: the tracker must see where the joint is")
        return np.zeros(3)
    centre = np.asarray(robot.centre_of_mass)
    return np.zeros(3) if point == "mass-centre" else -centre


def limits_at_rest(robot: AnyRobot, limits: Any) -> Limits:
    """Limits of poses at rest, over those of the robot, in the kernels' axes."""
    values = _limit_values(limits, "limits") if isinstance(limits, Mapping) else vars(limits or NO_LIMITS)
    return limits_of(robot, values, vars(robot.limits), "limits.")


def limits_file(path: Path | None) -> dict[str, Any] | None:
    """Limits of a file with the keys of [limits] of a plan."""
    if path is None:
        return None
    return _limit_values(read_toml(path), path)


def _limit_values(spec: Mapping[str, Any], source: object) -> dict[str, Any]:
    # The keys of [limits] that are given, at the top or in a table of this name.
    values = plain_values(spec)
    values = {**values.pop("limits"), **values} if isinstance(values.get("limits"), dict) else values
    return {name: value for name, value in dict(checked(LimitTable, values, source)).items() if value is not None}


def robot_spec(file: RobotFile | None, robot: AnyRobot) -> dict[str, Any]:
    """Keys of a robot's file, in its order."""
    if file is None:
        return robot_table(robot)
    if file.file is not None and file.file.suffix == ".toml":
        return read_toml(file.file)
    return file.model_dump(exclude_unset=True)
