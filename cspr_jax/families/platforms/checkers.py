"""The checker of motions of a platform, chosen by its number of cables."""

from cspr_jax.families.platforms.motion_checker import FEW, MotionChecker
from cspr_jax.families.platforms.redundant.redundant_checker import RedundantChecker
from cspr_jax.families.platforms.six_cable_proof.checker import PlatformChecker
from cspr_jax.motion.platform_kind import USUAL, PlatformMotionKind
from cspr_jax.motion.problem import Problem


def pose_checker(problem: Problem, kind: PlatformMotionKind = USUAL, *, batch: int = FEW) -> MotionChecker:
    """Checker of motions of a platform."""
    is_determined = problem.robot.n_cables == problem.robot.dof
    return (PlatformChecker if is_determined else RedundantChecker)(problem, kind, batch=batch)
