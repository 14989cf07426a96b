"""Answers of segments of paths: durations beside lower bounds, what binds, and why no motion runs along a path."""

from __future__ import annotations

import dataclasses
import functools
import math
import operator
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.families.paths.least_time.least_time import LeastTime
from cspr_jax.families.paths.least_time.refusals import NoMotion, StaticTension
from cspr_jax.families.paths.least_time.tightening import BindingName
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.cause import Cause
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.verdicts import Verdict, criterion_words

JUMP = 0.01  # an acceleration jumps if it changes by more than this fraction of the largest one
DIGITS = 4  # digits of numbers in messages
DECIMALS = 5  # decimals of positions in messages, m
# Largest number of binding criteria that an answer names.
MOST_BINDING = 10
# Flags of criteria that a slower motion may meet.
OF_SPEED = functools.reduce(operator.or_, (row.flag for row in LIMITS if row.of_motion), Verdict.WRENCH_INFEASIBLE)


class SectionAnswer(NamedTuple):
    """Section of a leg with its motion.

    Fields:
        least: the fastest motion along the section.
        segments: (n_cells,) index of the segment in which each cell lies.
        ramp_time: time in which accelerations rise, as the plan gives it, s.
        before: number of the plan's segments before the leg.
    """

    least: LeastTime
    segments: np.ndarray
    ramp_time: float
    before: int = 0

    def times(self, segment: int) -> Float[np.ndarray, "n_cells"]:
        """Times that the motion takes in the cells of a segment; 0 in all other cells."""
        return np.where(self.segments == segment, np.diff(np.asarray(self.least.motion.knots)), 0.0)

    @property
    def ends(self) -> tuple[int, int]:
        """Indices of the segments in which the section starts and ends."""
        return int(self.segments[0]), int(self.segments[-1])

    @property
    def jumps(self) -> int:
        """Number of times at which the acceleration jumps, including starts from rest and stops."""
        motion, width = self.least.motion, np.diff(np.asarray(self.least.motion.knots))
        points = np.asarray(motion.position)
        bends = np.linalg.norm(np.diff(points, 2, axis=1), axis=2) / width[:, None] ** 2
        slopes = np.linalg.norm(np.diff(points, axis=1), axis=2)
        at_rest = slopes[[0, -1], [0, -1]] <= JUMP * slopes.max()
        at_ends = at_rest & (bends[[0, -1], [0, -1]] > JUMP * bends.max())
        return len(motion.jumps(JUMP)) + int(at_ends.sum())

    def to_dict(self) -> dict[str, Any]:
        """The section as the JSON of a plan has it."""
        minimum = self.least
        points = np.asarray(minimum.motion.position)
        nodes = np.concatenate([points[:, 0], points[-1:, -1]])
        lowest = float(np.nanmax(minimum.plane.low, initial=0.0))
        return {
            "segments": [self.before + segment for segment in self.ends],
            "length": float(np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()),
            "duration": minimum.duration,
            "lower_bound": minimum.lower_bound,
            "gap": 1.0 - minimum.lower_bound / minimum.duration,
            "ramp_time": minimum.ramp_time,
            "ramp_cost": minimum.duration / minimum.jumping - 1.0 if minimum.ramp_time else math.nan,
            "path_deviation": minimum.deviation,
            "least_speed": lowest or None,
            "binding": _binding([(minimum, np.diff(np.asarray(minimum.motion.knots)))]),
            "jumps": self.jumps,
        }


def _binding(parts: Iterable[tuple[LeastTime, np.ndarray]]) -> list[dict[str, Any]]:
    # Return names of the criteria that bind, the longest binding first, in cells that take these times.
    fractions, total = dict[BindingName, float](), 0.0
    for minimum, times in parts:
        total += float(times.sum())
        for k, name in enumerate(minimum.names):
            fractions[name] = fractions.get(name, 0.0) + float(times[minimum.binds == k].sum())
    order = sorted((name for name in fractions if fractions[name] > 0.0), key=lambda name: -fractions[name])
    return [
        {"criterion": name.criterion, "cable": name.cable, "words": name.words, "share": fractions[name] / total}
        | ({"feed": name.feed} if name.feed else {})
        for name in order[:MOST_BINDING]
    ]


def feeds_of(sections: Iterable[SectionAnswer], segment: int) -> Float[np.ndarray, "pieces"]:
    """Largest speeds that the path itself allows on the pieces of a segment's motion."""
    return np.concatenate([section.least.feed[section.segments == segment] for section in sections])


@dataclasses.dataclass(frozen=True)
class PathCause(Cause):
    """A point of a path that no path speed can pass, or an end at which the speed is not possible.

    Fields:
        s: path coordinate of the point, from the start of its section, m.
        position: (3,) the point, in the axes of the robot file, m.
        needs: whether the criterion needs an acceleration that `against` forbids, and not vice versa.
        against: flag and cable of the other criterion; None: the rest of the path, which limits the speed at the point.
        end: "start" or "end" if the speed at this end of the section is not possible, else "".
        speeds: smallest and largest possible speed at such an end, m/s.
        static_tension: tension that prevents rest at the point; None if the robot can rest there.
    """

    s: float = math.nan
    position: tuple[float, ...] = ()
    needs: bool = True
    against: tuple[str, int | None] | None = None
    end: str = ""
    speeds: tuple[float, float] = (math.nan, math.nan)
    static_tension: StaticTension | None = None

    def to_dict(self) -> dict[str, Any]:
        """The cause as the JSON of a plan has it; see `Cause.to_dict`."""
        table = super().to_dict() | {"s": self.s, "position": list(self.position)}
        table["still"] = None if self.static_tension is None else self.static_tension.to_dict()
        if self.end:
            return table | {"end": self.end, "speeds": list(self.speeds)}
        criterion, cable = self.against or (None, None)
        return table | {"needs": self.needs, "against": {"criterion": criterion, "cable": cable}}

    @property
    def text(self) -> str:
        """The cause in one line of words."""
        position, static, line = _coordinates(self.position), self.static_tension, ""
        if static is not None:
            line = f"cannot stand still at ({_coordinates(static.position.tolist())}): {static.text}; "
        if self.end:
            low, high = (_shown(speed) for speed in self.speeds)
            speed = f"{self.end}_speed = {_shown(self.needed)} m/s"
            return f"{line}{speed} is not possible at ({position}): from {low} to {high} m/s are"
        one = _limit(self.criterion, self.cables[0] if self.cables else None)
        line += f"no path speed passes s = {_shown(self.s)} m at ({position})"
        if not math.isfinite(self.needed):
            return f"{line}: {one} cannot be kept there"
        other = "the way on" if self.against is None else _limit(*self.against)
        needing, allowing = (one, other) if self.needs else (other, one)
        return (
            f"{line}: {needing} needs {_shown(self.needed)} m/s² or more along the path, {allowing} allows "
            f"{_shown(self.allowed)} or less"
        )


def _limit(criterion: str, cable: int | None) -> str:
    return f"the {criterion_words(Verdict[criterion.upper()], cable)}"


def _coordinates(position: Iterable[float]) -> str:
    return ", ".join(_shown(round(value, DECIMALS)) for value in position)


def _shown(value: float) -> str:
    return f"{round(value, 9) + 0.0:.{DIGITS}g}"


@dataclasses.dataclass(frozen=True)
class PathAnswers(Answers):
    """Answers of segments of paths.

    Fields:
        sections: (n,) all sections that run through each segment.
    """

    sections: np.ndarray

    def details(self, i: int) -> dict[str, Any]:
        """Bounds of the least time, binding criteria, and details of proofs; see `Answers.details`."""
        through = self.sections[i]
        is_whole = all(section.ends == (i, i) for section in through)
        bound = sum(section.least.lower_bound for section in through) if is_whole else math.nan
        return super().details(i) | {
            "lower_bound": bound,
            "gap": 1.0 - bound / float(self.duration[i]),
            "binding": _binding((section.least, section.times(i)) for section in through),
            "sections": [section.to_dict() for section in through if section.ends[1] == i],
        }

    def every_section(self) -> list[SectionAnswer]:
        """All sections; see `Answers.every_section`."""
        return [section for i, through in enumerate(self.sections) for section in through if section.ends[0] == i]

    def notes(self, key: str = "path.ramp_time") -> list[str]:
        """Warn in one line where ramps are shorter than requested."""
        sections = self.every_section()
        missing = [s for s in sections if s.least.failure is None and s.least.ramp_time < (1.0 - JUMP) * s.ramp_time]
        if not missing:
            return []
        jumping = sum(section.least.ramp_time == 0.0 for section in missing)
        shortest = min((s.least.ramp_time for s in missing if s.least.ramp_time > 0.0), default=0.0)
        where = f" in {len(missing)} of {len(sections)} sections" if len(sections) > 1 else ""
        words = [f"shorter ones, of {_shown(shortest)} s or more, stand in for them"] if shortest else []
        words += ["accelerations jump" + (f" in {jumping}" if jumping < len(missing) else "")] if jumping else []
        return [
            f"{key} = {_shown(missing[0].ramp_time)} s: no ramps of that length were found{where}: {'; '.join(words)}"
        ]

    def causes_of(self, i: int, frame: Frame) -> tuple[Cause, ...]:
        """Points that no path speed can pass, then causes that no other speed removes; see `Answers.causes_of`."""
        usual, causes, before = super().causes_of(i, frame), list[Cause](), 0.0
        for section in self.sections[i]:
            times, failure = section.times(i), section.least.failure
            if failure is not None:
                node = int(np.argmin(np.abs(section.least.coordinate - failure.coordinate)))
                is_inside = section.segments[min(node, len(times) - 1)] == i
                t = before + float(times[:node].sum()) if is_inside else math.nan
                causes.append(_cause_of(failure, t, usual[0], frame))
            before += float(times.sum())
        if not causes:
            return usual
        return (*causes, *(cause for cause in usual if not Verdict[cause.criterion.upper()] & OF_SPEED))


def _cause_of(failure: NoMotion, t: float, usual: Cause, frame: Frame) -> PathCause:
    # If the speed at an end is refused, name the criterion that the slow motion breaks.
    names = failure.names or ((Verdict[usual.criterion.upper()], None),)
    needs = names[0] is not None
    (criterion, cable), *others = [name for name in names if name is not None]
    against = (others[0][0].text, others[0][1]) if others else None
    static = failure.static_tension
    return PathCause(
        criterion=criterion.text,
        cables=() if cable is None else (cable,),
        t=t,
        needed=failure.needed,
        allowed=failure.allowed,
        unit="m/s" if failure.end else "m/s^2",
        s=failure.coordinate,
        position=tuple(frame.outward(failure.position).tolist()),
        needs=needs,
        against=against,
        end=failure.end,
        speeds=failure.speeds,
        static_tension=None if static is None else static._replace(position=frame.outward(static.position)),
    )
