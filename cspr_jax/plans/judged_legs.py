"""Legs of families that know neither surroundings nor pulleys: each motion is judged with both once it is made.

The family makes its motions as for cables from points and without surroundings. Among obstacles, or with the shape of a
platform, contacts alone are then proved, since the family has proved the rest; over pulleys, everything is. Where
numbers of arcs are free, point masses on as many cables as degrees of freedom take the smallest number that is proved.
"""

import copy
import dataclasses
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.arithmetic.frames import Frame
from cspr_jax.build.scenes import scene_of
from cspr_jax.errors import ConfigError
from cspr_jax.motions.answers import Answers
from cspr_jax.motions.cause import Cause
from cspr_jax.motions.leg import JoinedLeg, Leg
from cspr_jax.motions.motion import Motion
from cspr_jax.motions.outcome import LegOutcome
from cspr_jax.motions.problem import Problem
from cspr_jax.motions.proved_answers import TENSIONS, MotionProof, proof_of, sampled_proof
from cspr_jax.robots.clearance import Scene
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.verdicts import FLAGS, Verdict

# Intervals of the samples that refute most motions before a proof is tried.
FEW = 200
# Details of segments that hold for cables from points alone.
FROM_POINTS = (
    "det_margin",
    "det_sign_constant",
    "cable_interference",
    "cable_distance_min",
    "platform_interference",
    "refuted_at",
    "envelope_oscillations",
    "least_oscillations",
)


@dataclasses.dataclass(frozen=True)
class JudgedAnswers(Answers):
    """Answers of a family with the verdicts of further proofs.

    Fields:
        plain: the family's, with these verdicts.
        proofs: of the n motions; None: the family refuses the motion, or has none.
    """

    plain: Answers
    proofs: tuple[MotionProof | None, ...]

    @property
    def feasible(self) -> np.ndarray:
        """Tell whether each segment is proved feasible, (n,)."""
        return self.plain.feasible

    def details(self, i: int) -> dict[str, Any]:
        """Details of the family, and intervals of failure; see `Answers.details`."""
        details, proof = self.plain.details(i), self.proofs[i]
        return details if proof is None else details | {"failing": proof.failing.tolist()}

    def proved_causes(self, i: int, frame: Frame) -> tuple[Cause, ...] | None:
        """Causes by the proof, where there is one; see `Answers.proved_causes`."""
        proof = self.proofs[i]
        return self.plain.proved_causes(i, frame) if proof is None else proof.causes(frame)


class PulleyAnswers(JudgedAnswers):
    """Answers of motions over pulleys; margins are those of the tensions, in N."""

    def details(self, i: int) -> dict[str, Any]:
        """Details that do not rest on cables from points; see `Answers.details`."""
        details = {name: value for name, value in super().details(i).items() if name not in FROM_POINTS}
        return details | {"margin_unit": "N"}


class _Judge(NamedTuple):
    # Robot with its pulleys, and the bodies that can meet.
    problem: Problem
    scene: Scene

    @property
    def has_pulleys(self) -> bool:
        return self.problem.robot.pulleys is not None

    def proof(self, motion: Any) -> MotionProof:
        prove = proof_of if hasattr(motion, "bounds") else sampled_proof
        return prove(self.problem, motion, self.scene, contacts_alone=not self.has_pulleys)

    def is_refuted(self, motion: Motion) -> bool:
        # A few samples may refute it.
        proof = sampled_proof(self.problem, motion, self.scene, FEW, contacts_alone=not self.has_pulleys)
        return bool(proof.broken.any())


class JudgedLeg(Leg):
    """Leg of a family, its motions judged with surroundings and pulleys; see `Leg`."""

    def __init__(self, leg: Leg) -> None:
        """Keep the leg of the family."""
        super().__init__(leg.stops)
        self._leg = leg

    def check(self, problem: Problem) -> None:
        """Refuse surroundings where they are not those of the robot that moves, or not certain; see `Leg.check`."""
        keys, path = self.stops.keys, self.stops.path
        for key in keys.surroundings[:1]:
            if problem.limits.uncertainty is not None:
                raise ConfigError(path, f"{key}: must be absent with an uncertainty: contacts are not proved for it")
            if self.stops.robot_file.pairs is not None:
                why = "here a point mass on three cables moves in place of the platform, and touches other bodies"
                raise ConfigError(path, f'{key}: must be absent but with family = "spline": {why}')
        self._leg.check(_from_points(problem))

    def answers(self, problem: Problem, depths: np.ndarray) -> Answers:
        """Answers of the family, which knows neither surroundings nor pulleys; see `Leg.answers`."""
        return self._leg.answers(_from_points(problem), depths)

    def warnings(self, problem: Problem) -> list[str]:
        """Warnings of the family; see `Leg.warnings`."""
        return self._leg.warnings(_from_points(problem))

    def outcome(self, problem: Problem, joined: JoinedLeg, tension_min: np.ndarray, start: float) -> LegOutcome | None:
        """Outcome by the family's answers; see `Leg.outcome`."""
        plain = joined.answers.plain if isinstance(joined.answers, JudgedAnswers) else joined.answers
        return self._leg.outcome(problem, dataclasses.replace(joined, answers=plain), tension_min, start)

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses by motions that are proved, if there are such; see `Leg.join`."""
        stops = self.stops
        scene = scene_of(problem.robot, stops.robot_file, stops.frame, stops.keys, stops.path)
        judge, plain = _Judge(problem, scene), _from_points(problem)
        robot, arcs = problem.robot, self.stops.arcs
        doubtful, none = np.zeros(len(self), bool), np.zeros(len(self), bool)
        if self._leg.step and robot.n_cables == robot.dof and not stops.robot_file.is_platform:
            arcs, doubtful, none = self._searched(judge, plain, z0)
        answers, motions = self._with(arcs).join(plain, z0)
        is_judged = np.isfinite(answers.duration) & (judge.has_pulleys | answers.feasible)
        proofs = tuple(judge.proof(motion) if known else None for motion, known in zip(motions, is_judged, strict=True))
        verdict = np.array(answers.verdict, FLAGS)
        for i, proof in enumerate(proofs):
            if proof is None:
                continue
            if proof.verdict:
                flags = proof.verdict | (Verdict.NO_ARCS if none[i] else Verdict.FEASIBLE)
                verdict[i] = (Verdict.UNDECIDED if none[i] and doubtful[i] else flags).value
            else:
                # The family has refuted smaller numbers for cables from points.
                is_free = judge.has_pulleys and arcs[i] == 0 and answers.tried_arcs[i] > max(self._leg.step, 1)
                before = Verdict(int(verdict[i])) & Verdict.FEWER_ARCS_UNDECIDED
                verdict[i] = Verdict.FEWER_ARCS_UNDECIDED if doubtful[i] or is_free else before
        return _judged(answers, verdict, proofs, has_pulleys=judge.has_pulleys), motions

    def _with(self, arcs: np.ndarray) -> Leg:
        leg = copy.copy(self._leg)
        leg.stops = dataclasses.replace(self.stops, fixed=arcs)
        return leg

    def _searched(self, judge: _Judge, plain: Problem, z0: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        # Find numbers of arcs (0: the family's choice) whose motions are proved; tell where smaller ones, or all, stay
        # undecided, and where there are none.
        prescribed, step = self.stops.arcs, self._leg.step
        # Over pulleys the family's choice says nothing.
        arcs = np.where(prescribed > 0, prescribed, step if judge.has_pulleys else 0)
        is_open, doubtful, none = prescribed == 0, np.zeros(len(self), bool), np.zeros(len(self), bool)
        while is_open.any():
            answers, motions = self._with(arcs).join(plain, z0)
            for i in np.flatnonzero(is_open).tolist():
                tried, verdict = int(answers.tried_arcs[i]), Verdict.FEASIBLE
                doubtful[i] |= bool(answers.verdict[i] & (Verdict.UNDECIDED | Verdict.FEWER_ARCS_UNDECIDED).value)
                if not judge.has_pulleys and not answers.feasible[i]:
                    is_open[i] = arcs[i] > 0  # of a free number the family says itself that there is none
                elif not np.isfinite(answers.duration[i]) or judge.is_refuted(motions[i]):
                    pass
                else:
                    verdict = judge.proof(motions[i]).verdict
                    is_open[i] = bool(verdict)
                    doubtful[i] |= verdict == Verdict.UNDECIDED
                    arcs[i] = arcs[i] if verdict else tried
                if is_open[i]:
                    none[i] = tried + step > self.stops.max_arcs
                    is_open[i], arcs[i] = not none[i], 0 if none[i] else tried + step
        return arcs, doubtful, none


def judged(leg: Leg, *, surroundings: bool, pulleys: bool) -> Leg:
    """A leg whose verdicts take surroundings and pulleys into account.

    Args:
        surroundings: whether there are any.
        pulleys: likewise.

    Returns:
        the leg itself where its family knows them.
    """
    row = FAMILIES[leg.stops.family]
    is_known = (row.knows_obstacles or not surroundings) and (row.knows_pulleys or not pulleys)
    return leg if is_known else JudgedLeg(leg)


def _from_points(problem: Problem) -> Problem:
    if problem.robot.pulleys is None:
        return problem
    return problem._replace(robot=dataclasses.replace(problem.robot, pulleys=None))


def _judged(
    answers: Answers, verdict: np.ndarray, proofs: tuple[MotionProof | None, ...], *, has_pulleys: bool
) -> JudgedAnswers:
    is_feasible = (verdict & ~np.array(Verdict.FEWER_ARCS_UNDECIDED.value, FLAGS)) == 0
    plain = dataclasses.replace(answers, verdict=verdict, arcs=np.where(is_feasible, answers.tried_arcs, 0))
    columns = {field.name: getattr(plain, field.name) for field in dataclasses.fields(Answers)}
    if not has_pulleys:
        return JudgedAnswers(**columns, plain=plain, proofs=proofs)
    nothing = np.full(len(verdict), np.nan)
    columns |= dict.fromkeys(("margin", "margin_bound", "limit_margin", "feasible_at_infinity"), nothing)
    for name, side, others in (("margin", "high", 0), ("margin_bound", "low", 0), ("limit_margin", "high", 1)):
        columns[name] = np.array(
            [
                np.nan if proof is None else proof.least(getattr(proof.proof, side), TENSIONS, others=bool(others))
                for proof in proofs
            ]
        )
    return PulleyAnswers(**columns, plain=plain, proofs=proofs)
