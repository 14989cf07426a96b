"""Words for which integers of some quantities stand, as functions of the settings of a sweep."""

import itertools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.quantities import Quantity


def _numbers_of_cables(settings: Mapping[str, Any]) -> list[int]:
    # Numbers from 1 on, as in the file of the robot, of the cables that move it.
    robot, without = settings["robot"], settings.get("without")
    if robot.get("translation_only"):  # three cables of the equivalent, whichever are gone
        return [1, 2, 3]
    count = len(robot["base_points"])
    gone = without if isinstance(without, list) else []
    return [k + 1 for k in range(count) if k not in gone]


def line_bounds(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of bounds of the acceleration along a line, from 1 on, as in `families.lines.durations.names_of`."""
    robot, limits = settings["robot"], settings.get("limits") or {}
    chosen = itertools.combinations(_numbers_of_cables(settings), 1 if robot.get("planar") else 2)
    limit_values = {row.name: limits.get(row.name, robot.get(row.name)) for row in LIMITS if row.of_motion}
    # A smallest tension of zero is no further limit, since cables must be taut anyway.
    moving = [name for name, value in limit_values.items() if value is not None and np.any(value)]
    return ("none", *("cables " + ", ".join(map(str, row)) for row in chosen), "max_acceleration", *moving)


def slack_cables(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Cables that get slack first on an ellipse."""
    robot, numbers = settings["robot"], _numbers_of_cables(settings)
    dof = 2 if robot.get("planar") or robot.get("pattern") == "2T" else 3
    if len(numbers) == dof:
        cables = [f"cable {number}" for number in numbers]
    else:
        pairs = itertools.combinations(numbers, dof - 1)
        cables = [f"all but {', '.join(map(str, pair))}" for pair in pairs]
    return ("unknown", *cables, "depth")


CELL_SIDES = ("not decided", "inside", "outside")


def cell_sides(_: Mapping[str, Any]) -> tuple[str, ...]:
    """Sides of a workspace on which a full cell is proved to lie."""
    return CELL_SIDES


OPEN_CONDITIONS = (
    *("decided", "boundary", "tensions", "closure", "clearances"),
    *("floor", "cable lengths", "cable speeds", "outside"),
)


def open_conditions(_: Mapping[str, Any]) -> tuple[str, ...]:
    """Reasons why a cell is not proved: the boundary, or a condition without a proof."""
    return OPEN_CONDITIONS


NEAREST_BODIES = ("none", "two cables", "cable and obstacle", "cable and platform", "platform and obstacle")


def nearest_bodies(_: Mapping[str, Any]) -> tuple[str, ...]:
    """Kinds of the two nearest bodies, in the order of `robots.contacts.clearance.Kind` from 1 on."""
    return NEAREST_BODIES


# Largest number of words: nobody reads more, and HDF5 could not store them as an attribute of a dataset.
LARGEST_COUNT = 1000
# Functions, by the name in a quantity's row, from the settings of a sweep to words for 0, 1, 2, ...
MEANINGS: dict[str, Callable[[Mapping[str, Any]], tuple[str, ...]]] = {
    "line-bounds": line_bounds,
    "slack-cables": slack_cables,
    "cell-sides": cell_sides,
    "open-conditions": open_conditions,
    "nearest-bodies": nearest_bodies,
}


def meanings_of(quantity: Quantity, settings: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Meanings of a quantity's numbers."""
    if not quantity.meanings or not settings:
        return ()
    words = MEANINGS[quantity.meanings](settings)
    return words if len(words) <= LARGEST_COUNT else ()


def value_attributes(quantity: Quantity, settings: Mapping[str, Any] | None) -> dict[str, Any]:
    """The CF attributes that explain a quantity's numbers."""
    words = meanings_of(quantity, settings)
    if not words:
        return {}
    # Words of CF consist of letters, digits and underscores, and are separated by spaces.
    meanings = " ".join(word.replace(", ", "_").replace(" ", "_") for word in words)
    return {"flag_values": np.arange(len(words), dtype=quantity.kind), "flag_meanings": meanings}
