"""Cells of maps whose motions keep clear of obstacles, as the plan of each cell says."""

import numpy as np

from cspr_jax.motion.problem import Problem
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.judged import Join, Judge


def clear_motions(
    problem: Problem, scene: Scene, join: Join, count: int, *, max_arcs: int, step: int = 1
) -> dict[str, np.ndarray]:
    """Columns of a map among obstacles."""
    judge = Judge(problem, scene, intervals=False)
    answers, proofs, _ = judge.smallest(join, np.zeros(count, int), step=step, max_arcs=max_arcs)
    clearance = np.array([np.nan if proof is None else proof.proof.high.min() for proof in proofs])
    return vars(answers) | {"clearance": clearance}
