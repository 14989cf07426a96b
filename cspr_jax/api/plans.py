"""Plans from Python: all that `cspr plan` computes, prints and writes."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.notebooks import Displayed, plan_summary
from cspr_jax.config.parameters import with_values
from cspr_jax.config.plan import checked_plan
from cspr_jax.config.reading import json_text, plain_values, read_toml
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import File, Parameters
from cspr_jax.launch.landings import LaunchErrors, Scatter
from cspr_jax.launch.launch_result import LaunchResult
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs import motion_files, plan_report
from cspr_jax.outputs.mujoco.motion import STEP
from cspr_jax.plans import planning
from cspr_jax.runtime.exact_arithmetic import need_exact
from cspr_jax.schema import labelled
from cspr_jax.schema.setpoints import USUAL_RATE
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish

if TYPE_CHECKING:
    import xarray

    from cspr_jax.machine.setpoints import SetPoints
    from cspr_jax.store.reading.result import Result

# Errors name this instead of a file if there is no file; paths are then relative to the current folder.
NAME = Path("plan")


@dataclasses.dataclass(frozen=True, repr=False)
class Plan(Displayed, planning.PlannedMotions):
    """A planned sequence of motions; see `cspr_jax.plans.planning.PlannedMotions` for its fields."""

    @checked()
    def rows(self, rate: float | None = None) -> dict[str, np.ndarray]:
        """The motion as rows over time.

        Args:
            rate: rows per second over the full plan, Hz, plus one row at its end; None: `samples` rows per segment.

        Returns:
            "t" (n,) s, and columns (n, 3), (n, 4) or (n, n_cables) by the names of `schema.quantities.TRAJECTORY`, in
            the axes of the robot file.

        Raises:
            ConfigError: the rate is not positive, or gives too many rows.
        """
        with double_precision():
            return motion_files.rows(self, rate=rate)

    @checked()
    def rows_to_dict(self, rate: float | None = None) -> dict[str, Any]:
        """The motion as rows over time, in plain values for JSON.

        Args:
            rate: as for `rows`.

        Returns:
            "units" and "rows", each by the names of `rows`; numbers that are not finite are None.

        Raises:
            ConfigError: as for `rows`.
        """
        from cspr_jax.outputs import motion_json  # few plans are written as JSON

        with double_precision():
            return motion_json.rows_object(self, rate)

    @checked()
    def save(self, path: str | Path, rate: float | None = None, anyway: bool = False) -> Path:
        """Write the motion.

        Args:
            path: file to write, .csv, .h5 or .json; an existing file is replaced.
            rate: as for `rows`.
            anyway: whether to write a plan even if it is not feasible; the file says so.

        Returns:
            the path.

        Raises:
            ConfigError: the wrong ending, a plan that is not feasible, or a rate that gives too many rows.
            StoreError: a file cannot be written.
        """
        path = Path(path)
        if path.suffix not in (".csv", ".h5", ".json"):
            raise ConfigError(path, "must end in .csv or .h5 or .json")
        if not (self.feasible or anyway):
            raise ConfigError(path, "not written, since a segment is not proved feasible (anyway=True writes it)")
        from cspr_jax.outputs import motion_json  # few plans are written as JSON

        with double_precision():
            write = motion_json.write_json if path.suffix == ".json" else motion_files.write_rows
            write(self, path, rate=rate)
        return path

    @checked()
    def setpoints(self, rate: float = USUAL_RATE) -> SetPoints:
        """Set points of the axes: what drums and motors do, evaluated at the instants, not interpolated.

        Args:
            rate: instants per second over the full plan, Hz, at most 1e6, plus one at its end.

        Returns:
            times, lengths that drums pay out, tensions, and for a robot with winches angles, speeds and feed-forward
            torques of the motors; see `cspr_jax.machine.setpoints.SetPoints`.

        Raises:
            ConfigError: the rate is out of range or gives too many set points, or the plan has no finite motion.
        """
        from cspr_jax.outputs.setpoints.formats import points_of  # few plans are written as set points

        with double_precision():
            return points_of(self, rate)

    @checked()
    def save_setpoints(self, path: str | Path, rate: float = USUAL_RATE) -> Path:
        """Write set points for a controller, of a feasible plan alone.

        Args:
            path: file to write; an existing file is replaced. .csv: a header line and numbers; .yaml and .json: a
                JointTrajectory of ROS 2; .txt: counts of the encoders, one row a cycle.
            rate: as for `setpoints`.

        Returns:
            the path.

        Raises:
            ConfigError: the wrong ending, a plan that is not feasible, a robot without what the format needs, or a
                rate out of range or with too many set points.
            StoreError: a file cannot be written.
        """
        from cspr_jax.outputs.setpoints.formats import write_set_points  # few plans are written as set points

        with double_precision():
            write_set_points(self, Path(path), rate)
        return Path(path)

    @checked()
    def save_mjcf(self, path: str | Path, step: float = STEP, anyway: bool = False, elastic: bool = False) -> Path:
        """Write a model of the robot for MuJoCo, and beside it NAME_control.csv, the tensions that play the plan.

        Args:
            path: model to write, NAME.xml; existing files of both names are replaced.
            step: longest step of MuJoCo's integrator, s.
            anyway: whether to write a plan even if it is not feasible; cables of the model never push.
            elastic: whether cables are springs, by `axial_stiffness` and `axial_damping` of the robot file; the control
                file then has their unstretched lengths.

        Returns:
            the path.

        Raises:
            ConfigError: the wrong ending, a plan that is not feasible or has no finite motion, or a step that is not
                positive or gives too many rows.
            StoreError: a file cannot be written.
        """
        path = Path(path)
        if path.suffix != ".xml":
            raise ConfigError(path, "must end in .xml")
        if not (self.feasible or anyway):
            raise ConfigError(path, "not written, since a segment is not proved feasible (anyway=True writes it)")
        with double_precision():
            from cspr_jax.outputs.mujoco.mjcf import write_mjcf

            write_mjcf(self, path, step, elastic=elastic)
        return path

    @checked()
    def animate(self, path: str | Path, speed: float = 1.0, anyway: bool = False) -> Path:
        """Write a film of the motion: the robot in space with its cables coloured by tension, and its tensions.

        Args:
            path: file to write, .gif, .mp4 or .html; an existing file is replaced.
            speed: playback speed relative to real time.
            anyway: whether to show a plan even if it is not feasible; the film says so.

        Returns:
            the path.

        Raises:
            ConfigError: the wrong ending, a speed that is not positive, a plan that is not feasible or has no finite
                motion, or no encoder for .mp4.
            StoreError: a file cannot be written.
        """
        from cspr_jax.outputs.plots.films.film import RATES, film
        from cspr_jax.outputs.plots.style.style import Style, in_style

        path, length = Path(path), float(np.sum(self.answers.duration))
        if not (self.feasible or anyway):
            raise ConfigError(path, "not written, since a segment is not proved feasible (anyway=True writes it)")
        if not np.isfinite(length):
            raise ConfigError(path, "not written: the best candidate's motion is not finite; see its verdict")
        point = ", positions of the origin of the platform's axes" if self.is_at_origin else ""
        title = f"{self.robot_file.name}: {length:.4g} s{point}" + ("" if self.feasible else ", NOT PROVED FEASIBLE")
        try:
            with double_precision():
                columns = motion_files.rows(self, rate=max(2.0 * RATES[0], 400.0 / length))
                columns |= motion_files.failures(self) | self.outcome_columns
            with in_style(Style()):
                data = film(path.suffix, title, columns, self.robot_file, self.keys, speed)
        except InputError as error:
            raise ConfigError(path, str(error)) from error
        publish(Disk(), path, data)
        return path

    def certificate(self) -> dict[str, Any]:
        """Certificate of the motion, which the independent checker, or one of your own, can check.

        Returns:
            the content of the file, plain values for JSON; see docs/certificates.md.

        Raises:
            ConfigError: nothing is proved, the proof rests on what a certificate does not hold, or python-flint is not
                installed.
        """
        need_exact("certificate")
        from cspr_jax.plans.certificates import plan_certificate  # few plans are certified

        with double_precision():
            return plan_certificate(self, NAME)

    @checked()
    def save_certificate(self, path: str | Path) -> Path:
        """Write a certificate of the motion, feasible or not.

        Args:
            path: file to write, .json; an existing file is replaced.

        Returns:
            the path.

        Raises:
            ConfigError: as for `certificate`, or the wrong ending.
            StoreError: the file cannot be written.
        """
        path = Path(path)
        if path.suffix != ".json":
            raise ConfigError(path, "must end in .json")
        need_exact("certificate")
        from cspr_jax.plans.certificates import plan_certificate  # few plans are certified

        with double_precision():
            publish(Disk(), path, (json.dumps(plan_certificate(self, path)) + "\n").encode("ascii"))
        return path

    def to_result(self) -> Result:
        """The motion as if `open_result` had read it from a motion file, to be drawn.

        Returns:
            rows and segments.

        Raises:
            StoreError: the motion has numbers that no motion file can hold.
        """
        from cspr_jax.outputs.paths import path_columns  # plans do not load results otherwise
        from cspr_jax.store.reading.result import motion_result

        with double_precision():
            columns = motion_files.rows(self) | motion_files.segments(self) | self.outcome_columns
            columns |= motion_files.failures(self) | path_columns(self)
            return motion_result(motion_files.attributes(self), columns)

    def to_dict(self) -> dict[str, Any]:
        """The plan as plain values, for JSON.

        Returns:
            what `cspr plan --json` prints.
        """
        with double_precision():
            return plan_report.plan_object(self)

    def to_table(self) -> Any:
        """The plan as the table that `cspr plan` prints.

        Returns:
            a table of the package rich.
        """
        with double_precision():
            return plan_report.plan_table(self)

    def _summary(self) -> list[str]:
        return plan_summary(self)

    def _drawn_result(self) -> Result:
        return self.to_result()

    @property
    def launch(self) -> LaunchResult | None:
        """Release and flight of the object that the plan launches; None if it launches nothing."""
        return next((outcome for outcome in self.outcomes if isinstance(outcome, LaunchResult)), None)

    @checked()
    def scatter(self, errors: LaunchErrors) -> Scatter:
        """Scatter of the landings of the launched object.

        Args:
            errors: errors of the release and of the cables.

        Returns:
            the landings of a sample of throws, their covariance, and the covariance for small errors from derivatives.

        Raises:
            ConfigError: a plan that launches nothing.
        """
        launch = self.launch
        if launch is None:
            raise ConfigError(NAME, "launch is missing: nothing is released")
        with double_precision():
            return launch.scatter_of(errors)

    @checked()
    def to_xarray(self, rate: float | None = None) -> xarray.Dataset:
        """The motion as a dataset of xarray, with units and long names.

        Args:
            rate: as for `rows`.

        Returns:
            rows over "t" and segments over "segment", as `open_result(...).to_xarray()` returns for a motion file.

        Raises:
            ConfigError: xarray is not installed, or too many rows.
        """
        labelled.need_xarray()
        with double_precision():
            arrays = self.rows(rate) | motion_files.segments(self) | self.outcome_columns
        return labelled.motion(arrays, motion_files.attributes(self))


@checked()
def plan(given: File, parameters: Parameters = None) -> Plan:
    """Plan a sequence of poses.

    Args:
        given: path of a plan file, or its content as a dictionary (parsed TOML, which may hold arrays instead of
            lists). Paths in a dictionary are relative to the current folder.
        parameters: values of parameters of the plan and of the robot file, by name; they replace those of the plan.

    Returns:
        the plan, feasible or not.

    Raises:
        ConfigError: the plan has mistakes; `lines` of the error names all that were found.
    """
    with double_precision():
        path = NAME if isinstance(given, Mapping) else Path(given)
        if isinstance(given, Mapping) or parameters:
            data = plain_values(given) if isinstance(given, Mapping) else read_toml(path)
            data = with_values(data, parameters)
            planned = planning.plan_of(checked_plan(data, path), path)
            text = json_text(data)
        else:
            planned = planning.plan(path)
            text = planned.text
    fields = {field.name: getattr(planned, field.name) for field in dataclasses.fields(planned)}
    return Plan(**fields | {"text": text})
