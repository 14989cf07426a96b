"""Leg of a plan: consecutive poses, and how a trajectory family joins them."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar

import jax
import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.motion.answers import Answers, joined
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.shapes import Float


@dataclasses.dataclass(frozen=True)
class JoinedLeg:
    """Segments of one family, joined.

    Fields:
        family: name of the family.
        answers: answers of the n segments.
        motions: n motions, origin at the centroid of the spools, z down.
    """

    family: str
    answers: Answers
    motions: list[Motion]


class LegResult(abc.ABC):
    """Result of a leg beyond its motion, in the axes of the robot file; computed once, with the plan.

    Fields:
        key: name of the result in a plan's JSON.
    """

    key: ClassVar[str]

    @abc.abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The result as a plan's JSON has it."""

    @abc.abstractmethod
    def lines(self) -> list[str]:
        """The result as text."""

    @abc.abstractmethod
    def columns(self) -> dict[str, np.ndarray]:
        """Datasets that the result adds to a motion file."""


class Leg(abc.ABC):
    """Consecutive poses of a plan, joined by one family.

    Fields:
        step: step between the numbers of arcs that a segment can have; 0: its motions have no arcs.
        knows_motor_speeds: whether its durations keep limits of speeds of motors, which it does not prove.

    Raises:
        ConfigError: poses, or keys of the plan, that the family cannot use.
    """

    step: ClassVar[int] = 0
    knows_motor_speeds: ClassVar[bool] = False
    point: str | None = None  # point of the platform whose positions motion files give, if they say so

    def __init__(self, waypoints: Waypoints) -> None:
        """Keep the poses; a family refuses what it cannot join."""
        self.waypoints = waypoints

    def _refuse(self, *names: str) -> None:
        # Refuse keys of poses that only other families take; those of the first pose may belong to the leg before.
        for i, pose in enumerate(self.waypoints.poses[1:], start=1):
            for key in names:
                if getattr(pose, key) is not None:
                    name = f"{self.waypoints.name(i)}.{key}"
                    raise ConfigError(
                        self.waypoints.path, f'{name}: must be absent with family = "{self.waypoints.family}"'
                    )

    def __len__(self) -> int:
        return len(self.waypoints)

    def check(self, problem: Problem) -> None:  # noqa: B027
        """Refuse poses at which no motion can begin or end; called before z0 is chosen."""

    @classmethod
    def for_searches(cls, waypoints: Waypoints) -> "Leg":
        """A leg of this family over the poses of another family, whose search can begin from its motions."""
        return cls(waypoints)

    def begin_with(self, others: "Sequence[Leg]") -> None:  # noqa: B027
        """Take legs of other families over the same poses; a search can begin from their motions."""

    @abc.abstractmethod
    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses."""

    def answers(self, problem: Problem, depths: Float[np.ndarray, "n_depths"]) -> Answers:
        """Answers for several depths of P0."""
        return joined([self.join(problem, float(z0))[0] for z0 in depths])

    def result(
        self, problem: Problem, joined: JoinedLeg, tension_min: Float[np.ndarray, "n"], start: float
    ) -> LegResult | None:
        """Result of the joined leg beyond its motion; a plan calls this once."""
        return None

    def warnings(self, problem: Problem) -> list[str]:
        """Warnings for the user of the plan."""
        return []


def each(leaves, count: int) -> list:
    """Parts of a pytree whose leaves have a leading dimension."""
    return [jax.tree.map(lambda array, i=i: np.asarray(array)[i], leaves) for i in range(count)]
