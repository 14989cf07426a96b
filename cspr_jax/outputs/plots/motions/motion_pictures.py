"""Pictures of a motion by the names that `--quantity` takes: one row for each."""

from collections.abc import Callable
from typing import NamedTuple

from matplotlib.figure import Figure

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs.plots.motions.landings import landing_figure
from cspr_jax.outputs.plots.motions.motion import motion_figure
from cspr_jax.outputs.plots.motions.motion_source import robot_and_plan
from cspr_jax.outputs.plots.motions.path_accelerations import path_figure
from cspr_jax.outputs.plots.motions.phase_planes import phase_plane_figure
from cspr_jax.outputs.plots.motions.summary import summary_figure
from cspr_jax.outputs.plots.motions.tensions import tensions_figure
from cspr_jax.outputs.plots.motions.trajectory import trajectory_figure
from cspr_jax.outputs.plots.style.options import (
    ACCELERATION,
    LANDING,
    PATH_ACCELERATION,
    PHASE_PLANE,
    SUMMARY,
    TENSIONS,
    TRAJECTORY,
)
from cspr_jax.store.reading.result import Result


class MotionPicture(NamedTuple):
    """A picture of a motion.

    Fields:
        draw: function of the motion, the name of its file, and the time, which draws the picture.
        needed_quantity: quantity that the file must have; empty for none.
        at_time: whether the picture shows a single time, "t".
    """

    draw: Callable[[Result, str, dict[str, float]], Figure]
    needed_quantity: str = ""
    at_time: bool = False


def _acceleration(result: Result, file: str, at: dict[str, float]) -> Figure:
    from cspr_jax.outputs.plots.motions.accelerations import acceleration_figure

    return acceleration_figure(result, file, at)


MOTION_PICTURES = {
    TRAJECTORY: MotionPicture(
        lambda result, file, _: trajectory_figure(result, *robot_and_plan(result, file, TRAJECTORY))
    ),
    TENSIONS: MotionPicture(lambda result, file, _: tensions_figure(result, *robot_and_plan(result, file, TENSIONS))),
    SUMMARY: MotionPicture(lambda result, file, _: summary_figure(result, *robot_and_plan(result, file, SUMMARY))),
    ACCELERATION: MotionPicture(_acceleration, at_time=True),
    PATH_ACCELERATION: MotionPicture(
        lambda result, file, _: path_figure(result, file), needed_quantity=PATH_ACCELERATION
    ),
    PHASE_PLANE: MotionPicture(lambda result, *_: phase_plane_figure(result), needed_quantity="path_speed"),
    LANDING: MotionPicture(lambda result, *_: landing_figure(result), needed_quantity=LANDING),
}


def motion_picture(result: Result, file: str, quantity: str | None, at: dict[str, float]) -> Figure:
    """The requested picture of a motion."""
    at_times = [name for name, row in MOTION_PICTURES.items() if row.at_time]
    if at and quantity not in at_times:
        raise InputError("--at", at, f"absent for a motion but with --quantity {', '.join(at_times)}")
    if quantity is None:
        return motion_figure(result)
    possible = [
        name for name, row in MOTION_PICTURES.items() if not row.needed_quantity or row.needed_quantity in result.data
    ]
    if quantity not in possible:
        raise InputError("--quantity", quantity, f"{one_of(quantity, possible)} for this motion, or absent")
    return MOTION_PICTURES[quantity].draw(result, file, at)
