"""Stops along a plan, as JSON and as a table for people."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.motion.motion import Placed
from cspr_jax.outputs.plan_report import finite
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.runtime.terminal import cell

SCHEMA = 1
KINDS = {"rest": "rests already", "path": "along the path", "free": "free motion", "swing": "dying swing"}
NONE = "none found"
TRIED = "none found: neither a free motion, nor a brake along the path, nor a dying swing that was tried is proved"


@dataclasses.dataclass(frozen=True)
class PlannedStop:
    """The fastest proved stop from one instant of a plan.

    Fields:
        time: time of the instant, since the start of the plan, s.
        kind: "rest", "path", "free" or "swing"; "" where none is found.
        duration: time from the instant to rest, s; NaN where none is found.
        position: (3,) position of the mass centre at rest, in the axes of the robot file, m; NaN likewise.
        quaternion: (4,) orientation at rest, as in the plan's files; None for a point mass.
        margin: proved distance of the tensions from their limits, N; NaN where none is found.
        motion: the motion, in the axes of the robot file; None where none is found.
    """

    time: float
    kind: str
    duration: float
    position: np.ndarray
    quaternion: np.ndarray | None
    margin: float
    motion: Placed | None

    @property
    def is_found(self) -> bool:
        """Tell whether there is a proved stop."""
        return bool(self.kind)

    def to_dict(self) -> dict[str, Any]:
        """The stop as plain values, for JSON.

        Returns:
            "t", "kind", "duration", "position", "quaternion" and "margin"; null where there is none.
        """
        fields = {"t": self.time, "kind": self.kind or None, "duration": self.duration, "margin": self.margin}
        if not self.is_found:
            return finite(fields) | {"position": None, "quaternion": None}
        turning = None if self.quaternion is None else self.quaternion.tolist()
        return finite(fields | {"position": self.position.tolist(), "quaternion": turning})

    @property
    def text(self) -> str:
        """The stop in words."""
        if not self.is_found:
            return f"from t = {self.time:.4g} s: {NONE}"
        return f"from t = {self.time:.4g} s: {self.duration:.4g} s, rest at {self.rest_position}, {KINDS[self.kind]}"

    @property
    def rest_position(self) -> str:
        """The position at rest in words."""
        return f"({', '.join(f'{value + 0.0:.4g}' for value in np.round(self.position, 9))})"


@dataclasses.dataclass(frozen=True)
class StopsAlong:
    """Stops from instants of a plan.

    Fields:
        plan: the plan.
        stops: stops from the instants, in their order.
        without: cables that are gone when the robot stops, from 0 on, beyond those that the plan does without.
        left: what is left where the robot has too few cables for its degrees of freedom, or cannot be used; "" else.
    """

    plan: PlannedMotions
    stops: tuple[PlannedStop, ...]
    without: tuple[int, ...] = ()
    left: str = ""

    @property
    def robot(self) -> str:
        """Name of the robot."""
        return self.plan.robot_file.name

    @property
    def all_found(self) -> bool:
        """Tell whether there is a proved stop from every instant."""
        return all(stop.is_found for stop in self.stops)

    @property
    def durations(self) -> np.ndarray:
        """Durations of the stops, (n,) s; NaN where none is found."""
        return np.array([stop.duration for stop in self.stops])

    @property
    def times(self) -> np.ndarray:
        """Times of the instants, (n,) s."""
        return np.array([stop.time for stop in self.stops])

    @property
    def intervals_without(self) -> list[list[float]]:
        """First and last instants of runs of instants from which no stop is found, s."""
        runs = list[list[float]]()
        for before, stop in zip((None, *self.stops), self.stops, strict=False):
            if stop.is_found:
                continue
            if runs and before is not None and not before.is_found:
                runs[-1][1] = stop.time
            else:
                runs.append([stop.time, stop.time])
        return runs

    def to_dict(self) -> dict[str, Any]:
        """The stops as plain values, for JSON.

        Returns:
            what `cspr stops --json` prints.
        """
        return {
            "schema": SCHEMA,
            "robot": self.robot,
            "without": list(self.without) or None,
            "left": self.left or None,
            "z_axis": self.plan.robot_file.z_axis,
            "stops": [stop.to_dict() for stop in self.stops],
            "longest": max((stop.duration for stop in self.stops if stop.is_found), default=None),
            "none_found": self.intervals_without,
            "all_found": self.all_found,
        }

    def lines(self) -> list[str]:
        """The stops in words.

        Returns:
            the lines that `cspr stops` prints below its table.
        """
        if self.left:
            return [self.left]
        missing = [
            f"{first:.4g} s" if first == last else f"{first:.4g} to {last:.4g} s"
            for first, last in self.intervals_without
        ]
        lines = [f"{TRIED}: from t = {', '.join(missing)}"] if missing else []
        proved = [stop for stop in self.stops if stop.is_found]
        if proved:
            longest = max(proved, key=lambda stop: stop.duration)
            lines.append(
                f"{len(proved)} of {len(self.stops)} instants have a proved stop; the longest is {longest.text}"
            )
        return lines

    def to_table(self) -> Any:
        """The stops as the table that `cspr stops` prints.

        Returns:
            a table of the package rich.
        """
        from rich.table import Table  # only a terminal needs it

        title = f"{self.robot}: stops{self._gone}"
        table = Table(title=cell(title, style="table.title"), title_justify="left", caption_justify="left")
        table.caption = cell(*self.lines(), style="table.caption")
        for head in ("from t (s)", "duration (s)", "rest at (m)", "margin (N)", "kind"):
            table.add_column(cell(head), justify="left" if head in ("rest at (m)", "kind") else "right")
        for stop in self.stops:
            numbers = (
                [f"{stop.duration:.4g}", stop.rest_position, f"{stop.margin:.3g}", KINDS[stop.kind]]
                if stop.is_found
                else ["", "", "", NONE]
            )
            table.add_row(*map(cell, [f"{stop.time:.4g}", *numbers]))
        return table

    @property
    def _gone(self) -> str:
        numbers = ", ".join(str(i + 1) for i in self.without)
        return f" without cable{'s' * (len(self.without) > 1)} {numbers}" if numbers else ""
