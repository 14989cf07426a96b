"""Results of a design: robots with their numbers, proofs and sensitivities."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from cspr_jax.config.design import DesignFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.numerics.shapes import Float
from cspr_jax.synthesis.evaluations import Evaluation, Evaluator
from cspr_jax.synthesis.proofs import RequirementProof
from cspr_jax.synthesis.questions import Question
from cspr_jax.synthesis.sensitivities import DesignSensitivities


@dataclasses.dataclass(frozen=True)
class DesignedRobot:
    """A robot that a design found.

    Fields:
        name: name of its file, without the ending.
        robot_file: the robot.
        parameters: values of the parameters, by name.
        arrangement: number of the arrangement of its cables.
        values: (q,) numbers of the objectives, then of the requirements.
        missed: by how much it misses the requirements, each as a fraction of its bound; 0: it meets all.
        proofs: proofs of requirements in full cells.
        sensitivities: derivatives, and what holds the parameters.
        problem: why it has no numbers; empty where it has.
    """

    name: str
    robot_file: RobotFile
    parameters: dict[str, float]
    arrangement: int
    values: tuple[float, ...]
    missed: float
    proofs: tuple[RequirementProof, ...]
    sensitivities: DesignSensitivities
    problem: str = ""

    @property
    def is_feasible(self) -> bool:
        """Tell whether it meets all requirements, with the proofs that are asked for."""
        return self.missed == 0.0 and all(proof.is_whole for proof in self.proofs)


@dataclasses.dataclass(frozen=True)
class Setting:
    """A setting of a robot for tasks in a row.

    Fields:
        name: name of its file, without the ending.
        tasks: the tasks.
        robot_file: the robot as it is set.
        parameters: values of all parameters, by name.
        value: number of the objective: of all tasks together, or of a task alone.
    """

    name: str
    tasks: tuple[str, ...]
    robot_file: RobotFile
    parameters: dict[str, float]
    value: float


@dataclasses.dataclass(frozen=True)
class DesignSearch:
    """The search of a design.

    Fields:
        file: path of the design file.
        design: its content.
        evaluator: robots, objectives, requirements, and the record of all evaluations.
        robots: the best robot, or those of the Pareto front, from the best by the first objective on.
        is_complete: whether the search came to its end.
        settings: settings of the best robot with as few changes as can be, where some parameters may differ from task
            to task.
        alone: the best setting for each task alone.
    """

    file: Path
    design: DesignFile
    evaluator: Evaluator
    robots: tuple[DesignedRobot, ...]
    is_complete: bool
    settings: tuple[Setting, ...] = ()
    alone: tuple[Setting, ...] = ()

    @property
    def best(self) -> DesignedRobot:
        """The best robot by the first objective."""
        return self.robots[0]

    @property
    def questions(self) -> tuple[Question, ...]:
        """Objectives, then requirements."""
        return self.evaluator.questions

    @property
    def evaluations(self) -> list[Evaluation]:
        """All evaluations, in their order."""
        return list(self.evaluator.record.values())

    def values_of(self, name: str) -> Float[np.ndarray, "n"]:
        """Values of a parameter in all evaluations."""
        i = self.evaluator.space.names.index(name)
        return np.array([one.point.values[i] for one in self.evaluations])
