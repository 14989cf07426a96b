"""Content of a page about a recorded log: charts of errors, lengths and tensions over time."""

from typing import Any

import numpy as np

from cspr_jax.outputs.logs.log_report import ComparedLog, log_lines
from cspr_jax.outputs.plots.pages.page import packed

MOST_ROWS = 4000


def log_content(log: ComparedLog) -> dict[str, Any]:
    """Title, text and charts of the page."""
    first, *facts = log_lines(log)
    cables = [f"cable {k + 1}" for k in range(log.length_errors.shape[1])]
    times, after = log.times[log.rows], "after the delay is taken out"
    errors = {"before the delay is taken out": 1000.0 * log.position_errors_before, after: 1000.0 * log.position_errors}
    levels = [] if log.tolerance is None else [{"words": "tolerance", "value": 1000.0 * log.tolerance}]
    charts = [_chart("Position error", "position error (mm)", times, errors, levels)]
    if log.angle_errors is not None:
        charts.append(_chart(f"Angle error {after}", "angle error (°)", times, {"error": np.degrees(log.angle_errors)}))
    longer = _intervals(log.lengthened, "longer")
    of_cables = dict(zip(cables, 1000.0 * log.length_errors.T, strict=True))
    title = f"Measured minus planned lengths {after}"
    charts.append(_chart(title, "length error (mm)", log.times, of_cables, intervals=longer))
    if log.n_spare:
        rest = dict(zip(cables, -1000.0 * log.residuals.T, strict=True))
        title = "Measured lengths minus those of the pose that fits them best"
        charts.append(_chart(title, "residual (mm)", times, rest, intervals=longer))
    if log.tensions is not None:
        pairs = zip(cables, log.tensions.T, log.planned_tensions.T, strict=True)
        lines = {
            name: values
            for cable, *rows in pairs
            for name, values in zip((cable, f"{cable}, planned"), rows, strict=True)
        }
        slack, title = _intervals(log.slack or [], "slack"), "Tensions, and dotted the planned ones"
        charts.append(_chart(title, "tension (N)", log.times, lines, intervals=slack, is_paired=True))
    title = f"Log of {log.robot}"
    page: dict[str, Any] = {"title": title, "notes": first, "map": None, "motions": [], "cells": {}}
    return page | {"charts": charts, "facts": facts}


def _chart(
    title: str,
    axis: str,
    times: np.ndarray,
    lines: dict[str, np.ndarray],
    levels: list[dict[str, Any]] | None = None,
    intervals: list[dict[str, Any]] | None = None,
    is_paired: bool = False,
) -> dict[str, Any]:
    rows = np.unique(np.linspace(0, len(times) - 1, min(MOST_ROWS, len(times))).astype(int))
    return {
        "title": title,
        "axis": axis,
        "unit": axis[axis.index("(") + 1 : -1],
        "t": packed(times[rows]),
        "names": list(lines),
        "lines": packed(np.stack([values[rows] for values in lines.values()])),
        "levels": levels or [],
        "intervals": intervals or [],
        "isPaired": is_paired,
    }


def _intervals(of_cables: list[list[tuple[float, float]]], word: str) -> list[dict[str, Any]]:
    # Shaded intervals of time, and what they mean.
    return [
        {"words": f"cable {k + 1} {word}", "start": start, "end": end}
        for k, each in enumerate(of_cables)
        for start, end in each
    ]
