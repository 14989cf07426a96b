"""The check of a motion as JSON and as text for people."""

import math
from typing import Any

import numpy as np

from cspr_jax.curves.spline import Spline
from cspr_jax.motion.peaks import EXTREMES
from cspr_jax.outputs.plan_report import (
    axes_text,
    finite,
    frequency_fields,
    frequency_words,
    missing,
    retimed_words,
    verdict_text,
)
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime.terminal import cell
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import CRITERIA, Verdict
from cspr_jax.verification.criteria import Criterion, bounds_tensions
from cspr_jax.verification.proved_answers import MotionProof

SCHEMA = 1
# Largest number of intervals of failure in the text; the JSON has all of them.
MAX_INTERVALS = 12

# Details that only retimed motions have.
RETIMED = ("planned_duration", "gain", "lower_bound", "gap", "retimed", "path_deviation")


def check_object(plan: PlannedMotions) -> dict[str, Any]:
    """The object that `cspr check --json` prints."""
    answers, peaks = plan.answers, plan.demands
    case = shown_proof(plan)
    fields = {
        "schema": SCHEMA,
        "robot": plan.robot_file.name,
        **missing(plan),
        "verdict": verdict_text(answers.verdict[0], plan.feasible),
        "feasible": plan.feasible,
        "duration": float(answers.duration[0]),
        "margin": float(answers.margin[0]),
        "margin_unit": "N",
        "margin_bound": float(answers.margin_bound[0]),
        "limit_margin": float(answers.limit_margin[0]),
        "tolerated": float(answers.tolerated[0]),
        "not_tolerated": float(answers.not_tolerated[0]),
        "cause": [] if plan.feasible else [cause.to_dict() for cause in plan.causes[0]],
        **case.details,
        "tension_min": float(peaks.tension_min[0]),
        "tension_max": float(peaks.tension_max[0]),
        "tension_margin": float(plan.tension_margin[0]),
        **{row.name: float(getattr(peaks, row.peak)[0]) for row in LIMITS if row.peak},
        "z_lowest": float(peaks.lowest[0]),
        **frequency_fields(plan, 0),
        "demands": {CRITERIA[flag][0]: row for flag, row in _peaks(plan, case).items()},
        "point": plan.point if plan.robot_file.is_platform else None,
        "interpolation": getattr(_motion(plan) or plan.keys, "interpolation", "function"),
        "ends": getattr(_motion(plan) or plan.keys, "ends", "") or None,
        "blocks": case.proof.blocks,
    }
    details = answers.details(0)
    return finite(fields | {name: details[name] for name in RETIMED if name in details})


def shown_proof(plan: PlannedMotions) -> MotionProof:
    """The proof of a plan of a single motion."""
    return plan.legs[0].answers.proof[0]


def _peaks(plan: PlannedMotions, case: MotionProof) -> dict[Verdict, dict[str, Any]]:
    # The worst cable of each limit, with a bound that holds at all times.
    rows, worst = case.criteria, dict[Verdict, int]()
    for k in np.argsort(case.proof.high / case.scales).tolist():
        worst.setdefault(rows[k].flag, k)
    table = {}
    for flag in (flag for flag in CRITERIA if flag in worst):
        k = worst[flag]
        allowed, value = rows[k].allowed, rows[k].value(float(case.proof.high[k]))
        # The bound holds for all cables.
        bound = min((_bound(case, j) for j in range(len(rows)) if rows[j].flag == flag), key=lambda pair: pair[0])[1]
        if flag == Verdict.BELOW_FLOOR:
            value, bound, allowed = (float(plan.frame.height(depth)) for depth in (value, bound, allowed))
        table[flag] = {
            "value": value,
            "bound": bound,
            "allowed": allowed,
            "sense": _sense(plan, rows[k]),
            "unit": rows[k].unit,
            "cable": rows[k].cables[0] if rows[k].cables else None,
            **({"cables": list(rows[k].cables)} if len(rows[k].cables) > 1 else {}),
            "t": float(case.proof.when[k]),
        }
    table |= _sampled_peaks(plan)
    return {flag: table[flag] for flag in CRITERIA if flag in table}


def _sampled_peaks(plan: PlannedMotions) -> dict[Verdict, dict[str, Any]]:
    # Extremes of quantities that the proof does not bound, from samples of the motion.
    peaks, rows = plan.demands, dict[Verdict, tuple[str, str, Any]]()
    if plan.is_redundant:
        low, high = tension_range(plan.problem.robot, plan.problem.limits)
        rows |= {Verdict.SLACK_CABLE: ("tension_min", "N", low), Verdict.OVER_TENSION: ("tension_max", "N", high)}
    limits, winches = plan.problem.limits, plan.problem.robot.winches
    free = (row for row in LIMITS if row.of_mass_centre and getattr(limits, row.name) is None)
    rows |= {row.flag: (row.peak, row.unit, None) for row in free}
    for row in LIMITS if winches is not None else ():
        limit = getattr(limits, row.name) if row.of_winch else None
        if row.of_winch and row.peak in EXTREMES and (limit is None or (plan.is_redundant and bounds_tensions(row))):
            rows[row.flag] = (row.peak, row.unit, limit)
    table, count = {}, plan.problem.robot.n_cables
    for flag, (name, unit, allowed) in rows.items():
        cable = int(peaks.cables[0, EXTREMES.index(name)])
        table[flag] = {
            "value": float(getattr(peaks, name)[0]),
            "bound": math.nan,
            "allowed": math.nan if allowed is None else float(np.broadcast_to(allowed, count)[cable]),
            "unit": unit,
            "sense": "at least" if flag == Verdict.SLACK_CABLE else "at most",
            "cable": cable if cable >= 0 else None,
            "t": float(peaks.when[0, EXTREMES.index(name)]),
        }
    return table


def _sense(plan: PlannedMotions, row: Criterion) -> str:
    # In the axes of the robot file: a floor bounds depths from above, and so heights from below.
    is_height = row.flag == Verdict.BELOW_FLOOR and plan.robot_file.z_axis == "up"
    return "at least" if (row.sense == "least") is not is_height else "at most"


def _bound(case: MotionProof, k: int) -> tuple[float, float]:
    row, slack = case.criteria[k], float(case.proof.low[k])
    return slack / float(case.scales[k]), row.value(slack)


def check_lines(plan: PlannedMotions) -> list[str]:
    """The verdict of a check as text."""
    answers, case = plan.answers, shown_proof(plan)
    duration = float(answers.duration[0])
    lines = [f"{plan.robot_file.name}: motion of {duration:.6g} s, {_taken_as(plan)}; {axes_text(plan)}"]
    lines += _retimed(plan) + list(filter(None, [frequency_words(plan)]))
    if plan.feasible:
        text = "feasible: every criterion is proved to hold at every time"
        stands = float(answers.tolerated[0])
        return [*lines, text if math.isnan(stands) else f"{text}, and for {stands:.3g} of the uncertainty"]
    word = "undecided" if answers.verdict[0] == Verdict.UNDECIDED else "not feasible"
    lines += [f"{word}: {cause.text}" for cause in plan.causes[0]]
    intervals = case.failing
    digits = max(6, 3 - math.floor(math.log10(float(answers.duration[0]))))
    named = ", ".join(f"{start:.{digits}f} to {end:.{digits}f} s" for start, end in intervals[:MAX_INTERVALS])
    more = f", and {len(intervals) - MAX_INTERVALS} more" if len(intervals) > MAX_INTERVALS else ""
    return [*lines, f"it fails from {named}{more}"] if len(intervals) else lines


def _retimed(plan: PlannedMotions) -> list[str]:
    details = plan.answers.details(0)
    if not details.get("retimed"):
        return []
    bound = "" if math.isnan(details["gap"]) else f"; none takes less than {details['lower_bound']:.6g} s"
    text = retimed_words(details["planned_duration"], float(plan.answers.duration[0]))
    return [f"{text}{bound}; {details['path_deviation']:.1g} m from its path"]


def _motion(plan: PlannedMotions) -> Any:
    # The motion, if it is short enough to be held in memory.
    return plan.legs[0].motions[0] if plan.legs[0].motions else None


def _taken_as(plan: PlannedMotions) -> str:
    motion = _motion(plan)
    if motion is None:
        return f"interpolation {plan.keys.interpolation}, checked window by window"
    if not isinstance(motion, Spline):
        proved = (
            "with bounds of its states" if hasattr(motion, "bounds") else "sampled: nothing between samples is proved"
        )
        return f"{type(motion).__name__}, {proved}"
    count = len(motion.knots) - 1
    if motion.interpolation == "pieces":
        return f"{count} polynomial pieces of degree {motion.position.shape[1] - 1}"
    if motion.interpolation == "hermite":
        return f"taken as {count} Hermite pieces of degree {motion.position.shape[1] - 1} between samples"
    kinds = {"cubic": "a cubic spline (C2)", "quintic": "a quintic spline (C4)"}
    ends = {"rest": "at rest at both ends", "natural": "with natural ends", "periodic": "periodic"}
    return f"taken as {kinds[motion.interpolation]} through {count + 1} samples, {ends[motion.ends]}"


def check_table(plan: PlannedMotions):
    """Demands of a motion, and their limits, as a table for a terminal."""
    from rich.table import Table  # only a terminal needs it

    case = shown_proof(plan)
    table = Table()
    heads = ("", "worst", "proved", "allowed", "unit", "cable", "at t (s)")
    for head in heads:
        table.add_column(cell(head), justify="left" if head in ("", "unit") else "right")
    for flag, row in _peaks(plan, case).items():
        sign = "≥" if row["sense"] == "at least" else "≤"
        numbers = row.get("cables", [] if row["cable"] is None else [row["cable"]])
        cable = ", ".join(str(number + 1) for number in numbers) or "-"
        values = [_digits(row["value"], plan.digits)]
        sides = [row[name] for name in ("bound", "allowed")]
        values += [f"{sign} {_digits(side, plan.digits)}" if math.isfinite(side) else "-" for side in sides]
        unit = row["unit"].replace("^2", "²")
        time = f"{row['t']:.4f}" if plan.digits is None else _digits(row["t"], plan.digits)
        table.add_row(*(cell(text) for text in (CRITERIA[flag][1], *values, unit, cable, time)))
    return table


def _digits(value: float, digits: int | None) -> str:
    return f"{value:.{digits or 5}g}" if math.isfinite(value) else "-"
