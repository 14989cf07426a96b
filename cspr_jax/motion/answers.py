"""Answers about segments of motions: the record that every family returns."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from cspr_jax.motion.cause import Cause
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.schema.columns import Columns

if TYPE_CHECKING:
    from jaxtyping import Bool, Int

AnyAnswers = TypeVar("AnyAnswers", bound="Answers")


@dataclasses.dataclass(frozen=True)
class Answers(Columns):
    """One answer for each segment.

    Fields:
        arcs: (n,) smallest number of arcs proved feasible; 0: none.
        tried_arcs: (n,) number of arcs of the motion that duration and margins belong to: `arcs`; if that is 0, the
            candidate that one limit alone refuses; if there is none, the candidate with the largest margin.
        verdict: (n,) `Verdict` flags; 0 is feasible.
        duration: (n,) s.
        margin: (n,) smallest normalised pseudotension, or depth below the spools over z0.
        margin_bound: (n,) proved lower bound of the margin; NaN where nothing is proved.
        limit_margin: (n,) smallest slack of the limits; inf without limits.
        feasible_at_infinity: (n,) left-hand side of (2.55); positive if enough arcs make the segment feasible.
        tolerated: (n,) largest multiple of the uncertainty that the motion is proved to tolerate; NaN without one.
        not_tolerated: (n,) smallest multiple for which a robot was found that fails.
    """

    arcs: np.ndarray
    tried_arcs: np.ndarray
    verdict: np.ndarray
    duration: np.ndarray
    margin: np.ndarray
    margin_bound: np.ndarray
    limit_margin: np.ndarray
    feasible_at_infinity: np.ndarray
    tolerated: np.ndarray
    not_tolerated: np.ndarray

    @property
    def feasible(self) -> np.ndarray:
        """Tell whether each segment is proved feasible, (n,)."""
        return self.arcs > 0

    def rows(self: AnyAnswers, index: Bool[np.ndarray, "m"]) -> AnyAnswers:
        """Some of the answers."""
        return type(self)(**{name: values[index] for name, values in vars(self).items()})

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment that only this kind of answers has, by their names in a plan's JSON."""
        return {}

    def every_section(self) -> list[Any]:
        """Sections of paths that the segments run along."""
        return []

    def proved_causes(self, i: int, frame: Frame) -> tuple[Cause, ...] | None:
        """Causes why a segment is not feasible, where the family knows them itself."""
        return None


def joined(parts: list[AnyAnswers]) -> AnyAnswers:
    """Answers of several parts as one record."""
    return type(parts[0])(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])})


def replaced(
    answers: AnyAnswers, index: Int[np.ndarray, "m"], others: Answers, chosen: Int[np.ndarray, "m"]
) -> AnyAnswers:
    """Answers, some of which others replace."""
    columns = {name: np.array(values) for name, values in vars(answers).items()}
    for name, values in columns.items():
        values[index] = getattr(others, name)[chosen]
    return type(answers)(**columns)
