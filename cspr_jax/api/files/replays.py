"""Replays of plans in MuJoCo from Python, as by `cspr replay`."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.files.pictured import Pictured
from cspr_jax.api.plans import NAME, Plan, plan
from cspr_jax.errors import ConfigError
from cspr_jax.errors.arguments import Kind
from cspr_jax.errors.suggestions import with_suggestions
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs.mujoco import elastic_replay
from cspr_jax.outputs.mujoco import replay as replays
from cspr_jax.outputs.mujoco.elastic_replay import ElasticPlan
from cspr_jax.outputs.mujoco.module import need_mujoco
from cspr_jax.outputs.mujoco.motion import STEP

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PlanOrFile = Annotated[
    str | Path | Mapping[str, Any] | Plan,
    Kind("a plan, its file, or a dictionary of that", (str, os.PathLike, Mapping), ("answers", "points", "robot_file")),
]


@with_suggestions
@dataclasses.dataclass(frozen=True)
class Replay(Pictured, replays.PlayedPlan):
    """A plan, and its motion as played by MuJoCo; see `cspr_jax.outputs.mujoco.replay.PlayedPlan` for the fields."""

    def _figure(self) -> Figure:
        from cspr_jax.outputs.plots.films.replay import replay_figure  # loads matplotlib

        return replay_figure(self)


@checked()
def replay(given: PlanOrFile, *, step: float = STEP, anyway: bool = False) -> Replay:
    """Play a plan in MuJoCo: the path that results from its tensions, and the tensions that its path needs.

    Args:
        given: a plan, a plan file, or a dictionary, as for `plan`.
        step: longest step of MuJoCo's integrator, RK4, s.
        anyway: whether to play a plan even if it is not feasible; cables in MuJoCo never push.

    Returns:
        played and planned path and tensions, at the ends of the steps.

    Raises:
        ConfigError: MuJoCo is not installed; the plan has a mistake, is not feasible or has no finite motion; or the
            step is not positive or gives too many rows.
    """
    need_mujoco()
    planned = given if isinstance(given, Plan) else plan(given)
    if not (planned.feasible or anyway):
        raise ConfigError(NAME, "not played, since a segment is not proved feasible (anyway=True plays it)")
    with double_precision():
        played = replays.replay(planned, step)
    return Replay(**{field.name: getattr(played, field.name) for field in dataclasses.fields(played)})


@checked()
def replay_elastic(given: PlanOrFile, *, step: float = STEP, anyway: bool = False) -> ElasticPlan:
    """Play a plan in MuJoCo on elastic cables, by drums that set lengths, with and without compensation of the stretch.

    Args:
        given: a plan, a plan file, or a dictionary, as for `plan`, of a robot with `axial_stiffness`.
        step: longest step of MuJoCo's integrator, RK4, s; shorter ones are taken where natural frequencies are high.
        anyway: whether to play a plan even if it is not feasible; cables never push.

    Returns:
        both paths, and how far they are off the plan.

    Raises:
        ConfigError: MuJoCo is not installed; the plan has a mistake, is not feasible or has no finite motion; its robot
            has no `axial_stiffness`, or is a platform that only translates; or the step is not positive or gives too
            many rows.
    """
    need_mujoco()
    planned = given if isinstance(given, Plan) else plan(given)
    if not (planned.feasible or anyway):
        raise ConfigError(NAME, "not played, since a segment is not proved feasible (anyway=True plays it)")
    with double_precision():
        return elastic_replay.replay_elastic(planned, step)
