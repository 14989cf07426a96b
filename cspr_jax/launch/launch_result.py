"""Result of a launch: the release and the flight of an object, and where throws with errors land."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from cspr_jax.config.keys.launch import LaunchTable
from cspr_jax.launch.flight import flown
from cspr_jax.launch.landings import LaunchErrors, Scatter, Throw, scatter, state_at
from cspr_jax.motion.leg import LegResult
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import PointMassRobot

FLIGHT_ROWS = 101


@dataclasses.dataclass(frozen=True)
class LaunchResult(LegResult):
    """Release of an object and its flight, in the axes of the robot file.

    Fields:
        segment: index of the segment on which, or at whose end, the object is released, from 0.
        position: (3,) at the release, m.
        velocity: (3,) at the release, m/s.
        time: time of the release since the start of the plan, s.
        control_points: (3, 3) control points of a Bezier segment, m; None for other motions.
        landing: (3,) where the flight ends, m.
        flight_time: time of flight, s.
        tension_min: smallest tension on the segment, N.
        throw: the release and its motions, to compute the scatter under errors.
        robot: centred robot, z down.
        frame: frame of the robot file.
        scatter: scatter of the landings, if the plan names errors.
        half_axes: (2, 3) vectors of the last ellipse, from its centre to the release and to the point a quarter of a
            turn later, m; None for other motions.
    """

    segment: int
    position: np.ndarray
    velocity: np.ndarray
    time: float
    control_points: np.ndarray | None
    landing: np.ndarray
    flight_time: float
    tension_min: float
    throw: Throw
    robot: PointMassRobot
    frame: Frame
    scatter: Scatter | None = None
    half_axes: np.ndarray | None = None

    key: ClassVar[str] = "launch"

    def to_dict(self) -> dict[str, Any]:
        """The launch as the JSON of a plan has it; see `LegResult.to_dict`."""
        table = {
            "segment": self.segment,
            "release": {"position": self.position.tolist(), "velocity": self.velocity.tolist(), "time": self.time},
            "control_points": None if self.control_points is None else self.control_points.tolist(),
            "half_axes": None if self.half_axes is None else self.half_axes.tolist(),
            "landing": self.landing.tolist(),
            "flight_time": self.flight_time,
            "tension_min": self.tension_min,
        }
        return table if self.scatter is None else table | {"scatter": self.scatter.to_dict()}

    def lines(self) -> list[str]:
        """One line about the release and the flight, and one about throws with errors; see `LegResult.lines`."""
        if not math.isfinite(self.time + self.flight_time):
            return ["no launch"]
        release, landing = (
            ", ".join(f"{round(x, 9) + 0.0:.4g}" for x in point.tolist()) for point in (self.position, self.landing)
        )
        speed = math.dist(self.velocity, (0.0, 0.0, 0.0))
        line = f"released after {self.time:.4f} s at ({release}) m with {speed:.3f} m/s"
        lines = [f"{line}; lands {self.flight_time:.4f} s later at ({landing}) m"]
        if self.scatter is not None:
            table = self.scatter.to_dict()
            mean, deviation = (1e3 * table[name] for name in ("mean_error", "standard_deviation"))
            lines.append(f"{table['throws']} throws land {mean:.2f} ± {deviation:.2f} mm from the target")
        return lines

    def columns(self) -> dict[str, np.ndarray]:
        """Flight of the object and landings of a sample of throws, none without a launch; see `LegResult.columns`."""
        if not math.isfinite(self.flight_time):
            return {}
        t = np.linspace(0.0, self.flight_time, FLIGHT_ROWS)
        down = self.frame.rotated(np.array([0.0, 0.0, float(self.robot.gravity)]))
        position = self.position + self.velocity * t[:, None] + 0.5 * down * t[:, None] ** 2
        columns = {"flight_t": self.time + t, "flight_position": position}
        if self.scatter is not None:
            landings = self.scatter.landings
            columns |= {"throw": np.arange(1.0, len(landings) + 1.0), "landing": landings}
        return columns

    def scatter_of(self, errors: LaunchErrors) -> Scatter:
        """Scatter of the landings for given errors."""
        kernel_scatter = scatter(self.robot, self.throw, errors)
        # The axes of the file are those of the kernels, or those rotated about x.
        signs = np.asarray(self.frame.rotated(np.ones(3)))[:2]
        both = np.outer(signs, signs)
        landings, covariance, first_order = dataclasses.astuple(kernel_scatter)
        return Scatter(landings * signs, covariance * both, first_order * both)


def launch_result(
    table: LaunchTable,
    frame: Frame,
    robot: PointMassRobot,
    throw: Throw,
    *,
    time: float,
    flight_time: float,
    tension_min: float,
    control_points: Float[np.ndarray, "3 3"] | None = None,
    half_axes: Float[np.ndarray, "2 3"] | None = None,
) -> LaunchResult:
    """Result of a planned release, with the scatter that its table asks for."""
    state = state_at(throw, jnp.asarray(0.0))
    landing, _ = flown(state.position, state.velocity, robot.gravity, flight_time)
    launch = LaunchResult(
        segment=table.segment,
        position=np.asarray(frame.outward(np.asarray(state.position))),
        velocity=np.asarray(frame.rotated(np.asarray(state.velocity))),
        time=time,
        control_points=control_points,
        landing=np.asarray(frame.outward(np.asarray(landing))),
        flight_time=flight_time,
        tension_min=tension_min,
        throw=throw,
        robot=robot,
        frame=frame,
        half_axes=half_axes,
    )
    if table.errors is None:
        return launch
    return dataclasses.replace(launch, scatter=launch.scatter_of(LaunchErrors(**vars(table.errors))))
