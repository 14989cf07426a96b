"""Texts of plans, checks and results in interactive sessions, with pictures in notebooks."""

import abc
import base64
import html
from typing import TYPE_CHECKING, Any

import numpy as np

from cspr_jax.errors import CsprError, printable

if TYPE_CHECKING:
    from cspr_jax.store.reading.result import Result

MOST_LINES = 8
DPI = 80  # resolution of pictures in notebooks


class Displayed(abc.ABC):
    """Object that shows itself in a few lines; its picture is drawn only if a notebook asks for it."""

    @abc.abstractmethod
    def _summary(self) -> list[str]: ...

    @abc.abstractmethod
    def _drawn_result(self) -> "Result": ...

    def __repr__(self) -> str:
        lines = [printable(line) for text in self._summary() for line in text.splitlines()]
        more = [f"... and {len(lines) - MOST_LINES} lines more"] * (len(lines) > MOST_LINES)
        return "\n".join(lines[:MOST_LINES] + more)

    def _repr_html_(self) -> str:
        text = f"<pre>{html.escape(repr(self))}</pre>"
        try:
            image = _image(self._drawn_result())
        except CsprError:  # the object has nothing to draw
            return text
        return f'{text}<img alt="" src="data:image/png;base64,{image}">'


def _image(result: "Result") -> str:
    from cspr_jax.outputs.plots.draw import drawn  # loads matplotlib, which is slow
    from cspr_jax.outputs.plots.style.style import Style, in_style, laid_out, rendered

    style = Style(dpi=DPI)
    with in_style(style):
        figure = drawn([result], ["result"])
        laid_out(figure, style)
        return base64.b64encode(rendered(figure, ".png", style)).decode("ascii")


def plan_summary(plan: Any) -> list[str]:
    """Lines with the robot, durations and verdicts of a plan."""
    segments = plan.to_dict()["segments"]
    word = "feasible, proved" if plan.feasible else "not proved feasible"
    families, total = ", ".join(plan.keys.families), float(np.sum(plan.answers.duration))
    lines = [f"Plan of {plan.robot_file.name}: {families}, {len(segments)} segments in {total:.6g} s: {word}"]
    for i, segment in enumerate(segments):
        arcs = f", {segment['arcs']} arcs" if segment.get("arcs") else ""
        needed = "".join(f"; {cause.text}" for cause in plan.causes[i][:1]) if plan.causes else ""
        duration = float(plan.answers.duration[i])
        lines.append(f"  to pose {segment['to']}: {segment['verdict']}{arcs}, {duration:.6g} s{needed}")
    return lines
