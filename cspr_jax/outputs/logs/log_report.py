"""A recorded log beside its plan, as an object for JSON, as lines and as a table."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from cspr_jax.machine.logs.delay import Delay
from cspr_jax.machine.logs.disagreement import CLEARLY, EXPLAINS, Disagreement
from cspr_jax.outputs.plan_report import finite

MOST_INTERVALS = 5
OFF_PLAN = 3.0  # times the mean difference of the next cable from which on one stands out
Interval = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class ComparedLog:
    """A recorded log beside the plan that the machine has played; errors after the delay unless they say otherwise.

    Fields:
        robot: name of the robot.
        family: family of the plan.
        times: (n,) times of the log, s.
        rows: (k,) indices of its rows without gaps, whose poses are known.
        delay: `value` s, positive where the log is late, `deviation`, and a `rival` that fits nearly as well.
        length_errors: (n, m) measured minus planned lengths, m.
        position_errors_before: (k,) distances of poses from the planned ones of the same time, m.
        position_errors: (k,) distances after the delay is taken out, m.
        angle_errors: (k,) rotations from the planned orientations, rad; None for a point mass.
        is_found: (k,) whether measured lengths have a pose.
        residuals: (k, m) lengths of the cables in the pose minus measured ones, m.
        disagreement: cables that do not agree with the others, over rows in which none is slack by its tension; None
            with as many cables as degrees of freedom.
        n_spare: number of cables beyond degrees of freedom.
        tensions: (n, m) measured tensions, N, or None.
        planned_tensions: (n, m) N.
        slack: for each cable intervals of time in which it is slack by its tension, s; None without tensions.
        lengthened: for each cable intervals in which it alone is longer than the others imply, s.
        tolerance: largest position error that is allowed, m; None: any.
        warnings: what the user should know, one line each.
    """

    robot: str
    family: str
    times: np.ndarray
    rows: np.ndarray
    delay: Delay
    length_errors: np.ndarray
    position_errors_before: np.ndarray
    position_errors: np.ndarray
    angle_errors: np.ndarray | None
    is_found: np.ndarray
    residuals: np.ndarray
    disagreement: Disagreement | None
    n_spare: int
    tensions: np.ndarray | None
    planned_tensions: np.ndarray
    slack: list[list[Interval]] | None
    lengthened: list[list[Interval]]
    tolerance: float | None
    warnings: tuple[str, ...] = ()

    @property
    def within_tolerance(self) -> bool:
        """Tell whether every row has a pose, and none is farther off than allowed."""
        limit = math.inf if self.tolerance is None else self.tolerance
        return bool(self.is_found.all() and self.position_errors.max() <= limit)


def log_object(log: ComparedLog) -> dict[str, Any]:
    """The comparison as an object for JSON."""
    delay = log.delay
    fields = {
        "schema": 1,
        "robot": log.robot,
        "family": log.family,
        "rows": len(log.times),
        "rows_with_gaps": len(log.times) - len(log.rows),
        "rows_without_pose": int((~log.is_found).sum()),
        "delay": delay.value,
        "delay_deviation": delay.deviation,
        "delay_rival": delay.rival,
        "position_error_before": _peak(log, log.position_errors_before),
        "position_error": _peak(log, log.position_errors),
        "angle_error": None if log.angle_errors is None else _peak(log, log.angle_errors),
        "disagreeing_cable": disagreeing_cable(log),
        "disagreement": disagreement_words(log),
        "unexplained": None if log.disagreement is None else log.disagreement.spread,
        "cables": [_cable(log, k) for k in range(log.length_errors.shape[1])],
        "tolerance": log.tolerance,
        "within_tolerance": log.within_tolerance,
        "warnings": list(log.warnings),
    }
    return finite(fields)


def _peak(log: ComparedLog, errors: np.ndarray) -> dict[str, float]:
    if not np.isfinite(errors).any():
        return dict.fromkeys(("rms", "largest", "t"), math.nan)
    k = int(np.nanargmax(errors))
    rms = float(np.sqrt(np.nanmean(errors**2)))
    return {"rms": rms, "largest": float(errors[k]), "t": float(log.times[log.rows[k]])}


def _cable(log: ComparedLog, k: int) -> dict[str, Any]:
    # A row without gaps gives each cable a number.
    errors, disagreement = log.length_errors[:, k], log.disagreement
    worst = int(np.nanargmax(np.abs(errors)))
    row = {
        "cable": k,
        "offset": float(log.delay.offsets[k]),
        "rms": float(np.sqrt(np.nanmean(errors**2))),
        "largest": float(errors[worst]),
        "t": float(log.times[worst]),
        "constant_error": None if disagreement is None else float(disagreement.errors[k]),
        "explains": None if disagreement is None else float(disagreement.fractions[k]),
        "slack": None if log.slack is None else [list(pair) for pair in log.slack[k]],
        "lengthened": [list(pair) for pair in log.lengthened[k]],
    }
    return row | _tension(log, k)


def _tension(log: ComparedLog, k: int) -> dict[str, Any]:
    # The largest difference by which the measured tension is below the planned one, and its time.
    if log.tensions is None or not np.isfinite(log.tensions[:, k]).any():
        return {"tension_shortfall": None, "tension_shortfall_t": None}
    short = log.planned_tensions[:, k] - log.tensions[:, k]
    worst = int(np.nanargmax(short))
    return {"tension_shortfall": float(short[worst]), "tension_shortfall_t": float(log.times[worst])}


def disagreeing_cable(log: ComparedLog) -> int | None:
    """Cable that disagrees with the others: the one that explains most, of several alike the one off the plan."""
    disagreement = log.disagreement
    if disagreement is None or disagreement.cable is not None:
        return None if disagreement is None else disagreement.cable
    first = _off_plan(log)
    return first if first in _alike(disagreement) else None


def _alike(disagreement: Disagreement) -> list[int]:
    # Cables that explain what disagrees about equally well, where they explain much of it.
    best = float(disagreement.fractions.max())
    return np.flatnonzero(disagreement.fractions * CLEARLY >= best).tolist() if best >= EXPLAINS else []


def _off_plan(log: ComparedLog) -> int | None:
    # The cable whose mean difference from the plan is several times that of any other.
    sizes = np.nan_to_num(np.abs(log.delay.offsets))
    order = np.argsort(-sizes)
    return int(order[0]) if len(order) > 1 and sizes[order[0]] > OFF_PLAN * sizes[order[1]] else None


def disagreement_words(log: ComparedLog) -> str:
    """Which cable disagrees with the others, in words."""
    disagreement, off = log.disagreement, _off_plan(log)
    beside = "" if off is None else f"cable {off + 1} is {_off_words(log.delay.offsets[off])} beside the plan's"
    if disagreement is None:
        alternative = (f"; {beside}, or the pose is off the plan" if beside else "") + _stray_words(log)
        return f"which cable disagrees cannot be told with as many cables as degrees of freedom{alternative}"
    k, alike = disagreeing_cable(log), _alike(disagreement)
    if k is None and len(alike) > 1:
        names = ", ".join(str(i + 1) for i in alike)
        alone = f"each alone explains {disagreement.fractions.max():.0%} of what no pose explains"
        return f"one of cables {names} disagrees: {alone}"
    if k is None:
        unexplained = f"{_mm(disagreement.spread)} mm rms that no pose explains"
        return f"no constant error of one cable explains the {unexplained}{_stray_words(log)}"
    others = np.delete(disagreement.fractions, k)
    words = f"cable {k + 1} disagrees: its lengths are {_off_words(disagreement.errors[k])}, which alone explains"
    words += f" {disagreement.fractions[k]:.0%} of what no pose explains (next cable {others.max():.0%})"
    return words if disagreement.cable is not None else f"{words}; of cables alike in this, {beside}"


def _stray_words(log: ComparedLog) -> str:
    # The cable that at some time strays far more from the plan than any other, and than on average: one that sticks.
    rows = [_cable(log, k) for k in range(log.length_errors.shape[1])]
    first, *others = sorted(rows, key=lambda row: -abs(row["largest"]))
    next_largest = abs(others[0]["largest"]) if others else math.inf
    if abs(first["largest"]) <= OFF_PLAN * max(next_largest, abs(first["offset"])):
        return ""
    where = f"up to {_mm(abs(first['largest']))} mm at {_number(first['t'])} s, others by up to {_mm(next_largest)} mm"
    return f"; beside the plan cable {first['cable'] + 1} is off by {where}"


def _off_words(error: float) -> str:
    return f"{_mm(abs(error))} mm too {'large' if error >= 0.0 else 'small'}"


def log_lines(log: ComparedLog) -> list[str]:
    """The comparison as lines for a terminal."""
    gaps = len(log.times) - len(log.rows)
    with_gaps = f", {gaps} with gaps" if gaps else ""
    lines = [f"{log.robot}, {log.family}: {len(log.times)} rows{with_gaps}", _delay_words(log.delay)]
    before, after = (_peak(log, errors) for errors in (log.position_errors_before, log.position_errors))
    lines.append(f"position error: {_peak_words(before)} before the delay is taken out, {_peak_words(after)} after")
    if log.angle_errors is not None:
        degrees = _peak(log, np.degrees(log.angle_errors))
        rms, largest, at = (_number(degrees[name]) for name in ("rms", "largest", "t"))
        lines.append(f"angle error: {rms}° rms, largest {largest}° at {at} s")
    without_pose = int((~log.is_found).sum())
    lines += [f"{without_pose} rows have lengths that no pose has"] if without_pose else []
    lines += [disagreement_words(log), *_slack_lines(log)]
    if log.tolerance is not None:
        words = "within" if log.within_tolerance else "beyond"
        lines.append(f"{words} the tolerance of {_mm(log.tolerance)} mm")
    return lines


def _delay_words(delay: Delay) -> str:
    if math.isnan(delay.value):
        return "delay: cannot be told, since no length changes"
    late = "late" if delay.value >= 0.0 else "early"
    spread = f"{1000.0 * delay.deviation:.2g} ms" if math.isfinite(delay.deviation) else "unknown"
    words = f"delay: {1000.0 * abs(delay.value):.4g} ms {late}, standard deviation {spread}"
    rival = f"; {1000.0 * delay.rival:.4g} ms fits nearly as well" if math.isfinite(delay.rival) else ""
    return words + rival


def _peak_words(peak: dict[str, float]) -> str:
    return f"{_mm(peak['rms'])} mm rms, largest {_mm(peak['largest'])} mm at {_number(peak['t'])} s"


def _slack_lines(log: ComparedLog) -> list[str]:
    lines = []
    for k in range(log.length_errors.shape[1]):
        for intervals, words in ((log.slack, "is slack"), (log.lengthened, "is longer than the others imply")):
            if intervals is not None and intervals[k]:
                shown_parts = [f"{a:.4g} to {b:.4g} s" for a, b in intervals[k][:MOST_INTERVALS]]
                more = f" and {len(intervals[k]) - MOST_INTERVALS} more" if len(intervals[k]) > MOST_INTERVALS else ""
                lines.append(f"cable {k + 1} {words} from {', '.join(shown_parts)}{more}")
    return lines


def _number(value: float | None, form: str = ".4g") -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:{form}}"


def _mm(value: float | None) -> str:
    return _number(None if value is None else 1000.0 * value)


def log_table(log: ComparedLog) -> Any:
    """Errors of each cable, as a table for a terminal."""
    from rich.table import Table  # only a terminal needs it

    table = Table()
    heads = ["cable", "offset (mm)", "rms (mm)", "largest (mm)", "at t (s)"]
    heads += ["alone explains", "by (mm)"] if log.disagreement is not None else []
    heads += ["below planned by (N)"] if log.tensions is not None else []
    for head in heads:
        table.add_column(head, justify="right")
    for k in range(log.length_errors.shape[1]):
        row = _cable(log, k)
        cells = [str(k + 1), *(_mm(row[name]) for name in ("offset", "rms", "largest"))]
        cells.append(_number(row["t"], ".4f"))
        if log.disagreement is not None:
            cells += [_number(row["explains"], ".0%"), _mm(row["constant_error"])]
        if log.tensions is not None:
            cells.append(_number(row["tension_shortfall"]))
        table.add_row(*cells)
    return table
