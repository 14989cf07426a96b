"""Calibration from Python: what a robot really measures, from readings of its cables and from a tracker."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cspr_jax.api.arguments import calibration_arguments as arguments
from cspr_jax.api.arguments.checks import LimitsOrSpec, RobotOrFile, checked
from cspr_jax.build.robots import build_robot
from cspr_jax.config.keys.trajectory import TrajectoryKeys
from cspr_jax.config.measurements import MeasurementTable
from cspr_jax.config.reading import checked as checked_table
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.errors import ConfigError, InputError, RefusedError
from cspr_jax.errors.arguments import (
    CalibrationDeviations,
    DistanceRows,
    MeasuredPositions,
    MeasuredQuaternions,
    Names,
    NextCount,
    Positive,
    ReadingsOrFile,
)
from cspr_jax.errors.suggestions import with_suggestions
from cspr_jax.machine.calibration.calibrated import Calibrated, calibrated
from cspr_jax.machine.calibration.next_poses import NextPoses
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs import calibration_report as report
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import check_writable, publish

NAME = Path("calibrate")
# Groups of numbers that are estimated if none are named, where the robot has them.
USUAL_GROUPS = ("spools", "attachments", "offsets")


@with_suggestions
@dataclasses.dataclass(frozen=True)
class Calibration:
    """A calibrated robot, and how well it is known.

    Fields:
        robot: the calibrated robot, in the axes of the nominal one.
        offsets: (n_cables,) to be added to measured lengths, or to `zero_length` of winches, m.
        names: (p,) names of the parameters, cables counted from 1.
        covariance: (p, p) of the parameters, m^2, which along what cannot be seen stay as near the nominal ones as they
            can.
        noise: standard deviations of the residuals over the given ones, or over the usual ones if none were given; NaN
            if the measurements leave nothing to estimate it from.
        positions: (k, 3) estimated positions of the origin of the platform axes, or of the point mass, m.
        quaternions: (k, 4) estimated orientations, scalar first.
        is_mistaken: (k, n_cables + 6) measurements that were left out: readings, position, turn.
        not_identifiable: directions that the measurements do not see, in words.
        spool_positions: radius that holds all spools with 95 %, for the `Uncertainty` of plans, m; inf if spools are
            not seen.
        is_converged: whether the iteration converged.
    """

    robot: AnyRobot
    offsets: np.ndarray
    names: tuple[str, ...]
    covariance: np.ndarray
    noise: float
    positions: np.ndarray
    quaternions: np.ndarray
    is_mistaken: np.ndarray
    not_identifiable: tuple[str, ...]
    spool_positions: float
    is_converged: bool
    _result: Calibrated
    _nominal: AnyRobot
    _spec: Mapping[str, Any]
    _lines: tuple[int, ...]
    _source: str
    _next: NextPoses | None

    def to_dict(self) -> dict[str, Any]:
        """The calibration as plain values, for JSON.

        Returns:
            what `cspr calibrate --json` prints.
        """
        return report.calibration_object(self._result, self._nominal, self.robot.name, self._lines, self._next)

    def lines(self) -> list[str]:
        """The calibration as text.

        Returns:
            the lines that `cspr calibrate` prints above its table.
        """
        return report.calibration_lines(self._result, self.robot.name, self._lines, self._next)

    def to_table(self) -> Any:
        """The parameters as the table that `cspr calibrate` prints.

        Returns:
            a table of the package rich.
        """
        return report.calibration_table(self._result, self._nominal)

    @property
    def next_poses(self) -> list[dict[str, Any]]:
        """Poses to measure next: "position", "quaternion" (None for a point mass), and "lengths" or "angles"."""
        return report.next_rows(self._result, self._next)

    def to_toml(self) -> str:
        """The calibrated robot as the text of a robot file.

        Returns:
            TOML with the keys of the nominal robot's file.

        Raises:
            ConfigError: the calibrated numbers are none of a robot file.
        """
        spec = report.calibrated_spec(self._result, self.robot, self._spec)
        build_robot(checked_table(RobotFile, spec, NAME), TrajectoryKeys(), NAME)
        return report.calibrated_text(self._result, spec, self._source)

    @checked()
    def save(self, path: str | Path, *, replace: bool = False) -> Path:
        """Write the calibrated robot's file.

        Args:
            path: file to write, .toml.
            replace: whether an existing file is replaced.

        Returns:
            the path.

        Raises:
            ConfigError: the path does not end in .toml, or the calibrated numbers are none of a robot file.
            RefusedError: the file exists.
            StoreError: the file cannot be written.
        """
        target = check_output(Path(path), replace=replace)
        publish(Disk(), target, self.to_toml().encode("utf-8"))
        return target


def check_output(path: Path, *, replace: bool) -> Path:
    """Refuse a robot file that cannot be written or must not be replaced."""
    if path.suffix != ".toml":
        raise ConfigError("-o", f"{path}: must end in .toml")
    if path.exists() and not replace:
        raise RefusedError(f"{path}: is there already: choose another name, or say --replace")
    check_writable(path)
    return path


@checked()
def calibrate(  # noqa: PLR0913
    robot: RobotOrFile,
    lengths: ReadingsOrFile,
    positions: MeasuredPositions | None = None,
    quaternions: MeasuredQuaternions | None = None,
    *,
    angles: bool = False,
    free: Names = (),
    sigma: CalibrationDeviations | None = None,
    prior: Positive | None = None,
    loss: Literal["squares", "huber", "cauchy"] = "cauchy",
    point: Literal["mass-centre", "origin"] = "origin",
    distances: DistanceRows | None = None,
    next: NextCount = 0,
    limits: LimitsOrSpec = None,
) -> Calibration:
    """Estimate spools, attachment points, offsets and radii of a robot from measurements at many poses.

    Args:
        robot: a robot, the name of one of the catalogue, or the path of a robot file.
        lengths: (k, n_cables) measured lengths, m, or angles of motors, rad; NaN where none was measured. Or the path
            of a table with columns length_1, ... or angle_1, ..., x, y, z, qw, qx, qy, qz.
        positions: (k, 3) positions that a tracker measured, m; NaN where it measured none; None: none at all.
        quaternions: (k, 4) orientations of the platform that it measured, scalar first; None: none at all.
        angles: whether `lengths` are angles of the motors; the robot must have winches.
        free: numbers to estimate: "spools", "attachments", "offsets", "drums", "pulleys", "tracker" (its axes are not
            those of the robot), "target" (the point that it follows is not exactly `point`); empty: the first three.
        sigma: standard deviations of lengths, m, of coordinates of positions, m, and of turns, rad, one to three of
            them; that of angles is times the drum radius over the gear ratio. None: 1e-4, 1e-4 and 1e-3 but for one
            common factor, which is estimated.
        prior: standard deviation of the nominal numbers, m, which keeps the robot near them where measurements tell
            little; needs `sigma`. None: nothing is known of them.
        loss: robust loss with which mistakes are sought, which are then left out; "squares" seeks none.
        point: point of a platform that the tracker follows.
        distances: (m, 4) measured distances between spools: two cables, counted from 1, distance and standard
            deviation, m. Or the path of a table with columns first, second, distance, deviation.
        next: number of poses to propose for further measurements.
        limits: limits of these poses, over those of the robot, as in [limits] of a plan.

    Returns:
        the calibration.

    Raises:
        ConfigError: a file has a mistake.
        InputError: measurements that do not fit the robot or do not determine it, numbers that it does not have, or
            too few poses within the limits.
    """
    file = None if not isinstance(robot, str | Path) else resolve_robot(str(robot), NAME, Path.cwd())
    if file is not None and file.translation_only:
        raise InputError("translation_only", True, "absent: each of the six cables is calibrated by itself")
    nominal: Any = robot if file is None else build_robot(file, TrajectoryKeys(), NAME)
    with double_precision():
        table = arguments.measured_table(nominal, lengths, positions, quaternions, angles)
        inner, frame = centred(nominal)
        names = [free] if isinstance(free, str) else list(free)
        groups = names or [name for name in USUAL_GROUPS if name != "attachments" or isinstance(nominal, PlatformRobot)]
        deviations, ruled = arguments.deviations_of(sigma), arguments.distances_of(distances, nominal)
        data = arguments.measurements_of(table, frame, deviations, ruled, prior, own_axes="tracker" in groups)
        result = calibrated(inner, frame, data, groups, loss, arguments.target_of(inner, point))
        planned = result.next_poses(arguments.limits_at_rest(nominal, limits), next) if next else None
        return _of(result, nominal, arguments.robot_spec(file, nominal), table, lengths, planned)


def _of(
    result: Calibrated,
    nominal: Any,
    spec: Mapping[str, Any],
    table: MeasurementTable,
    source: Any,
    planned: NextPoses | None,
) -> Calibration:
    positions, quaternions = report.poses_in_file(result, *result.estimate.poses)
    return Calibration(
        robot=result.robot(nominal),
        offsets=np.asarray(result.estimate.setup.offsets),
        names=tuple(row.name for row in result.parameters.rows if row.group != "tracker"),
        covariance=result.reported_covariance(),
        noise=result.estimate.noise,
        positions=positions,
        quaternions=quaternions,
        is_mistaken=result.estimate.is_mistaken,
        not_identifiable=tuple(direction.text for direction in result.directions),
        spool_positions=report.spool_uncertainty(result),
        is_converged=result.estimate.is_converged,
        _result=result,
        _nominal=nominal,
        _spec=spec,
        _lines=table.lines,
        _source=Path(source).name if isinstance(source, str | Path) else "arrays",
        _next=planned,
    )
