"""Answers of searches from Python, which know their motions."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.motions.answers import Answers
from cspr_jax.motions.demands import SAMPLES
from cspr_jax.motions.leg import each
from cspr_jax.motions.motion import Placed
from cspr_jax.motions.problem import Problem
from cspr_jax.plans.causes import Cause, causes
from cspr_jax.platforms.answers import PlatformMotionAnswers
from cspr_jax.swings.oscillations import OscillationAnswers


@dataclasses.dataclass(frozen=True)
class _WithMotions:
    # The callable is a function of a module, bound to its arguments, so that answers can be pickled and copied.
    make: Callable[[Any], Placed] = dataclasses.field(kw_only=True, repr=False, compare=False)
    problem: Problem = dataclasses.field(kw_only=True, repr=False, compare=False)

    def motions(self) -> Any:
        """Motions that the answers belong to: of the number of arcs found, else of the one that comes nearest.

        Returns:
            one motion whose leaves have a leading dimension (n,), in the robot's axes: `jax.vmap` takes it apart.
        """
        return self.make(self)

    def causes(self: Any) -> list[tuple[Cause, ...]]:
        """Find what keeps motions from being feasible, in numbers.

        Returns:
            the causes for each of the n motions, the worst one first; a feasible motion has none.
        """
        with double_precision():
            placed, count = self.make(self), len(self.verdict)
            if not count:
                return []
            frame = each(placed.frame, count)[0]
            samples = SAMPLES * np.maximum(self.tried_arcs, 1) + 1
            return causes(self.problem, frame, self, each(placed.motion, count), samples)


@dataclasses.dataclass(frozen=True)
class ArcsAnswers(Answers, _WithMotions):
    """Answers of `minimum_arcs`; see `motions.answers.Answers`."""


@dataclasses.dataclass(frozen=True)
class TransitionAnswers(OscillationAnswers, _WithMotions):
    """Answers of `minimum_oscillations`; see `swings.oscillations.OscillationAnswers`."""


@dataclasses.dataclass(frozen=True)
class PlatformAnswers(PlatformMotionAnswers, _WithMotions):
    """Answers of `minimum_pose_arcs`; see `platforms.answers.PlatformMotionAnswers`."""
