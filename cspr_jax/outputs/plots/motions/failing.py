"""Intervals of failure of a motion by the charts that show what fails."""

from __future__ import annotations

import functools
import operator
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cspr_jax.numerics.bounds.intervals import united
from cspr_jax.schema.verdicts import Verdict

if TYPE_CHECKING:
    from jaxtyping import Float

# By the quantity that a chart shows: the criteria that it shows. Those that no chart of a figure shows are in its chart
# of the path, or of the tensions.
SHOWN = {
    "tension": Verdict.SLACK_CABLE | Verdict.OVER_TENSION | Verdict.WRENCH_INFEASIBLE | Verdict.UNCERTAINTY,
    "rate": Verdict.CABLE_TOO_FAST | Verdict.CABLE_OVER_ACCELERATION,
    "length": Verdict.CABLE_TOO_LONG,
    "velocity": Verdict.TOO_FAST | Verdict.OVER_FEED,
    "acceleration": Verdict.OVER_ACCELERATION,
}


def failing_in(columns: Mapping[str, Any], chart: str, charts: Sequence[str]) -> Float[np.ndarray, "m 2"]:
    """Intervals in which criteria fail that one of several charts shows."""
    if "criterion_failing" not in columns:
        return np.reshape(columns.get("failing", ()), (-1, 2))
    shown = SHOWN.get(chart, Verdict.FEASIBLE)
    if chart == ("path" if "path" in charts else "tension"):
        others = [SHOWN[name] for name in charts if name in SHOWN and name != chart]
        shown = ~functools.reduce(operator.or_, others, Verdict.FEASIBLE)
    chosen = (np.asarray(columns["criterion_flag"]) & shown.value) != 0
    return united(np.asarray(columns["criterion_failing"])[chosen])
