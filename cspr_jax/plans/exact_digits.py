"""Plans whose causes, demands and margins are as exact as a number of digits asks for."""

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.formulas import HasFormulas
from cspr_jax.motion.leg import JoinedLeg
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.proved_answers import margins_of


def with_digits(plan: PlannedMotions, digits: int, scene: Scene | None) -> PlannedMotions:
    """A plan of one motion whose numbers have a number of digits.

    Raises:
        InputError: a motion without formulas, such as a function.
    """
    from cspr_jax.verification.exact.extremes import exact_peaks, with_extremes

    leg = plan.legs[0]
    if not leg.motions or not all(isinstance(motion, HasFormulas) for motion in leg.motions):
        raise InputError("digits", digits, "absent: the motion has no formulas that are held")
    proofs = np.empty(len(leg.motions), object)
    proofs[:] = [
        with_extremes(plan.problem, motion, proof, scene, digits)
        for motion, proof in zip(leg.motions, leg.answers.proof, strict=True)
    ]
    margins: dict[str, Any] = margins_of(proofs.tolist())
    answers: Answers = dataclasses.replace(leg.answers, proof=proofs, **margins)
    extremes = exact_peaks(plan.problem, leg.motions, plan.demands, digits)
    causes = tuple(
        tuple(dataclasses.replace(cause, digits=digits) for cause in answers.causes_of(i, plan.frame))
        for i in range(len(leg.motions))
    )
    legs = (JoinedLeg(leg.family, answers, leg.motions),)
    return dataclasses.replace(plan, legs=legs, demands=extremes, causes=causes, digits=digits)
