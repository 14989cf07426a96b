"""Protocol of checkers of a platform's motions for searches and plans, for any number of cables."""

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

# Numbers of motions in a batch, for few and for many motions; batches are padded, so that only two are compiled.
FEW, MANY = 256, 2048
TOUCH = 1e-6  # fraction of the platform's radius: smallest distance from a contact at poses of a plan
BESIDE_KNOT = 1e-12
BASIC = 3  # number of criteria that are no limits


@dataclasses.dataclass(frozen=True)
class PlatformChecks:
    """Verdicts, slacks and distances of cables of n motions.

    Fields:
        verdict: (n,) `Verdict` flags; 0 if feasible.
        slack: (n, n_criteria) smallest slack of each criterion in `MotionChecker.flags`; NaN where it is not computed.
        gap: (n,) smallest distance between cables that can touch, m; infinite if none can.
        bound: (n,) proved lower bound of the slack of taut cables and of the depth below the spools; NaN without a
            proof, as on more than six cables before `MotionChecker.confirmed`.
        refuted_tau: (n,) tau at which the motion is refuted: by its tensions, else by limits and contacts (to within a
            small step); NaN if it is not refuted, or by contacts that were only sampled.
        tolerated: (n,) multiple of the uncertainty that the motion is proved to tolerate; for verdicts alone, 1 or 0;
            NaN without an uncertainty, or if the motion is not feasible as planned.
        not_tolerated: (n,) multiple that the motion does not tolerate; infinite if none was found; NaN likewise.
    """

    verdict: np.ndarray
    slack: np.ndarray
    gap: np.ndarray
    bound: np.ndarray
    refuted_tau: np.ndarray
    tolerated: np.ndarray
    not_tolerated: np.ndarray

    def put(self, index: Float[np.ndarray, "m"], others: "PlatformChecks") -> None:
        """Write checks of some motions into these."""
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
            segments: leaves (n, ...), all with this number of arcs.
            arcs: number of arcs.
            tau: (m,) times of the samples.

        Returns:
            (n,) slacks; -inf where not finite.
        """
        ...

    def refuted(self, segments: PlatformSegment, arcs: int, tau: np.ndarray, *, limits: bool = True) -> np.ndarray:
        """Mask of the motions that some samples refute.

        Args:
            segments: leaves (n, ...), all with this number of arcs.
            arcs: number of arcs.
            tau: (m,) times, those that refute most motions first.
            limits: whether limits may refute motions as well.

        Returns:
            (n,) mask.
        """
        ...


@persistent_jit
def _durations(arguments) -> jax.Array:
    return jax.vmap(duration)(*arguments)


class MotionChecker(abc.ABC):
    """Checker of motions of one robot.

    Args:
        problem: robot, limits and amplitude function.
        batch: number of motions computed at a time.

    Fields:
        flags: flag of each criterion: slack cables, singular poses, poses above the spools, then limits. The slack of a
            criterion that does not apply is NaN or infinite.
        screen: the cheap test that comes before checks.
    """

    flags: tuple[Verdict, ...]
    screen: Screen

    def __init__(self, problem: Problem, kind: PlatformMotionKind, *, batch: int) -> None:
        """Store the problem, the kind of the motions, and the number of motions in a batch."""
        self.problem, self.kind, self.batch = problem, kind, batch

    def durations(self, segments: PlatformSegment, arcs: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Durations of segments."""
        return in_batches(_durations, (segments, arcs.astype(float)), batch_size=self.batch)

    def nothing(self, count: int) -> PlatformChecks:
        """Checks to be filled in."""
        numbers = [np.full(count, np.nan) for _ in range(5)]
        return PlatformChecks(np.zeros(count, int), np.full((count, len(self.flags)), np.nan), *numbers)

    def tolerated(self, segments: PlatformSegment, arcs: Float[np.ndarray, "n"]) -> Tolerated:
        """Multiples of the uncertainty that motions tolerate, as tightly bounded as possible."""
        return Tolerated(np.full(len(arcs), np.nan), np.full(len(arcs), np.nan))

    def confirmed(
        self, segments: PlatformSegment, arcs: Float[np.ndarray, "n"], checks: PlatformChecks
    ) -> PlatformChecks:
        """Checks of motions that passed, each with a proof; by default the checks themselves are proofs."""
        return checks

    @property
    def is_limit(self) -> np.ndarray:
        """Mask of the criteria of `flags` that are limits, (n_criteria,)."""
        return np.arange(len(self.flags)) >= BASIC

    @abc.abstractmethod
    def breaks(self, slack: Float[np.ndarray, "n n_criteria"]) -> Float[np.ndarray, "n n_criteria"]:
        """Mask of the criteria that are certainly broken, given slacks."""

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
        """Check motions in full, not by a screen alone."""

    @abc.abstractmethod
    def end_interval(
        self, position: Float[np.ndarray, "3"], quaternion: Float[np.ndarray, "4"], z0: float
    ) -> tuple[float, float, float]:
        """Value of beta-hat to try first, and interval of values at which a segment can end at a pose."""

    @abc.abstractmethod
    def end_options(
        self,
        positions: Float[np.ndarray, "n 3"],
        quaternions: Float[np.ndarray, "n 4"],
        z0: Float[np.ndarray, "n"],
        count: int,
    ) -> tuple[Float[np.ndarray, "n count"], Bool[np.ndarray, "n"]]:
        """Values of beta-hat to try at poses."""
