"""Proofs that requirements hold in full cells of a map, boxes half-way to the next points."""

from __future__ import annotations

import dataclasses

import numpy as np

from cspr_jax.synthesis.evaluations import Evaluator
from cspr_jax.synthesis.space import Point

INSIDE = 1


@dataclasses.dataclass(frozen=True)
class RequirementProof:
    """A requirement over the cells of a map.

    Fields:
        key: key of the requirement.
        name: its name, for people.
        cells: number of cells.
        proved: number of those in all of which it is proved to hold.
    """

    key: str
    name: str
    cells: int
    proved: int

    @property
    def is_whole(self) -> bool:
        """Tell whether it is proved in all cells."""
        return self.proved == self.cells


def proofs_of(evaluator: Evaluator, point: Point) -> tuple[RequirementProof, ...]:
    """Proofs of the requirements that ask for them, at the robot of a point."""
    proofs = []
    for question in evaluator.requirements:
        if question.prove:
            sides = question.measure.sides(point)
            proofs.append(RequirementProof(question.key, question.name, len(sides), int(np.sum(sides == INSIDE))))
    return tuple(proofs)
