"""Certificates of plans: one motion through all segments, with the proof of each."""

from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.build.scenes import scene_of
from cspr_jax.errors import ConfigError
from cspr_jax.motion.formulas import HasFormulas
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.verification.attained import attained
from cspr_jax.verification.certificates.certificate import certificate
from cspr_jax.verification.certificates.statement import NoCertificateError
from cspr_jax.verification.criteria import ALL
from cspr_jax.verification.proved_answers import MotionProof, proof_of


def plan_certificate(plan: PlannedMotions, path: Path) -> dict[str, Any]:
    """Certificate of a plan.

    Raises:
        ConfigError: nothing is proved, or the proof rests on what a certificate does not hold.
    """
    motions: list[Any] = [motion for leg in plan.legs for motion in leg.motions]
    if not motions or not all(isinstance(motion, HasFormulas) for motion in motions):
        raise ConfigError(path, "not written: the motion has no formulas that are held")
    if not all(float(motion.duration()) < float("inf") for motion in motions):
        raise ConfigError(path, "not written: a segment has no finite motion")
    robot = plan.problem.robot
    scene = scene_of(robot, plan.robot_file, plan.frame, plan.keys, path, trajectory=plan.keys)
    proofs_of_legs = [proof for leg in plan.legs for proof in leg.answers.proof]
    proofs = [_full(plan, motion, proof, scene) for motion, proof in zip(motions, proofs_of_legs, strict=True)]
    origin = np.asarray(plan.frame.origin).tolist()
    names = {"name": plan.robot_file.name, "note": f"z down; the origin lies at {origin} m of the robot file"}
    try:
        return certificate(plan.problem, [motion.formulas() for motion in motions], proofs, scene, plan.feeds, names)
    except NoCertificateError as error:
        raise ConfigError(path, f"not written: {error}") from error


def _full(plan: PlannedMotions, motion: Any, proof: MotionProof | None, scene: Any) -> MotionProof:
    # A proof of all criteria; families prove feasible motions by faster ways, which certificates do not hold.
    if proof is not None and proof.parts == ALL:
        return proof
    return attained(plan.problem, motion, proof_of(plan.problem, motion, scene), scene)
