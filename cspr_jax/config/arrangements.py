"""Arrangements of the cables of a robot as an axis of sweeps; without jax."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cspr_jax.config.missing_cables import PER_CABLE
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.arrangements import (
    MAX_CABLES_OF_ALL,
    MAX_CABLES_OF_NUMBERS,
    Symmetry,
    distinct_arrangements,
    numbers_of,
    symmetries_of,
)


class Invariants(NamedTuple):
    """Numbers beyond the robot file that a sweep leaves equal for all arrangements of the cables.

    Fields:
        points: spools and attachment points; not where they move.
        cables: limits of the cables; not where they differ by cable.
        directions: directions and orientations; not where a wrench, an orientation or an obstacle tells them apart.
    """

    points: bool = True
    cables: bool = True
    directions: bool = True


def arrangement_points(
    robot_file: RobotFile, arrangements: str | list[int] | list[list[int]], invariants: Invariants
) -> Float[np.ndarray, "n"]:
    """Numbers of the arrangements of an axis.

    Raises:
        InputError: too many cables for all arrangements, or a list that is no permutation of the cables.
    """
    count = len(robot_file.base_points)
    if robot_file.platform_points is None:
        raise InputError("arrangement", arrangements, "absent: all cables of a point mass end in it")
    if isinstance(arrangements, str):
        if count > MAX_CABLES_OF_ALL:
            allowed = f"a list, of robots on more than {MAX_CABLES_OF_ALL} cables"
            raise InputError("arrangement", arrangements, allowed)
        return distinct_arrangements(count, _symmetries(robot_file, invariants)).astype(float)
    if not isinstance(arrangements[0], list):
        return np.array(arrangements, float)
    if count > MAX_CABLES_OF_NUMBERS:
        allowed = f"must be of at most {MAX_CABLES_OF_NUMBERS}, since others have no exact numbers"
        raise InputError("arrangement", None, allowed, problem=f"permutations of {count} cables")
    for each in arrangements:
        if sorted(each) != list(range(count)):
            raise InputError("arrangement", each, f"the numbers 0 to {count - 1}, each once")
    return numbers_of(np.array(arrangements)).astype(float)


def _symmetries(robot_file: RobotFile, invariants: Invariants) -> list[Symmetry]:
    # None where pulleys turn about axes of their own, of which mirrors would be others.
    if not invariants.points or robot_file.pulley_axes is not None or robot_file.platform_points is None:
        return []
    spec = robot_file.model_dump(exclude_none=True, include={*PER_CABLE, "winch"})
    tables = [spec, spec.get("winch", {})]
    lists = [
        value
        for table in tables
        for name, value in table.items()
        if isinstance(value, list) and name not in ("base_points", "platform_points")
    ]
    groups: list[Any] = list(zip(*lists, strict=True)) if lists else [()] * len(robot_file.base_points)
    return symmetries_of(
        np.array(robot_file.base_points),
        np.array(robot_file.platform_points),
        np.array(robot_file.centre_of_mass or [0.0, 0.0, 0.0]),
        np.array(robot_file.inertia),
        groups if invariants.cables else list(range(len(groups))),
        is_planar=robot_file.is_planar,
        has_turns=invariants.directions,
    )
