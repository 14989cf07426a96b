"""A plan as JSON and as a table for people."""

import itertools
import math
from collections.abc import Callable
from typing import Any

from cspr_jax.outputs.paths import path_lines
from cspr_jax.outputs.table_layout import two_digits
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.runtime.terminal import cell
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.plan_fields import SEGMENT
from cspr_jax.schema.verdicts import Verdict

SCHEMA = 1
# Digits of positions, so that they can be copied into a plan: a position counts as P0 to 1e-9 of the robot's size.
DIGITS = 12


def plan_object(plan: PlannedMotions) -> dict[str, Any]:
    """The object that `cspr plan --json` prints."""
    segments = [_segment_object(plan, i) for i in range(len(plan.answers.arcs))]
    fields = {
        "schema": SCHEMA,
        "robot": plan.robot_file.name,
        **missing(plan),
        "family": plan.keys.family,
        "amplitude": plan.problem.amplitude.name if plan.keys.takes_amplitude else None,
        "z0": plan.z0,
        "z_axis": plan.robot_file.z_axis,
        "point": plan.point if plan.robot_file.is_platform else None,
        "gravity": float(plan.problem.robot.gravity),
        "segments": segments,
        "total_duration": float(plan.answers.duration.sum()),
        "feasible": plan.feasible,
    }
    return finite(fields | {result.key: result.to_dict() for result in plan.outcomes})


def missing(plan: PlannedMotions) -> dict[str, list[int]]:
    """Field of cables that are gone, for JSON; none where the robot has all."""
    cables = plan.robot_file.missing_cables
    return {"without": list(cables)} if cables else {}


def missing_words(plan: PlannedMotions) -> str:
    """Words for the cables that are gone."""
    numbers = [str(i + 1) for i in plan.robot_file.missing_cables]
    return f"without cable{'s' * (len(numbers) > 1)} {', '.join(numbers)}" if numbers else ""


def axes_text(plan: PlannedMotions) -> str:
    """Axes of the positions in files of a plan, and the point that they describe."""
    point = "; files hold the positions of the origin of the platform's axes" if plan.is_at_origin else ""
    return f"z {plan.robot_file.z_axis}{point}"


def verdict_text(verdict: int, feasible: bool) -> str:
    """A verdict as a plan shows it."""
    return "feasible" if feasible else Verdict(int(verdict)).text


# Fields of segments that are never null: every family has the first; the second is left out where a family has none.
_OF_DETAILS = ("margin_unit", "tried_oscillations")


def _segment_object(plan: PlannedMotions, i: int) -> dict[str, Any]:
    answers, peaks = plan.answers, plan.demands
    arcs = int(answers.arcs[i])
    fields = {
        "from": i,
        "to": i + 1,
        "family": plan.keys.family_of(i),
        "arcs": arcs or None,
        "tried_arcs": int(answers.tried_arcs[i]),
        "duration": float(answers.duration[i]),
        "tension_min": float(peaks.tension_min[i]),
        "tension_max": float(peaks.tension_max[i]),
        "mu_min": float(peaks.mu_min[i]),
        "margin": float(answers.margin[i]),
        "margin_bound": float(answers.margin_bound[i]),
        "limit_margin": float(answers.limit_margin[i]),
        "tolerated": float(answers.tolerated[i]),
        "not_tolerated": float(answers.not_tolerated[i]),
        "tension_margin": float(plan.tension_margin[i]),
        "det_sign_constant": bool(peaks.depth_min[i] > 0.0),
        "verdict": verdict_text(answers.verdict[i], bool(plan.is_feasible[i])),
        "cause": None if plan.is_feasible[i] else [cause.to_dict() for cause in plan.causes[i]],
        "fewer_arcs_undecided": bool(answers.verdict[i] & Verdict.FEWER_ARCS_UNDECIDED),
        "feasible_at_infinity": float(answers.feasible_at_infinity[i]),
        "z_lowest": float(peaks.lowest[i]),
        **{row.name: float(getattr(peaks, row.peak)[i]) for row in LIMITS if row.peak},
        **frequency_fields(plan, i),
        "samples": int(peaks.samples[i]),
    }
    of_some = dict.fromkeys(name for name in SEGMENT if name not in (*fields, *_OF_DETAILS))
    return fields | of_some | plan.details(i)


def frequency_fields(plan: PlannedMotions, i: int) -> dict[str, float]:
    """Lowest natural frequency of a segment, and its time."""
    lowest = None if plan.frequencies is None else plan.frequencies[i]
    values = (math.nan, math.nan) if lowest is None else (lowest.lowest, lowest.t)
    return dict(zip(("natural_frequency_min", "natural_frequency_t"), values, strict=True))


def frequency_words(plan: PlannedMotions) -> str:
    """Lowest natural frequency of a plan, in words; empty on cables that do not stretch."""
    finite_rows = [(row.lowest, row.t, i) for i, row in enumerate(plan.frequencies or ()) if math.isfinite(row.lowest)]
    if not finite_rows:
        return ""
    lowest, t, i = min(finite_rows)
    of_segment = f" of the segment to {i + 1}" if len(plan.frequencies or ()) > 1 else ""
    hertz = two_digits(lowest / (2.0 * math.pi))
    return f"elastic cables: lowest natural frequency {lowest:.4g} rad/s ({hertz} Hz) at t = {t:.4g} s{of_segment}"


def finite(value: Any) -> Any:
    """Plain values for JSON, in which None replaces numbers that are not finite."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def plan_table(plan: PlannedMotions):
    """The plan as a table for a terminal."""
    from rich.table import Table  # only a terminal needs it

    words = [missing_words(plan), ", ".join(plan.keys.families)]
    words += [plan.problem.amplitude.name if plan.keys.takes_amplitude else ""]
    words += [f"z0 = {plan.z0:.{DIGITS}g} m"] if math.isfinite(plan.z0) else []
    title = f"{plan.robot_file.name}: {', '.join(filter(None, words))}"
    segments = plan_object(plan)["segments"]
    lines = [*_caption(plan).splitlines(), *path_lines(segments)]
    lines += [line for result in plan.outcomes for line in result.lines()]
    table = Table(title=cell(title, style="table.title"), title_justify="left", caption_justify="left")
    table.caption = cell(*lines, style="table.caption")
    columns = {**_positions(plan), **_numbers(segments), "verdict": lambda segment: segment["verdict"]}
    for head in columns:
        table.add_column(cell(head), justify="left" if head in ("position (m)", "held back by", "verdict") else "right")
    for segment in segments:
        table.add_row(*(cell(column(segment)) for column in columns.values()))
    return table


Column = Callable[[dict[str, Any]], str]


def _positions(plan: PlannedMotions) -> dict[str, Column]:
    def position(segment: dict[str, Any]) -> str:
        pose = plan.keys.pose[segment["to"]]
        # The pose at the end of a launch follows from the launch: nobody gave its digits.
        digits = DIGITS if pose.rest or pose.position is not None else 4
        return f"({', '.join(f'{round(value, DIGITS) + 0.0:.{digits}g}' for value in plan.points[segment['to']])})"

    return {"to": lambda segment: str(segment["to"]), "position (m)": position}


def _numbers(segments: list[dict[str, Any]]) -> dict[str, Column]:
    # Plans of lines get a column of times; oscillations are shown if every segment has them.
    lines = all(segment["active"] is not None for segment in segments)
    beziers = all(segment["control_points"] is not None for segment in segments)
    swings = all(segment["inclination"] is not None for segment in segments)
    proved = all(segment["margin_unit"] == "N" for segment in segments)
    retimed = all(segment["planned_duration"] is not None for segment in segments)
    columns = _times() if lines else _durations() if beziers else _counts(swings)
    if proved:
        columns = _proved({} if not any(segment["tried_arcs"] for segment in segments) else columns)
    if any(segment["sections"] is not None or segment["objective"] is not None for segment in segments):
        columns = _bounded(columns)
    if retimed:
        columns = _gained() | columns
    columns["tension (N)"] = lambda segment: " .. ".join(
        _number(segment[name], ".3f") for name in ("tension_min", "tension_max")
    )
    columns |= {"v (m/s)": _of("speed_max", ".3f"), "a (m/s²)": _of("acceleration_max", ".3f")}
    if proved:
        return columns
    if lines:
        return columns | {"held back by": lambda segment: "; ".join(segment["active"])}
    if beziers:
        return columns
    if any(segment["beta_hat"] for segment in segments):
        return columns | {
            "beta-hat": lambda segment: " .. ".join(f"{value:.3f}" for value in segment["beta_hat"] or ())
        }
    return columns | {"p → ∞": _of("feasible_at_infinity", ".4f")}


def _times() -> dict[str, Column]:
    return {
        "acceleration (s)": _of("acceleration_time", ".4f"),
        "T (s)": _of("duration", ".4f"),
        "least (s)": _of("least_duration", ".4f"),
        "margin (N)": _two_digits("tension_margin"),
    }


def _durations() -> dict[str, Column]:
    def taut(segment: dict[str, Any]) -> str:
        ends = [
            (_number(low, ".4f"), "∞" if high is None else f"{high:.4f}") for low, high in segment["taut_durations"]
        ]
        return ", ".join(f"{low} .. {high}" for low, high in ends) or "none"

    return {"T (s)": _of("duration", ".4f"), "taut for T (s)": taut, "margin (N)": _two_digits("tension_margin")}


def _proved(counts: dict[str, Column]) -> dict[str, Column]:
    # Swings over pulleys have numbers of arcs, too.
    return dict(itertools.islice(counts.items(), 1)) | {
        "T (s)": _of("duration", ".4f"),
        "margin (N)": _two_digits("tension_margin"),
        "proved (N)": _two_digits("margin_bound"),
    }


def _bounded(columns: dict[str, Column]) -> dict[str, Column]:
    # Lower bounds of the least time follow the time.
    def gap(segment: dict[str, Any]) -> str:
        return "-" if segment["gap"] is None else two_digits(100.0 * segment["gap"])

    bounds = {"at least (s)": _of("lower_bound", ".4f"), "gap (%)": gap}
    return {"T (s)": columns["T (s)"]} | bounds | {name: columns[name] for name in columns if name != "T (s)"}


def _gained() -> dict[str, Column]:
    return {
        "planned (s)": _of("planned_duration", ".4f"),
        "gain (%)": lambda segment: f"{100.0 * segment['gain']:.1f}",
    }


def _counts(swings: bool) -> dict[str, Column]:
    name = "oscillations" if swings else "arcs"

    def count(segment: dict[str, Any]) -> str:
        if segment["tried_arcs"] is None:
            return "-"
        return str(segment[name] or f"- ({segment['tried_arcs'] // (2 if swings else 1)})")

    inclination = {"v": _of("inclination", ".4f")} if swings else {}
    return {name: count} | inclination | {"T (s)": _of("duration", ".2f"), "margin (N)": _two_digits("tension_margin")}


def _of(name: str, form: str) -> Column:
    return lambda segment: _number(segment[name], form)


def _two_digits(name: str) -> Column:
    return lambda segment: "-" if segment[name] is None else two_digits(segment[name])


def _caption(plan: PlannedMotions) -> str:
    time = float(plan.answers.duration.sum())
    total = f"total {f'{time:.2f} s' if math.isfinite(time) else 'time unknown'}; {axes_text(plan)}"
    numbered = not plan.feasible and (plan.answers.tried_arcs > 0).any()
    pairs = plan.robot_file.pairs
    if pairs is not None:
        named = ", ".join("-".join(map(str, pair)) for pair in (pairs.cables + 1).tolist())
        total += f"; tensions of the pairs of cables {named}"
    note = "; in brackets: none found, the numbers are those of the motion that comes nearest" if numbered else ""
    planned = [plan.details(i).get("planned_duration", math.nan) for i in range(len(plan.answers.duration))]
    retimed = f"\n{retimed_words(sum(planned), time)}" if math.isfinite(sum(planned) + time) else ""
    elastic = "".join(f"\n{words}" for words in filter(None, [frequency_words(plan)]))
    return f"{total}{note}{retimed}{elastic}{_causes(plan)}"


def retimed_words(before: float, after: float) -> str:
    """Durations before and after retiming, in words."""
    change = after / before - 1.0
    digits = 0 if abs(change) >= 0.1 else 1
    words = f"{100.0 * abs(change):.{digits}f} % {'longer' if change > 0.0 else 'shorter'}"
    return f"retimed: {before:.6g} s -> {after:.6g} s ({words if abs(change) >= 5e-4 else 'as long'})"


def _causes(plan: PlannedMotions) -> str:
    # Lines for each segment that is not feasible, with its number in the table.
    lines = [(i + 1, [cause.text for cause in causes]) for i, causes in enumerate(plan.causes) if causes]
    return "".join(f"\nto {to}: {'; '.join(words)}" for to, words in lines)


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(float(format(value, form)) + 0.0, form)  # no -0
