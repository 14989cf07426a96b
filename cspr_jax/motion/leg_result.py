"""Outcome of a leg beyond its motion, such as the flight of a released object."""

import abc
from typing import Any, ClassVar

import numpy as np


class LegResult(abc.ABC):
    """Outcome of a leg beyond its motion, in the axes of the robot file; computed once, with the plan.

    Fields:
        key: name of the outcome in a plan's JSON.
    """

    key: ClassVar[str]

    @abc.abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The outcome as a plan's JSON has it."""

    @abc.abstractmethod
    def lines(self) -> list[str]:
        """The outcome as text."""

    @abc.abstractmethod
    def columns(self) -> dict[str, np.ndarray]:
        """Datasets that the outcome adds to a motion file."""
