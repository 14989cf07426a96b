"""Robots without some of their cables: the robot that a file without these cables would give."""

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field

from cspr_jax.config.keys.limits import MAX_CABLES
from cspr_jax.config.reading import checked
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, shown
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.schema.limits import LIMITS

Index = Annotated[int, Field(ge=0, lt=MAX_CABLES)]
MissingCables = Annotated[list[Index], Field(min_length=1, max_length=MAX_CABLES)]
DESCRIPTION = "cables that are gone, from 0 on: the robot has all others; limits of each cable are still one per cable"
# Keys of robot files that may have one entry per cable; `winch` and `pulley_axes` are special.
PER_CABLE = (
    "base_points",
    "platform_points",
    "pulley_radius",
    "axial_stiffness",
    *(x.name for x in LIMITS if x.per_cable),
)
# Word of sweeps of workspaces: each single cable gone in turn.
ANY_ONE = "any-one"


def without_cables(robot_file: RobotFile, cables: Sequence[int] | str | None, file: object) -> RobotFile:
    """The robot without some of its cables, which are given as in a file; the robot itself where all are there."""
    if not cables or isinstance(cables, str):
        return robot_file
    missing, count = sorted(set(cables)), len(robot_file.base_points)
    text = f"without = {shown(list(cables))}"
    if len(missing) < len(cables) or missing[0] < 0 or missing[-1] >= count:
        allowed = f"cables of {robot_file.name}, from 0 to {count - 1}, each once"
        raise ConfigError(file, f"{text}: must be {allowed}")
    remaining = [i for i in range(count) if i not in missing]
    row = PATTERNS[robot_file.own_pattern]
    if len(remaining) < row.dof:
        raise ConfigError(
            file,
            f"{text}: {too_few(robot_file, len(remaining))}: must leave at least {row.dof} cables ({row.description})",
        )
    # Parameters move numbers of the full robot: they are set before cables go.
    spec = robot_file.model_dump(exclude_none=True, exclude={"parameter"})
    spec |= {name: [value[i] for i in remaining] for name, value in spec.items() if _is_per_cable(name, value)}
    if robot_file.winch is not None:
        spec["winch"] = robot_file.winch.of_cables(remaining).model_dump(exclude_none=True)
    try:
        return checked(RobotFile, spec, file).as_remaining(robot_file, remaining)
    except ConfigError as error:
        raise ConfigError(file, f"{text}: {str(error).removeprefix(f'{file}: ')}") from error


def too_few(robot_file: RobotFile, count: int) -> str:
    """Words for what the cables that are left can still hold."""
    row = PATTERNS[robot_file.own_pattern]
    words = f"{'1 cable is' if count == 1 else f'{count} cables are'} left for {row.dof} degrees of freedom"
    left = {
        ("3T", 2): "the mass swings in the vertical plane below the line of both spools, or about it",
        ("3T", 1): "the mass swings below one spool",
        ("2T", 1): "the mass swings below one spool",
    }
    free = row.dof - count
    others = f"it swings or turns in {free} {'direction' if free == 1 else 'directions'} that no cable controls"
    return f"{words}: {'it falls' if not count else left.get((row.name, count), others)}"


def _is_per_cable(name: str, value: Any) -> bool:
    if name == "pulley_axes":
        return isinstance(value[0], list)
    return name in PER_CABLE and isinstance(value, list)
