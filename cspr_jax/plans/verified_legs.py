"""Legs of families that ignore obstacles, pulleys and limits of winches: each motion, once made, is proved with these.

See `verification.verifier`. Where the number of arcs is free, the smallest number with a proof is taken: for point
masses (over pulleys, only with as many cables as degrees of freedom), and for platforms without pulleys in legs of one
segment. All other motions keep the number of arcs that their family chooses.
"""

import copy
import dataclasses
from typing import Any

import numpy as np

from cspr_jax.build.scenes import scene_of_leg
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import JoinedLeg, Leg, LegResult
from cspr_jax.motion.motion import Motion
from cspr_jax.motion.problem import Problem
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.criteria import CriterionParts
from cspr_jax.verification.proved_answers import MotionProof, margins_of, proof_of
from cspr_jax.verification.verifier import Verifier, of_family

LIMITS_ALONE = CriterionParts(contacts=False)
CABLE, MOTOR = Verdict.CABLE_TOO_FAST, Verdict.MOTOR_TOO_FAST


class VerifiedLeg(Leg):
    """Leg of a family whose motions are proved with obstacles, pulleys and limits of winches; see `Leg`."""

    def __init__(self, leg: Leg) -> None:
        """Wrap the leg of a family."""
        super().__init__(leg.waypoints)
        self._leg = leg

    def check(self, problem: Problem) -> None:
        """Let the family check the problem; see `Leg.check`."""
        self._leg.check(self._plain(problem))

    def answers(self, problem: Problem, depths: np.ndarray) -> Answers:
        """Answers of the family, which ignores obstacles, pulleys and winches; see `Leg.answers`."""
        return self._leg.answers(self._plain(problem), depths)

    def warnings(self, problem: Problem) -> list[str]:
        """Warnings of the family; see `Leg.warnings`."""
        return self._leg.warnings(self._plain(problem))

    def result(self, problem: Problem, joined: JoinedLeg, tension_min: np.ndarray, start: float) -> LegResult | None:
        """Result from the family's answers; see `Leg.result`."""
        return self._leg.result(problem, joined, tension_min, start)

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses by proved motions where there are any; see `Leg.join`."""
        waypoints, plain, prescribed = self.waypoints, self._plain(problem), self.waypoints.arcs
        has_scene = bool(waypoints.plan_file.obstacle_keys) or problem.robot.pulleys is not None
        scene, is_plan = (
            scene_of_leg(problem.robot, waypoints) if has_scene else None,
            len(waypoints.plan_file.pose) == 2,
        )
        verifier = Verifier(problem, scene, are_plans=is_plan)
        robot, joined = problem.robot, dict[bytes, tuple[Answers, list[Motion]]]()

        def join(rows: np.ndarray, arcs: np.ndarray) -> tuple[Answers, list[Motion]]:
            full = prescribed.copy()
            full[rows] = arcs
            key = full.tobytes()
            if key not in joined:
                joined[key] = self._with(full).join(plain, z0)
            answers, motions = joined[key]
            return answers.rows(rows), [motions[i] for i in rows]

        is_determined, has_pulleys = robot.n_cables == robot.dof, verifier.has_pulleys
        is_searched = is_determined or not has_pulleys
        if waypoints.robot_file.is_platform:  # its motion in a segment depends on the segments before and after
            is_searched = not has_pulleys and len(self) == 1
        maximum = waypoints.max_arcs if is_searched else 0
        verified = verifier.smallest(join, prescribed, step=self._leg.step, max_arcs=maximum)
        motions = join(np.arange(len(self)), verified.arcs)[1]
        proofs = verified.proofs
        if not (verifier.parts.usual or verifier.parts.contacts):  # nobody asks for the proofs of limits that are kept
            proofs = [proof if proof is not None and proof.verdict else None for proof in proofs]
        answers = self._with_motors(problem, verified.answers, motions)
        return _answers(answers, proofs, has_pulleys=has_pulleys), motions

    def _with_motors(self, problem: Problem, answers: Answers, motions: list[Motion]) -> Answers:
        # A family that takes speeds of motors for those of cables blames cables: ask the proof of any motion.
        is_fast = (answers.verdict & CABLE.value) != 0
        if problem.limits.motor_speed_max is None or not (self._leg.knows_motor_speeds and is_fast.any()):
            return answers
        verdict = np.array(answers.verdict, FLAGS)
        for i in np.flatnonzero(is_fast).tolist():
            proved = proof_of(problem, motions[i], parts=LIMITS_ALONE, intervals=False).verdict & (CABLE | MOTOR)
            verdict[i] = (verdict[i] & ~FLAGS(CABLE.value)) | FLAGS((proved or Verdict.UNDECIDED).value)
        return dataclasses.replace(answers, verdict=verdict)

    def _plain(self, problem: Problem) -> Problem:
        return of_family(problem, motor_speeds=self._leg.knows_motor_speeds)

    def _with(self, arcs: np.ndarray) -> Leg:
        leg = copy.copy(self._leg)
        leg.waypoints = dataclasses.replace(self.waypoints, fixed=arcs)
        return leg


def verified(leg: Leg, *, obstacles: bool, pulleys: bool, motors: bool) -> Leg:
    """A leg whose verdicts take obstacles, pulleys and limits of winches into account."""
    is_needed = FAMILIES[leg.waypoints.family].proof != "any" and (obstacles or pulleys or motors)
    return VerifiedLeg(leg) if is_needed else leg


def _answers(plain: Answers, proofs: list[MotionProof | None], *, has_pulleys: bool) -> Answers:
    # Over pulleys, take the margins from the proofs; motions that the family refuses have none.
    each = np.empty(len(proofs), object)
    each[:] = proofs
    if not has_pulleys:
        return dataclasses.replace(plain, proof=each)
    is_proved = np.array([proof is not None for proof in proofs])
    columns: dict[str, Any] = {"feasible_at_infinity": np.full(len(proofs), np.nan)}
    for name, column in margins_of(each[is_proved].tolist()).items():
        columns[name] = np.full(len(proofs), np.nan)
        columns[name][is_proved] = column
    return dataclasses.replace(plain, proof=each, margin_unit="N", **columns)
