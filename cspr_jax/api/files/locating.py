"""The poses that `cspr locate` computes, prints and writes."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.api.forward_kinematics import ForwardKinematics, forward
from cspr_jax.api.robots import load_robot
from cspr_jax.config.cable_logs import read_cable_log
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.machine.forward_kinematics.lengths import checked_lengths
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs.plan_report import finite
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import publish

MOST_SHOWN = 20  # rows of the table for a terminal
ELASTIC = "cables are elastic: angles give their unstretched lengths, so that the poses leave out the stretch"


@dataclasses.dataclass(frozen=True)
class Located:
    """Poses from measured lengths.

    Fields:
        robot: the robot.
        answers: poses of the rows without gaps.
        rows: (n,) indices of these rows.
        times: (n,) s, or None.
        notes: lines for the user.
    """

    robot: Any
    answers: ForwardKinematics
    rows: np.ndarray
    times: np.ndarray | None
    notes: tuple[str, ...]

    @property
    def is_found(self) -> np.ndarray:
        """Tell of each row whether it has a pose, (n,)."""
        return self.answers.is_found

    def lines(self) -> list[str]:
        """Notes on the poses, beside the table."""
        answers, lines = self.answers, list(self.notes)
        without_pose = int((~answers.is_found).sum())
        if without_pose and answers.slack is not None:
            return [*lines, f"{without_pose} rows have no pose in which all cables are within these lengths"]
        if without_pose:
            words = "no pose has these lengths" if len(answers.is_found) == 1 else f"{without_pose} rows have no pose"
            lines.append(f"{words}: the nearest is shown, which misses them by up to {answers.residual.max():.3g} m")
        if answers.slack is not None:
            return [*lines, "at equilibrium, of least potential energy; slack cables are longer than their distance"]
        if self.robot.n_cables == self.robot.dof:
            solutions = "all solutions there are" if answers.is_complete else "the solutions that were found"
            shown = "shown" if answers.all_positions is not None else "of which one is meant (--all shows all)"
            counts = sorted(set(answers.count.tolist()))
            is_ambiguous = max(counts) > 1 and (answers.all_positions is not None or answers.is_complete)
            lines += [f"{' or '.join(map(str, counts))} solutions, {solutions}, {shown}"] if is_ambiguous else []
        elif answers.is_found.any():
            worst = int(np.abs(answers.residuals).max(0).argmax())
            lines.append(f"lengths disagree by up to {answers.residual.max():.3g} m, most on cable {worst + 1}")
        return lines

    def to_table(self) -> Any:
        """The poses as a table for a terminal."""
        from rich.table import Table  # only a terminal needs it

        table = Table()
        columns, rows = self._columns()
        for head in columns:
            table.add_column(head, justify="right")
        for row in rows[:MOST_SHOWN]:
            table.add_row(*("-" if math.isnan(value) else f"{value:.7g}" for value in row))
        if len(rows) > MOST_SHOWN:
            table.add_row(f"and {len(rows) - MOST_SHOWN} more", *[""] * (len(columns) - 1))
        return table

    def to_dict(self) -> dict[str, Any]:
        """The poses as plain values, for JSON."""
        answers = self.answers
        common: dict[str, Any] = {"schema": 1, "robot": self.robot.name, "z_axis": self.robot.z_axis}
        common |= {"row": (self.rows + 1).tolist(), "t": None if self.times is None else self.times.tolist()}
        common |= {"position": answers.positions.tolist(), "found": answers.is_found.tolist()}
        common |= {"quaternion": answers.quaternions.tolist() if self._is_body else None}
        common |= {"residual": answers.residuals.tolist(), "conditioning": answers.conditioning.tolist()}
        common |= {"steps": answers.steps.tolist(), "count": answers.count.tolist(), "complete": answers.is_complete}
        if answers.slack is not None and answers.tensions is not None:
            common |= {"slack": answers.slack.tolist(), "tension": answers.tensions.tolist()}
        if answers.all_positions is not None and answers.all_quaternions is not None:
            pairs = zip(answers.all_positions, answers.all_quaternions, answers.count, strict=True)
            common["solutions"] = [
                {"position": p[:n].tolist(), "quaternion": q[:n].tolist() if self._is_body else None}
                for p, q, n in pairs
            ]
        return finite(common)

    def save(self, path: Path) -> None:
        """Write the poses as CSV: a header line and numbers, nothing else."""
        columns, rows = self._columns()
        text = [",".join(columns)]
        text += [",".join("nan" if math.isnan(value) else repr(float(value)) for value in row) for row in rows]
        publish(Disk(), path, ("\n".join(text) + "\n").encode())

    @property
    def _is_body(self) -> bool:
        return PATTERNS[self.robot.pattern].is_body

    def _columns(self) -> tuple[list[str], list[list[float]]]:
        # Heads and rows, one a solution.
        answers = self.answers
        heads = ["row"] if self.times is None else ["row", "t"]
        heads += ["x", "y", "z", *(["qw", "qx", "qy", "qz"] if self._is_body else []), "residual", "found"]
        heads += [f"slack_{k + 1}" for k in range(self.robot.n_cables)] if answers.slack is not None else []
        rows = []
        for i, row in enumerate(self.rows):
            positions, turns = answers.positions[i : i + 1], answers.quaternions[i : i + 1]
            if answers.all_positions is not None and answers.all_quaternions is not None and answers.count[i]:
                positions, turns = (x[i, : answers.count[i]] for x in (answers.all_positions, answers.all_quaternions))
            for position, turn in zip(positions, turns, strict=True):
                start = [row + 1] if self.times is None else [row + 1, self.times[i]]
                pose = [*position, *(turn if self._is_body else [])]
                slack = [] if answers.slack is None else answers.slack[i].astype(float)
                rows.append([*start, *pose, answers.residual[i], float(answers.is_found[i]), *slack])
        return heads, rows


def located(
    reference: str,
    measured: Path | list[float],
    *,
    start: list[float] | None = None,
    angles: bool = False,
    all_solutions: bool = False,
    slack: bool = False,
) -> Located:
    """Poses of a robot, by its name or file, from numbers or a file of rows."""
    robot = load_robot(reference)
    times, rows = None, np.zeros(1, int)
    notes: tuple[str, ...] = ()
    if isinstance(measured, Path):
        log = read_cable_log(measured, robot.n_cables)
        angles = log.lengths is None
        values = np.asarray(log.angles if log.lengths is None else log.lengths)
        rows = np.flatnonzero(np.isfinite(values).all(1))
        if not len(rows):
            raise ConfigError(measured, "every row has gaps: must have a row with numbers for all cables")
        gaps = len(values) - len(rows)
        notes = (*log.notes, *([f"{gaps} rows with gaps are left out"] if gaps else []))
        times = None if log.times is None else log.times[rows]
        values, lines = values[rows], log.lines[rows]
    else:
        values, lines = np.array([measured]), None
        if len(measured) != robot.n_cables:
            option = "--angles" if angles else "--lengths"
            raise ConfigError(option, f"{len(measured)} numbers: must be {robot.n_cables}, one a cable")
    if angles and robot.axial_stiffness is not None:
        notes = (*notes, ELASTIC)
    settings: dict[str, Any] = {}
    if start is not None:
        settings["start"] = start[:3]
        if len(start) > 3:
            norm = np.linalg.norm(start[3:])
            settings["start_orientations"] = np.array(start[3:]) / (norm if abs(norm - 1.0) < 1e-3 else 1.0)
    try:
        with double_precision():
            values = checked_lengths(robot, values, is_angle=angles, lines=lines)
    except InputError as error:
        option = "--angles" if angles else "--lengths"
        raise ConfigError(measured if isinstance(measured, Path) else option, str(error)) from error
    try:
        answers = forward(robot, values, all_solutions=all_solutions, equilibrium=slack, **settings)
    except InputError as error:
        raise ConfigError(measured if isinstance(measured, Path) else reference, str(error)) from error
    return Located(robot, answers, rows, times, notes)
