"""Lists of what there is: the catalogue of robots, the quantities of results. Plain values, and tables for people."""

import dataclasses
from pathlib import Path
from typing import Any

from cspr_jax.config.robot import catalogue_names, resolve_robot
from cspr_jax.problem import fault_at_rest
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.motion_quantities import FLIGHT, SEGMENTS, TRAJECTORY
from cspr_jax.schema.quantities import AXES, QUANTITIES


def robots() -> list[dict[str, Any]]:
    """The robots of the catalogue.

    Returns:
        the keys of each one's file, and why it cannot hang still, if it cannot.
    """
    specs = [resolve_robot(name, "catalogue", Path()) for name in catalogue_names()]
    return [spec.model_dump(exclude_none=True) | {"fault": fault_at_rest(spec)} for spec in specs]


def robots_table(listed: list[dict[str, Any]]):
    """The robots for a terminal.

    Args:
        listed: as `robots.point_mass` gives them.

    Returns:
        a rich table.
    """
    rows = [
        (
            robot["name"],
            str(len(robot["base_points"])),
            f"{robot['mass']:g}",
            robot["z_axis"],
            ", ".join(row.name for row in LIMITS if row.name in robot),
            robot["source"],
            robot["fault"] or "taut",
        )
        for robot in listed
    ]
    return _table(("name", "cables", "mass (kg)", "z axis", "limits", "source", "at rest"), rows)


def quantities() -> list[dict[str, Any]]:
    """The quantities that a result or a motion can hold.

    Returns:
        group, name, units and description of each.
    """
    groups = {"axis": AXES, "map": QUANTITIES, "motion": TRAJECTORY, "segment": SEGMENTS, "flight": FLIGHT}
    return [{"group": group, **dataclasses.asdict(q)} for group, table in groups.items() for q in table.values()]


def quantities_table(listed: list[dict[str, Any]]):
    """The quantities for a terminal.

    Args:
        listed: as `schema.quantities` gives them.

    Returns:
        a rich table.
    """
    heads = ("group", "name", "units", "description")
    return _table(heads, [tuple(row[head] for head in heads) for row in listed])


def _table(heads: tuple[str, ...], rows: list[tuple]):
    from rich.table import Table  # only a terminal needs it

    table = Table(*heads)
    for row in rows:
        table.add_row(*row)
    return table
