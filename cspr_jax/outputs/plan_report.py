"""A plan as JSON and as a table for people."""

import math
from typing import Any

from cspr_jax.plans.planning import Plan
from cspr_jax.schema.verdicts import Verdict

SCHEMA = 1


def plan_object(plan: Plan) -> dict[str, Any]:
    """The object that `cspr plan --json` prints.

    Args:
        plan: the plan.

    Returns:
        plain values; what does not apply, or is not finite, is None.
    """
    segments = [_segment_object(plan, i) for i in range(len(plan.answers.arcs))]
    fields = {
        "schema": SCHEMA,
        "robot": plan.spec.name,
        "family": plan.keys.family,
        "amplitude": plan.problem.amplitude.name,
        "z0": plan.z0,
        "z_axis": plan.spec.z_axis,
        "gravity": float(plan.problem.robot.gravity),
        "segments": segments,
        "total_duration": float(plan.answers.duration.sum()),
        "feasible": plan.feasible,
    }
    return _finite(fields)


def verdict_text(verdict: int, arcs: int) -> str:
    """A verdict as a plan shows it.

    Args:
        verdict: flags.
        arcs: number of arcs found, 0 if none.

    Returns:
        "feasible" (proved for point masses, found at refined samples for platforms), "undecided", or the flags joined
        by "+".
    """
    return "feasible" if arcs > 0 else Verdict(int(verdict)).text


# What only some families or robots have.
_OF_SOME = (
    "oscillations",
    "envelope_oscillations",
    "least_oscillations",
    "inclination",
    "det_margin",
    "cable_interference",
    "cable_distance_min",
    "platform_interference",
    "beta_hat",
)


def _segment_object(plan: Plan, i: int) -> dict[str, Any]:
    answers, asked = plan.answers, plan.demands
    arcs = int(answers.arcs[i])
    fields = {
        "from": i,
        "to": i + 1,
        "family": plan.keys.family_of(i),
        "arcs": arcs or None,
        "tried_arcs": int(answers.tried_arcs[i]),
        "duration": float(answers.duration[i]),
        "tension_min": float(asked.tension_min[i]),
        "tension_max": float(asked.tension_max[i]),
        "mu_min": float(asked.mu_min[i]),
        "margin": float(answers.margin[i]),
        "margin_bound": float(answers.margin_bound[i]),
        "limit_margin": float(answers.limit_margin[i]),
        "det_sign_constant": bool(asked.depth_min[i] > 0.0),
        "verdict": verdict_text(answers.verdict[i], arcs),
        "fewer_arcs_undecided": bool(answers.verdict[i] & Verdict.FEWER_ARCS_UNDECIDED),
        "feasible_at_infinity": float(answers.feasible_at_infinity[i]),
        "z_lowest": float(asked.lowest[i]),
        "cable_length_max": float(asked.length_max[i]),
        "cable_speed_max": float(asked.speed_max[i]),
        "cable_acceleration_max": float(asked.acceleration_max[i]),
        "samples": int(asked.samples[i]),
    }
    return fields | dict.fromkeys(_OF_SOME) | plan.details(i)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def plan_table(plan: Plan):
    """The plan as a table for a terminal.

    Args:
        plan: the plan.

    Returns:
        a rich table.
    """
    from rich.table import Table  # only a terminal needs it

    title = f"{plan.spec.name}: {', '.join(plan.keys.families)}, {plan.problem.amplitude.name}, z0 = {plan.z0:.6g} m"
    table = Table(title=title, caption=_caption(plan), title_justify="left", caption_justify="left")
    segments = plan_object(plan)["segments"]
    # Oscillations are counted where every segment has them.
    swings = all(segment["inclination"] is not None for segment in segments)
    count = ("oscillations", "v") if swings else ("arcs",)
    last = "beta-hat" if any(segment["beta_hat"] for segment in segments) else "p → ∞"
    heads = ("to", "position (m)", *count, "T (s)", "margin", "tension (N)", last, "verdict")
    for head in heads:
        table.add_column(head, justify="left" if head in ("position (m)", "verdict") else "right")
    for i, segment in enumerate(segments):
        position = ", ".join(f"{round(value, 9) + 0.0:.4g}" for value in plan.points[i + 1])
        beta_hats = " .. ".join(f"{value:.3f}" for value in segment["beta_hat"] or ())
        fewest = segment["oscillations" if swings else "arcs"]
        tried = segment["tried_arcs"] // (2 if swings else 1)
        table.add_row(
            str(i + 1),
            f"({position})",
            str(fewest or f"- ({tried})"),
            *([_number(segment["inclination"], ".4f")] if swings else []),
            _number(segment["duration"], ".2f"),
            _number(segment["margin"], ".4f"),
            f"{_number(segment['tension_min'], '.3f')} .. {_number(segment['tension_max'], '.3f')}",
            beta_hats or _number(segment["feasible_at_infinity"], ".4f"),
            segment["verdict"],
        )
    return table


def _caption(plan: Plan) -> str:
    total = f"total {plan.answers.duration.sum():.2f} s; z {plan.spec.z_axis}"
    note = "" if plan.feasible else "; in brackets: none found, the numbers are those of the best candidate"
    return f"{total}{note}"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(float(format(value, form)) + 0.0, form)  # no -0
