"""Waypoints: consecutive poses of a plan that one family joins, as points of the kernels."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from cspr_jax.config.keys.pose import Pose
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.schema.families import FAMILIES


@dataclasses.dataclass(frozen=True)
class Waypoints:
    """Consecutive poses of a plan.

    Fields:
        robot_file: the robot.
        plan_file: the plan.
        path: path of the plan, named in errors.
        frame: frame of the robot.
        family: name of the family that joins them.
        first: index, in the plan, of the first pose.
        last: index, in the plan, of the last pose.
        fixed: (n_segments,) numbers of arcs that replace those of the poses; -m: any number from m on. None: those of
            the poses.
    """

    robot_file: RobotFile
    plan_file: PlanFile
    path: Path
    frame: Frame
    family: str
    first: int
    last: int
    fixed: np.ndarray | None = None

    def __len__(self) -> int:
        """Number of segments."""
        return self.last - self.first

    @property
    def poses(self) -> list[Pose]:
        """The poses, one more than segments."""
        return self.plan_file.pose[self.first : self.last + 1]

    @property
    def arcs(self) -> np.ndarray:
        """Fixed number of arcs of each segment, (n_segments,); 0 where it is free; see `fixed`."""
        return np.array([pose.arcs or 0 for pose in self.poses[1:]]) if self.fixed is None else self.fixed

    @property
    def max_arcs(self) -> int:
        """Largest number of arcs tried."""
        return max(self.plan_file.max_arcs, int(self.arcs.max()))

    def name(self, i: int) -> str:
        """Name of a pose in messages."""
        return f"pose[{self.first + i}]"

    def points(self, z0) -> Float[np.ndarray, "... n_poses 3"]:
        """Positions of the poses; poses at rest are in P0."""
        at_rest = rest_point(np.asarray(z0))
        anywhere = FAMILIES[self.family].rests_anywhere
        in_p0 = [pose.position is None or (pose.rest and not anywhere) for pose in self.poses]
        positions = [
            at_rest if rests else self.frame.inward(pose.position)
            for rests, pose in zip(in_p0, self.poses, strict=True)
        ]
        return np.stack([np.broadcast_to(position, at_rest.shape) for position in positions], axis=-2)

    @property
    def targets(self) -> np.ndarray:
        """Poses that are not at rest, (n, 3) from the centroid of the spools, z down, m."""
        moving = [pose.position for pose in self.poses if not pose.rest and pose.position is not None]
        return self.frame.inward(np.asarray(moving, float).reshape(-1, 3))
