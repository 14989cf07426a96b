"""Checkers of a platform's motions: what searches and plans ask of them, whatever the number of cables."""

from __future__ import annotations

import abc
import dataclasses
from typing import Protocol

import jax
import numpy as np

from cspr_jax.families.platforms.platform_segment import PlatformSegment, duration
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.robustness.tolerances import Tolerated

# Sizes of a batch, for few and for many motions: batches are filled up, so that only two sizes are compiled.
FEW, MANY = 256, 2048
TOUCH = 1e-6  # part of the platform's radius: poses of a plan must not be nearer to a contact
BESIDE_KNOT = 1e-12
BASIC = 3  # criteria that are no limits


@dataclasses.dataclass(frozen=True)
class PlatformChecks:
    """Verdicts, slacks and gaps of n motions.

    Fields:
        verdict: (n,) `Verdict` flags; 0 is feasible.
        slack: (n, n_criteria) smallest of each criterion of `MotionChecker.flags`; NaN where unknown.
        gap: (n,) smallest distance between cables that can meet, m; infinite where none can.
        bound: (n,) proved lower bound of the slack of taut cables and of the depth below the spools; NaN where nothing
            is proved, as on more than six cables before `MotionChecker.confirmed`.
        refuted_tau: (n,) tau at which the motion is refuted: by its tensions, else by limits and contacts (within a
            small step of it); NaN where it is not refuted, or by contacts that were only sampled.
        tolerated: (n,) multiple of the uncertainty that the motion is proved to tolerate; for verdicts alone, just 1 or
            less; NaN where no uncertainty is given, or the motion is not feasible as planned.
        not_tolerated: (n,) multiple that the motion does not tolerate, likewise; infinite where none was found.
    """

    verdict: np.ndarray
    slack: np.ndarray
    gap: np.ndarray
    bound: np.ndarray
    refuted_tau: np.ndarray
    tolerated: np.ndarray
    not_tolerated: np.ndarray

    def put(self, index: Float[np.ndarray, "m"], others: "PlatformChecks") -> None:
        """Write other checks into these."""
        for column, new_column in zip(vars(self).values(), vars(others).values(), strict=True):
            column[index] = new_column

    def take(self, index: Float[np.ndarray, "m"]) -> "PlatformChecks":
        """Checks of some of the motions."""
        return PlatformChecks(**{name: values[index] for name, values in vars(self).items()})


class Screen(Protocol):
    """Cheap test of motions: a few samples that refute most infeasible motions."""

    def lowest(self, segments: PlatformSegment, arcs: int, tau: np.ndarray) -> np.ndarray:
        """Smallest slack of the tensions over some samples.

        Args:
            segments: leaves (n, ...), all of this number of arcs.
            arcs: the number.
            tau: (m,) times.

        Returns:
            (n,); -inf where not finite.
        """
        ...

    def refuted(self, segments: PlatformSegment, arcs: int, tau: np.ndarray, *, limits: bool = True) -> np.ndarray:
        """Mask of the motions that some samples refute.

        Args:
            segments: leaves (n, ...), all of this number of arcs.
            arcs: the number.
            tau: (m,) times, those that refute most motions first.
            limits: whether limits may refute motions, too.

        Returns:
            (n,).
        """
        ...


@persistent_jit
def _durations(arguments) -> jax.Array:
    return jax.vmap(duration)(*arguments)


class MotionChecker(abc.ABC):
    """Checker of motions of one robot.

    Args:
        problem: robot, limits, amplitude.
        batch: how many motions are computed at a time.

    Fields:
        flags: verdict of each criterion where it is broken: slack cables, singular poses, poses above the spools, then
            limits. Where a criterion does not apply, its slack is NaN or infinite.
        screen: the cheap test that comes before checks.
    """

    flags: tuple[Verdict, ...]
    screen: Screen

    def __init__(self, problem: Problem, kind: PlatformMotionKind, *, batch: int) -> None:
        """Keep the problem, the kind of the motions, and the number of motions of a batch."""
        self.problem, self.kind, self.batch = problem, kind, batch

    def durations(self, segments: PlatformSegment, arcs: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Durations of segments."""
        return in_batches(_durations, (segments, arcs.astype(float)), batch_size=self.batch)

    def nothing(self, count: int) -> PlatformChecks:
        """Checks to be filled in."""
        numbers = [np.full(count, np.nan) for _ in range(5)]
        return PlatformChecks(np.zeros(count, int), np.full((count, len(self.flags)), np.nan), *numbers)

    def tolerated(self, segments: PlatformSegment, arcs: Float[np.ndarray, "n"]) -> Tolerated:
        """Multiples of the uncertainty that motions tolerate, as closely as possible."""
        return Tolerated(np.full(len(arcs), np.nan), np.full(len(arcs), np.nan))

    def confirmed(
        self, segments: PlatformSegment, arcs: Float[np.ndarray, "n"], checks: PlatformChecks
    ) -> PlatformChecks:
        """Checks of motions that passed, with a proof of each; here they are proofs already."""
        return checks

    @property
    def is_limit(self) -> np.ndarray:
        """Mask of the criteria of `flags` that are limits, (n_criteria,)."""
        return np.arange(len(self.flags)) >= BASIC

    @abc.abstractmethod
    def breaks(self, slack: Float[np.ndarray, "n n_criteria"]) -> Float[np.ndarray, "n n_criteria"]:
        """Criteria that slacks break for certain."""

    @abc.abstractmethod
    def sampled(
        self, segments: PlatformSegment, arcs: int, tau: Float[np.ndarray, "m"]
    ) -> Float[np.ndarray, "n n_criteria"]:
        """Smallest slacks at some samples."""

    @abc.abstractmethod
    def check(
        self,
        segments: PlatformSegment,
        arcs: Float[np.ndarray, "n"],
        *,
        full: bool = True,
        margins: bool = True,
        ignored: Bool[np.ndarray, "n_criteria"] | None = None,
    ) -> PlatformChecks:
        """Check motions in full."""

    @abc.abstractmethod
    def end_interval(
        self, position: Float[np.ndarray, "3"], quaternion: Float[np.ndarray, "4"], z0: float
    ) -> tuple[float, float, float]:
        """Values of beta-hat at which a segment can end in a pose."""

    @abc.abstractmethod
    def end_options(
        self,
        positions: Float[np.ndarray, "n 3"],
        quaternions: Float[np.ndarray, "n 4"],
        z0: Float[np.ndarray, "n"],
        count: int,
    ) -> tuple[Float[np.ndarray, "n count"], Bool[np.ndarray, "n"]]:
        """Values of beta-hat to try at poses."""
