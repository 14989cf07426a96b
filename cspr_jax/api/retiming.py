"""Retiming of motions from Python: the same paths in the least time that all limits allow."""

from __future__ import annotations

import dataclasses
from typing import Annotated, TypeVar

from cspr_jax.api.arguments.checks import GridSize, checked
from cspr_jax.api.checks import Check
from cspr_jax.api.plans import NAME, Plan
from cspr_jax.config.keys.path import GRID, RAMP_TIME
from cspr_jax.errors.arguments import Kind as KindRule
from cspr_jax.errors.arguments import RampTime
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.plans.retiming import retimed

Kind = TypeVar("Kind", Plan, Check)


@checked(motion="spline")
def retime(
    plan: Annotated[Kind, KindRule("a plan, or a check", has=("feasible", "to_table"))],
    *,
    grid: GridSize = GRID,
    ramp_time: RampTime = RAMP_TIME,
) -> Kind:
    """Follow the paths of a plan, or of a checked motion, in the least time that all limits allow.

    All stops of the motion are kept, and so are its speeds at ends where it moves. Between them the faster motion
    replaces the planned one if it is proved.

    Args:
        plan: a plan of any families but launches, or a check.
        grid: number of cells for each part of the paths between stops.
        ramp_time: time in which accelerations, and so tensions, rise and fall, s; 0 if they may jump.

    Returns:
        the plan, or the check, of the retimed motions; segments have "planned_duration", "gain" and "lower_bound".

    Raises:
        ConfigError: a launch, a segment without a motion, or a motion whose velocity jumps.
    """
    if isinstance(plan, Check):
        return Check(_retimed(plan.plan, grid, ramp_time))
    return _retimed(plan, grid, ramp_time)


def _retimed(plan: Plan, grid: int, ramp_time: float) -> Plan:
    with double_precision():
        planned = retimed(plan, grid, ramp_time, NAME)
    return Plan(**{field.name: getattr(planned, field.name) for field in dataclasses.fields(planned)})
