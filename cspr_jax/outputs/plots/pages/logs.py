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
    times = log.times[log.rows]
    errors = {"before the delay is taken out": log.position_errors_before, "after": log.position_errors}
    levels = [] if log.tolerance is None else [{"words": "tolerance", "value": 1000.0 * log.tolerance}]
    charts = [_chart("position error", "mm", times, {name: 1000.0 * row for name, row in errors.items()}, levels)]
    if log.angle_errors is not None:
        charts.append(_chart("angle error", "°", times, {"after the delay": np.degrees(log.angle_errors)}))
    of_cables = dict(zip(cables, 1000.0 * log.length_errors.T, strict=True))
    charts.append(
        _chart("measured minus planned length", "mm", log.times, of_cables, intervals=_intervals(log.lengthened))
    )
    if log.n_spare:
        rest = dict(zip(cables, -1000.0 * log.residuals.T, strict=True))
        charts.append(_chart("length that no pose explains", "mm", times, rest, intervals=_intervals(log.lengthened)))
    if log.tensions is not None:
        pairs = zip(cables, log.tensions.T, log.planned_tensions.T, strict=True)
        lines = {
            name: values
            for cable, *rows in pairs
            for name, values in zip((cable, f"{cable}, planned"), rows, strict=True)
        }
        charts.append(_chart("tension", "N", log.times, lines, intervals=_intervals(log.slack or []), is_paired=True))
    title = f"Log of {log.robot}"
    page: dict[str, Any] = {"title": title, "notes": first, "map": None, "motions": [], "cells": {}}
    return page | {"charts": charts, "facts": facts}


def _chart(
    title: str,
    unit: str,
    times: np.ndarray,
    lines: dict[str, np.ndarray],
    levels: list[dict[str, Any]] | None = None,
    intervals: list[tuple[float, float]] | None = None,
    is_paired: bool = False,
) -> dict[str, Any]:
    rows = np.unique(np.linspace(0, len(times) - 1, min(MOST_ROWS, len(times))).astype(int))
    return {
        "title": title,
        "unit": unit,
        "t": packed(times[rows]),
        "names": list(lines),
        "lines": packed(np.stack([values[rows] for values in lines.values()])),
        "levels": levels or [],
        "bands": [list(interval) for interval in intervals or []],
        "isPaired": is_paired,
    }


def _intervals(of_cables: list[list[tuple[float, float]]]) -> list[tuple[float, float]]:
    return [interval for each in of_cables for interval in each]
