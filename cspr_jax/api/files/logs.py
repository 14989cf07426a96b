"""Recorded logs of a machine beside the plan that it has played, from Python."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from cspr_jax.api import plans
from cspr_jax.api.arguments.checks import checked
from cspr_jax.config.cable_logs import CableLog, read_cable_log
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import Kind, Positive
from cspr_jax.machine.forward_kinematics.lengths import lengths_of
from cspr_jax.machine.forward_kinematics.solutions import Search
from cspr_jax.machine.logs.delay import delay_of
from cspr_jax.machine.logs.disagreement import (
    disagreement_of,
    intervals,
    longer_rows,
    null_vectors,
    robust_deviation,
)
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs.logs import log_report
from cspr_jax.outputs.logs.log_report import ComparedLog
from cspr_jax.outputs.logs.plan_curves import PlanCurves, curves_of
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import check_writable, publish
from cspr_jax.workspaces.poses import geometry

PlanOrFile = Annotated[
    str | Path | Mapping[str, Any] | plans.Plan,
    Kind("the path of a plan file, a dictionary of what it holds, or a plan", (str, os.PathLike, Mapping), ("legs",)),
]
# A cable counts as slack where its measured tension is below this fraction of the planned one.
SLACK = 0.05
# Residuals that make a cable longer than the others imply: so many robust deviations, and a fraction of the size.
DEVIATIONS, SMALLEST = 6.0, 1e-4
ROWS, BATCH = 4000, 1024  # rows of which disagreement is judged


class LogComparison(ComparedLog):
    """A log beside its plan; see `cspr_jax.outputs.logs.log_report.ComparedLog` for its fields."""

    def to_dict(self) -> dict[str, Any]:
        """The comparison as plain values.

        Returns:
            what `cspr log --json` prints.
        """
        return log_report.log_object(self)

    def lines(self) -> list[str]:
        """The comparison as text.

        Returns:
            the lines that `cspr log` prints above its table.
        """
        return log_report.log_lines(self)

    def to_table(self) -> Any:
        """Errors of each cable.

        Returns:
            a table of rich.
        """
        return log_report.log_table(self)

    @checked()
    def page(self, output: str | Path) -> Path:
        """Write a page with charts of errors, lengths and tensions: one file that needs no network.

        Args:
            output: page to write, .html; an existing file is replaced.

        Returns:
            the path.

        Raises:
            ConfigError: the wrong ending, or plotly is not installed.
            StoreError: the page cannot be written.
        """
        from cspr_jax.outputs.plots.pages.logs import log_content
        from cspr_jax.outputs.plots.pages.page import page_of

        path = Path(output)
        if path.suffix != ".html":
            raise ConfigError("-o", f"{path}: must end in .html")
        check_writable(path)
        content = log_content(self)
        try:
            publish(Disk(), path, page_of(content["title"], content).encode())
        except InputError as error:
            raise ConfigError(path, str(error)) from error
        return path


@checked()
def compare_log(
    log: str | Path, plan: PlanOrFile, *, tolerance: Positive | None = None, max_delay: Positive = 2.0
) -> LogComparison:
    """Compare a recorded log of a machine with the plan that it has played.

    Args:
        log: CSV with a column t, lengths `length_1`, ... or angles `angle_1`, ... of the motors, and tensions
            `tension_1`, ... if there are any; see `cspr_jax.config.cable_logs`. A platform in three parallel pairs of
            cables has a column a pair, or one a cable.
        plan: plan file, a dictionary of what it holds, or a plan.
        tolerance: largest position error that is allowed after the delay, m; None: any.
        max_delay: largest delay that is looked for, s, before and behind the plan.

    Returns:
        delay, errors of lengths and poses over time, cables that disagree or are slack.

    Raises:
        ConfigError: a mistake in a file, or a plan without a finite motion.
    """
    path = Path(log)
    planned = plan if isinstance(plan, plans.Plan) else plans.plan(plan)
    if not np.isfinite(planned.answers.duration).all():
        raise ConfigError(plan if isinstance(plan, str | Path) else "plan", "has no finite motion: see its verdict")
    with double_precision():
        curves, pairs = curves_of(planned), planned.robot_file.pairs
        robot = planned.problem.robot
        read = read_cable_log(path, robot.n_cables if pairs is None else None, needs_times=True)
        try:
            lengths = _lengths(read, robot, pairs)
        except InputError as error:
            raise ConfigError(path, str(error)) from error
        return _compared(path, planned, curves, read, lengths, tolerance, max_delay)


def _lengths(read: CableLog, robot: Any, pairs: Any) -> np.ndarray:
    # Lengths of the cables that the plan moves, with gaps; the cables of a pair, on one winch, count by their mean.
    values = np.asarray(read.angles if read.lengths is None else read.lengths)
    if pairs is not None and values.shape[1] == 2 * robot.n_cables:
        values = values[:, pairs.cables].mean(2)
    if values.shape[1] != robot.n_cables:
        allowed = f"must be {robot.n_cables}, one a cable" + (f", or {2 * robot.n_cables}" if pairs is not None else "")
        raise InputError("columns", None, allowed, problem=f"{values.shape[1]} of lengths or angles")
    if read.lengths is None:
        is_given = np.isfinite(values)
        values = np.where(is_given, lengths_of(robot, np.where(is_given, values, 0.0), is_angle=True), np.nan)
    return values


def _compared(
    path: Path,
    planned: plans.Plan,
    curves: PlanCurves,
    read: CableLog,
    lengths: np.ndarray,
    tolerance: float | None,
    max_delay: float,
) -> LogComparison:
    times, warnings = np.asarray(read.times), [*planned.warnings, *read.notes]
    if not (-max_delay <= times[0] <= curves.duration + max_delay):
        warnings.append(f"times begin at {times[0]:.9g} s: counted from the first row")
        times = times - times[0]
    lengths = _positive(path, read, lengths, warnings)
    rows = np.flatnonzero(np.isfinite(lengths).all(1))
    largest = min(max_delay, curves.duration)
    delay = delay_of(times, lengths, curves.lengths, curves.rates, largest)
    if read.lengths is None and planned.problem.robot.axial_stiffness is not None:
        lengths = _stretched(lengths, planned, read, curves, times - np.nan_to_num(delay.value), warnings)
        delay = delay_of(times, lengths, curves.lengths, curves.rates, largest)
    if delay.is_at_edge:
        farther = ": --max-delay looks farther" if max_delay < curves.duration else ", the plan's duration"
        warnings.append(f"the delay is at the end of what was looked for, {largest:g} s{farther}")
    shift = 0.0 if np.isnan(delay.value) else delay.value
    robot = centred(planned.problem.robot)[0]
    search = Search(robot, np.ones(robot.n_cables), None, np.zeros(3))
    positions, quaternions = curves.poses(times[rows] - shift)
    poses = search.near(lengths[rows], positions, quaternions)
    measured, orientations = poses.positions[:, 0], poses.quaternions[:, 0]
    before = np.linalg.norm(measured - curves.poses(times[rows])[0], axis=1)
    after = np.linalg.norm(measured - positions, axis=1)
    cosine = np.minimum(np.abs((orientations * quaternions).sum(1)), 1.0)
    angle = 2.0 * np.arccos(cosine) if search.row.is_body else None
    picked = np.unique(np.linspace(0, len(rows) - 1, min(ROWS, len(rows))).astype(int))
    tension, planned_tension, is_slack = _slack(read, curves, planned.robot_file.pairs, times - shift)
    disagreement, longer = _disagreement(search, poses, picked, ~is_slack[rows[picked]].any(1))
    lengthened: list[list[tuple[float, float]]] = [[] for _ in range(robot.n_cables)]
    if longer is not None:
        lengthened = [intervals(times[rows[picked]], longer[:, k]) for k in range(robot.n_cables)]
    return LogComparison(
        robot=planned.robot_file.name,
        family=str(planned.keys.family),
        times=times,
        rows=rows,
        delay=delay,
        length_errors=lengths - curves.lengths(times - shift),
        position_errors_before=before,
        position_errors=after,
        angle_errors=angle,
        is_found=poses.is_found[:, 0],
        residuals=poses.residuals[:, 0],
        disagreement=disagreement,
        n_spare=robot.n_cables - robot.dof,
        tensions=tension,
        planned_tensions=planned_tension,
        slack=None if tension is None else [intervals(times, row) for row in is_slack.T],
        lengthened=lengthened,
        tolerance=tolerance,
        warnings=tuple(warnings),
    )


def _stretched(
    lengths: np.ndarray,
    planned: plans.Plan,
    read: CableLog,
    curves: PlanCurves,
    times: np.ndarray,
    warnings: list[str],
) -> np.ndarray:
    # Lengths of elastic cables: angles give the unstretched ones.
    measured, tensions, _ = _slack(read, curves, planned.robot_file.pairs, times)
    is_measured = measured is not None and measured.shape == tensions.shape
    if measured is not None and is_measured:
        tensions = np.where(np.isfinite(measured), np.maximum(measured, 0.0), tensions)
    whose = "measured" if is_measured else "planned"
    warnings.append(f"cables are elastic: angles give unstretched lengths, to which {whose} tensions add the stretch")
    return lengths * (1.0 + tensions / np.asarray(planned.problem.robot.axial_stiffness))


def _positive(path: Path, read: CableLog, lengths: np.ndarray, warnings: list[str]) -> np.ndarray:
    # Lengths with gaps in place of rows that hold one of 0 or less; refuses logs in which no row is left.
    is_wrong = np.any(lengths <= 0.0, axis=1)
    lengths, words = np.where(is_wrong[:, None], np.nan, lengths), "every row has gaps"
    if is_wrong.any():
        k = int(is_wrong.argmax())
        words = f"line {read.lines[k]}: a length of 0 or less: {np.count_nonzero(is_wrong)} such rows are left out"
        warnings.append(words)
    if not np.isfinite(lengths).all(1).any():
        raise ConfigError(path, f"{words}: must have a row with numbers for all cables")
    return lengths


def _disagreement(search: Search, poses: Any, picked: np.ndarray, is_taut: np.ndarray) -> tuple[Any, np.ndarray | None]:
    # Disagreement over rows with taut cables, if there are any, and rows in which one cable alone is longer.
    robot = search.robot
    if robot.n_cables == robot.dof:
        return None, None
    cases = poses.positions[picked, 0], poses.quaternions[picked, 0]
    matrices = in_batches(lambda x: geometry.wrench_matrices(robot, *x), cases, batch_size=BATCH)
    matrices = matrices / np.where(geometry.scales(robot), search.radius, 1.0)[:, None]
    null, measured = null_vectors(matrices), -poses.residuals[picked, 0]
    counted = is_taut if is_taut.any() else ~is_taut
    disagreement = disagreement_of(null[counted], measured[counted])
    if robot.n_cables < robot.dof + 2:
        return disagreement, None
    constant = np.zeros(robot.n_cables)
    if disagreement.cable is not None:
        constant[disagreement.cable] = disagreement.errors[disagreement.cable]
    rest = measured - constant
    threshold = DEVIATIONS * robust_deviation(null, rest) + SMALLEST * search.size
    return disagreement, longer_rows(null, rest, threshold)


def _slack(
    read: CableLog, curves: PlanCurves, pairs: Any, times: np.ndarray
) -> tuple[np.ndarray | None, np.ndarray, np.ndarray]:
    # Measured and planned tensions, of pairs their sums, and whether each cable, or one of a pair, is slack by them.
    tensions, planned = read.tensions, curves.tensions(times)
    if tensions is None:
        return None, planned, np.zeros(planned.shape, bool)
    each, planned_each = tensions[:, :, None], planned[:, :, None]
    if pairs is not None and tensions.shape[1] == 2 * planned.shape[1]:
        each, planned_each = tensions[:, pairs.cables], curves.tensions_each(times)[:, pairs.cables]
    with np.errstate(invalid="ignore"):
        return each.sum(2), planned, np.any(each <= SLACK * planned_each, axis=2)
