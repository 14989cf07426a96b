"""Answers of motions with bounds of their states, proved or refuted over the full duration, in natural units."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from cspr_jax.motion.answers import Answers
from cspr_jax.motion.cause import Cause
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds.intervals import united
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots.bounds.state_bounds import StateBounds, at_rest
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.bounds.batch import batch_key
from cspr_jax.verification.bounds.block_parts import TimeBlocks
from cspr_jax.verification.bounds.block_slacks import BlockSlacks, block_slacks
from cspr_jax.verification.criteria import ALL, AT_TIMES, Criterion, CriterionParts, criteria, levels
from cspr_jax.verification.robustness.motion_tolerances import motion_tolerances, states_as_bounds
from cspr_jax.verification.time_proof import TimeProof, time_proofs

# Slacks of proofs by bounds are right to this fraction of limit and scale; their rounding is some 1e-13.
ROUNDED = 1e-11
# Number of intervals between samples of a motion without bounds.
SAMPLES = 2000
ManyBounds = Callable[[np.ndarray, np.ndarray, np.ndarray], StateBounds]
OF_NOTHING = TimeProof(np.empty(0), np.empty(0), np.empty(0), [], [], 0)
TENSIONS = Verdict.SLACK_CABLE | Verdict.OVER_TENSION | Verdict.WRENCH_INFEASIBLE


class MotionProof(NamedTuple):
    """Proof of one motion.

    Fields:
        criteria: criteria of the robot within its limits.
        proof: proof of these criteria.
        scales: (n_criteria,) divisors that make slacks of different criteria comparable, in their units.
        obstacles: names of the obstacles.
        feeds: (pieces,) largest speed of the mass centre on each piece of the motion, m/s, inf without a feed; None:
            there are no feeds.
        parts: criteria that are proved; the family of the motion proves the others.
    """

    criteria: tuple[Criterion, ...]
    proof: TimeProof
    scales: np.ndarray
    obstacles: tuple[str, ...] = ()
    feeds: np.ndarray | None = None
    parts: CriterionParts = ALL

    @property
    def is_feasible(self) -> bool:
        """Tell whether every criterion is proved."""
        return bool((self.proof.low > levels(self.criteria)).all())

    @property
    def broken(self) -> np.ndarray:
        """Mask (n_criteria,) of the criteria that fail at some time."""
        return (self.proof.high < levels(self.criteria)) | np.array(
            [len(intervals) > 0 for intervals in self.proof.failing], bool
        )

    @property
    def rounding(self) -> Float[np.ndarray, "n_criteria"]:
        """Distances of slacks from their levels within which rounding may have put them on the other side."""
        return _rounding(self.criteria, self.scales)

    @property
    def doubtful(self) -> Bool[np.ndarray, "n_criteria"]:
        """Tell which criteria are neither met nor broken, or within rounding of that."""
        level, broken = levels(self.criteria), self.broken
        near = np.where(broken, self.proof.high > level - self.rounding, self.proof.low < level + self.rounding)
        return near | ~((self.proof.low > level) | broken)

    @property
    def nearest(self) -> Bool[np.ndarray, "n_criteria"]:
        """Tell which criteria may have the smallest slack of all with their flag."""
        low, high = (side / self.scales for side in (self.proof.low, self.proof.high))
        flags = np.array([row.flag.value for row in self.criteria])
        minimum = np.array([high[flags == flag].min() for flag in flags])
        return (low <= minimum) & np.isfinite(high)

    @property
    def verdict(self) -> Verdict:
        """Flags of the criteria that fail; without any, feasible or undecided."""
        flags = Verdict.FEASIBLE
        for row, is_broken in zip(self.criteria, self.broken, strict=True):
            flags |= row.flag if is_broken else Verdict.FEASIBLE
        if flags or self.is_feasible:
            return flags
        return Verdict.UNDECIDED

    @property
    def margin(self) -> float:
        """Upper bound of the smallest margin of tensions, N."""
        return self.smallest(self.proof.high, TENSIONS)

    @property
    def margin_bound(self) -> float:
        """Lower bound of the smallest margin of tensions, N."""
        return self.smallest(self.proof.low, TENSIONS)

    def smallest(self, side: Float[np.ndarray, "n_criteria"], flags: Verdict, *, others: bool = False) -> float:
        """Smallest bound of the criteria that have, or do not have, some flags."""
        chosen = np.array([bool(row.flag & flags) != others for row in self.criteria], bool)
        return float(np.min((side / self.scales if others else side)[chosen], initial=np.inf))

    def with_feeds(self, motion: Any, feeds: np.ndarray | None) -> "MotionProof":
        """The proof, extended by feeds that a motion of pieces must keep."""
        if feeds is None or not np.isfinite(feeds).any():
            return self
        from cspr_jax.verification.feeds import feed_proof

        usual, (row, proof) = self.proof, feed_proof(motion, feeds)
        both = TimeProof(
            low=np.append(usual.low, proof.low),
            high=np.append(usual.high, proof.high),
            when=np.append(usual.when, proof.when),
            failing=usual.failing + proof.failing,
            open=usual.open + proof.open,
            blocks=usual.blocks + proof.blocks,
            near=usual.near,
        )
        scales = np.append(self.scales, row.allowed)
        return self._replace(criteria=(*self.criteria, row), proof=both, scales=scales, feeds=feeds)

    @property
    def failing(self) -> np.ndarray:
        """Intervals in which at least one criterion fails, (m, 2) s, in order, without overlaps."""
        return united(np.concatenate([np.empty((0, 2)), *self.proof.failing]))

    @property
    def failing_by_criterion(self) -> dict[str, list[list[float]]]:
        """Intervals [start, end] in which criteria fail, s, by the names of their flags."""
        parts: dict[str, list[np.ndarray]] = {}
        for row, intervals in zip(self.criteria, self.proof.failing, strict=True):
            if len(intervals):
                parts.setdefault(row.flag.text, []).append(intervals)
        return {name: united(np.concatenate(each)).tolist() for name, each in parts.items()}

    @property
    def details(self) -> dict[str, Any]:
        """Intervals of failure, as `Answers.details` gives them."""
        return {"failing": self.failing.tolist(), "failing_by_criterion": self.failing_by_criterion}

    def causes(self, frame: Frame, flags: Verdict) -> tuple[Cause, ...]:
        """The worst cable of each criterion with one of some flags, in order of severity; see `SegmentProof`.

        If the flags name no criterion, take those that fail; if none fails, the one with the smallest slack, undecided.
        """
        order = np.argsort((self.proof.high - levels(self.criteria)) / self.scales).tolist()
        chosen = [k for k in order if self.criteria[k].flag & flags] or [k for k in order if self.broken[k]]
        if not chosen:
            return (dataclasses.replace(cause_of(self, order[0], frame), criterion=Verdict.UNDECIDED.text),)
        worst = {self.criteria[k].flag: k for k in reversed(chosen)}
        named, unbounded = list(dict.fromkeys(self.criteria[k].flag for k in chosen)), list[Verdict]()
        if Verdict.ABOVE_SPOOLS in worst:
            # Passing the spool plane comes first, since tensions grow without bound towards it.
            named.sort(key=lambda flag: flag != Verdict.ABOVE_SPOOLS)
            unbounded = [flag for flag in named if flag & TENSIONS]
        bounded = [flag for flag in named if flag not in unbounded]
        return (*(cause_of(self, worst[flag], frame) for flag in bounded), *(Cause(flag.text) for flag in unbounded))


def cause_of(case: MotionProof, k: int, frame: Frame) -> Cause:
    """Cause from a criterion of a proof."""
    row, proof = case.criteria[k], case.proof
    needed, allowed = row.value(float(proof.high[k])), row.allowed
    if row.flag == Verdict.BELOW_FLOOR:
        needed, allowed = (float(frame.height(depth)) for depth in (needed, allowed))
    obstacle = "" if row.obstacle is None else case.obstacles[row.obstacle]
    return Cause(row.flag.text, row.cables, float(proof.when[k]), needed, allowed, row.unit, obstacle)


def proved_answers(
    problem: Problem, motions: Sequence[Any], scene: Scene | None = None, feeds: Sequence[np.ndarray | None] = ()
) -> Answers:
    """Answers of motions from bounds of their states; motions without bounds are sampled."""
    proofs = [proof_of(problem, motion, scene) for motion in motions]
    for i, speeds in enumerate(feeds):
        proofs[i] = proofs[i].with_feeds(motions[i], speeds)
    answers = answers_of(proofs, np.array([float(motion.duration()) for motion in motions]))
    verify_all_robots(problem, answers, motions, scene)
    return answers


def verify_all_robots(problem: Problem, answers: Answers, motions: Sequence[Any], scene: Scene | None = None) -> None:
    """Verify feasible motions for all robots within the uncertainty, if there is one."""
    if problem.limits.uncertainty is not None:
        for i in np.flatnonzero(answers.feasible).tolist():
            proved, refuted = (float(side[0]) for side in motion_tolerances(problem, motions[i], scene))
            answers.tolerated[i], answers.not_tolerated[i] = proved, refuted
            if proved < 1.0:
                answers.verdict[i] = (Verdict.UNCERTAINTY if refuted <= 1.0 else Verdict.UNDECIDED).value


def proof_of(
    problem: Problem,
    motion: Any,
    scene: Scene | None = None,
    *,
    parts: CriterionParts = ALL,
    intervals: bool = True,
) -> MotionProof:
    """Proof of one motion; a motion without bounds or duration can only be refuted, by samples."""
    if not hasattr(motion, "bounds") or not np.isfinite(float(motion.duration())):
        return sampled_proof(problem, motion, scene, parts=parts)
    jumps = [motion.jumps()] if hasattr(motion, "jumps") else []
    durations = np.array([float(motion.duration())])

    def bounds(_: np.ndarray, start: np.ndarray, end: np.ndarray) -> StateBounds:
        return motion.bounds(start, end)

    kind: Any = {"parts": parts, "intervals": intervals}
    return proofs_of(problem, bounds, durations, scene, jumps, **kind)[0]


def proofs_of(
    problem: Problem,
    bounds: ManyBounds,
    durations: Float[np.ndarray, "n"],
    scene: Scene | None = None,
    jumps: Sequence[np.ndarray] = (),
    *,
    parts: CriterionParts = ALL,
    intervals: bool = True,
) -> list[MotionProof]:
    """Proofs of several motions at once."""
    rows = _criteria(problem, scene, parts)
    if not rows:
        return [_proof(problem, rows, OF_NOTHING, scene, parts)] * len(durations)

    def slacks(motion: np.ndarray, start: np.ndarray, end: np.ndarray) -> BlockSlacks:
        of_motion = partial(bounds, motion)
        return block_slacks(problem.robot, problem.limits, of_motion, start, end, scene, parts=parts)

    # Answers name only the nearest contact of each kind, so that others need not be bounded closely.
    names = [(row.flag, () if row.flag in AT_TIMES else row.cables) for row in rows]
    groups = np.array([names.index(name) for name in names])
    how: Any = {"intervals": intervals, "margins": parts.usual or parts.contacts}
    how["rounding"] = _rounding(rows, _scales(problem, rows))
    proofs = time_proofs(slacks, durations, jumps=jumps, groups=groups, level=levels(rows), **how)
    return [_proof(problem, rows, proof, scene, parts) for proof in proofs]


def proofs_of_each(
    problem: Problem, motions: Sequence[Any], scene: Scene | None = None, **how: Any
) -> list[MotionProof]:
    """Proofs of motions whose structures may differ; blocks of all motions are bounded together."""
    durations = np.array([float(motion.duration()) for motion in motions])
    if not all(hasattr(motion, "bounds") for motion in motions) or not np.isfinite(durations).all():
        return [proof_of(problem, motion, scene, **how) for motion in motions]

    jumps = [motion.jumps() if hasattr(motion, "jumps") else np.empty(0) for motion in motions]
    return proofs_of(problem, bounds_together(motions), durations, scene, jumps, **how)


def bounds_together(motions: Sequence[Any]) -> ManyBounds:
    """Bounds of the states of several motions; those that one batch can hold are bounded in one call."""
    groups: dict[Hashable, list[int]] = {}
    for i, motion in enumerate(motions):
        groups.setdefault(batch_key(motion) if hasattr(motion, "batch") else i, []).append(i)
    batch, number = np.empty(len(motions), int), np.empty(len(motions), int)
    for k, members in enumerate(groups.values()):
        batch[members], number[members] = k, range(len(members))
    batches = [_batch_bounds([motions[i] for i in members]) for members in groups.values()]

    def bounds(index: np.ndarray, start: np.ndarray, end: np.ndarray) -> StateBounds:
        chosen = np.unique(batch[index]).tolist()
        rows = [np.flatnonzero(batch[index] == k) for k in chosen]
        parts = [batches[k](number[index[row]], start[row], end[row]) for k, row in zip(chosen, rows, strict=True)]
        if len(parts) == 1:
            return parts[0]
        order = np.argsort(np.concatenate(rows))
        return jax.tree.map(lambda *leaves: np.concatenate([np.asarray(array) for array in leaves])[order], *parts)

    return bounds


def _batch_bounds(motions: list[Any]) -> ManyBounds:
    if hasattr(motions[0], "batch"):
        return motions[0].batch(motions).bounds
    return lambda _, start, end: motions[0].bounds(start, end)


def _criteria(problem: Problem, scene: Scene | None, parts: CriterionParts) -> tuple[Criterion, ...]:
    return tuple(criteria(problem.robot, problem.limits, scene, parts))


def _proof(
    problem: Problem, rows: tuple[Criterion, ...], proof: TimeProof, scene: Scene | None, parts: CriterionParts
) -> MotionProof:
    names = () if scene is None else tuple(obstacle.name for obstacle in scene.obstacles)
    return MotionProof(rows, proof, _scales(problem, rows), names, parts=parts)


def answers_of(proofs: Sequence[MotionProof], duration: Float[np.ndarray, "n"]) -> Answers:
    """Answers of proofs."""
    count = len(proofs)
    none, nothing = np.zeros(count, int), np.full(count, np.nan)
    each = np.empty(count, object)
    each[:] = proofs
    return Answers(
        arcs=none,
        tried_arcs=none,
        verdict=np.array([proof.verdict.value for proof in proofs], FLAGS),
        duration=duration,
        **margins_of(proofs),
        feasible_at_infinity=nothing,
        tolerated=nothing.copy(),
        not_tolerated=nothing.copy(),
        margin_unit="N",
        proof=each,
    )


def margins_of(proofs: Sequence[MotionProof]) -> dict[str, np.ndarray]:
    """Margins of proofs."""
    return {
        "margin": np.array([case.margin for case in proofs]),
        "margin_bound": np.array([case.margin_bound for case in proofs]),
        "limit_margin": np.array([case.smallest(case.proof.high, TENSIONS, others=True) for case in proofs]),
    }


def sampled_proof(
    problem: Problem,
    motion: Motion,
    scene: Scene | None = None,
    samples: int = SAMPLES,
    *,
    parts: CriterionParts = ALL,
) -> MotionProof:
    """Refute a motion that has no bounds by its samples, or leave it undecided.

    A motion whose duration is not finite is sampled at rest along its path, with the time of the start.
    """
    tau, duration = np.linspace(0.0, 1.0, samples + 1), float(motion.duration())
    states, times = states_as_bounds(motion, tau), tau * duration
    if not np.isfinite(duration):
        states, times = at_rest(states), np.where(tau > 0.0, np.nan, 0.0)
    # Blocks of length zero have the slacks at single times.
    high = block_slacks(problem.robot, problem.limits, lambda start, end: states, tau, tau, scene, parts=parts).high
    rows, high = _criteria(problem, scene, parts), np.where(np.isnan(high), np.inf, high)
    full = np.array([[0.0, times[-1]]])
    proof = TimeProof(
        low=np.full(high.shape[1], -np.inf),
        high=high.min(0),
        when=times[high.argmin(0)],
        failing=[_runs(times, column) for column in (high < levels(rows)).T],
        open=[full] * high.shape[1],
        blocks=len(tau),
        near=_between(times, high),
    )
    return _proof(problem, rows, proof, scene, parts)


def _between(times: np.ndarray, high: np.ndarray) -> TimeBlocks:
    # Blocks between samples, without lower bounds.
    upper = np.minimum(high[1:], high[:-1])
    slacks = BlockSlacks(np.full_like(upper, -np.inf), upper).complete()
    return TimeBlocks(np.zeros(len(upper), int), times[:-1], times[1:], slacks)


def _runs(times: np.ndarray, flags: np.ndarray) -> np.ndarray:
    # First and last times of runs of true flags, (m, 2); none where times are not known.
    if np.isnan(times[-1]):
        return np.empty((0, 2))
    edges = np.diff(np.concatenate([[0], flags.astype(int), [0]]))
    return np.stack([times[edges[:-1] == 1], times[edges[1:] == -1]], axis=1)


def _rounding(rows: Sequence[Criterion], scales: Float[np.ndarray, "n_criteria"]) -> Float[np.ndarray, "n_criteria"]:
    return ROUNDED * (np.abs([row.allowed for row in rows]) + scales)


def _scales(problem: Problem, rows: Sequence[Criterion]) -> np.ndarray:
    # Scales are weight / n_cables for tensions, the robot's radius for lengths, and the allowed value for others.
    robot = problem.robot
    # On a guide a single spool is the centroid itself.
    weight, radius = float(robot.mass * robot.gravity) / robot.n_cables, float(spool_radius(robot)) or 1.0
    of_unit = {"N": weight, "m": radius, "1": 1.0}
    return np.array([of_unit.get(row.unit, row.allowed) for row in rows])
