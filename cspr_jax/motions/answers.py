"""Answers about segments of motions: the record that every family returns."""

import dataclasses
from typing import Any, TypeVar

import numpy as np

from cspr_jax.schema.columns import Columns

AnyAnswers = TypeVar("AnyAnswers", bound="Answers")


@dataclasses.dataclass(frozen=True)
class Answers(Columns):
    """One answer a segment.

    Fields:
        arcs: (n,) smallest number of arcs proved feasible, on more than six cables found so at samples; 0: none.
        tried_arcs: (n,) the number of arcs that duration and margins belong to: `arcs`, else that of the candidate that
            a limit alone refuses, if there is one, else of that with the largest margin.
        verdict: (n,) `Verdict` flags; 0 is feasible.
        duration: (n,) s.
        margin: (n,) smallest normalised pseudotension, or depth below the spools over z0.
        margin_bound: (n,) proved lower bound of the same; NaN where nothing is proved, as on more than six cables.
        limit_margin: (n,) smallest slack of the limits; inf where none is given.
        feasible_at_infinity: (n,) left-hand side of (2.55).
        tolerated: (n,) largest multiple of the uncertainty that the motion is proved to stand; NaN where none is given.
        not_tolerated: (n,) smallest one found that it does not.
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
        """Tell whether each segment is feasible, (n,): proved, on more than six cables found at samples."""
        return self.arcs > 0

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment that only this kind of answers has, by their names in a plan's JSON.

        Args:
            i: number of the segment.

        Returns:
            plain values.
        """
        return {}


def joined(parts: list[AnyAnswers]) -> AnyAnswers:
    """Answers side by side.

    Args:
        parts: at least one.

    Returns:
        one for all.
    """
    return type(parts[0])(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])})
