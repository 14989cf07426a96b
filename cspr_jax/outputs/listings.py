"""Lists of the catalogue's robots and of the quantities of results, as plain values and as tables for people."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cspr_jax.config import catalogue
from cspr_jax.config.catalogue import REST_ERRORS, catalogue_names, catalogue_specs
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.runtime.terminal import cell
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.quantities import AXES, FAILURES, FLIGHT, PATHS, QUANTITIES, SEGMENTS, TRAJECTORY

PLACEHOLDER = "placeholder"


def robots(names: Iterable[str | Path] = ()) -> list[dict[str, Any]]:
    """The robots of the catalogue, or those that are named."""
    from cspr_jax.config.robot import resolve_robot  # takes longer than the list for people

    listed = []
    for name in list(names) or catalogue_names():
        robot_file = resolve_robot(str(name), "robots", Path())
        is_known = robot_file.file is not None and robot_file.file.parent == catalogue.CATALOGUE
        if is_known:
            error = REST_ERRORS.get(robot_file.name)
        else:
            from cspr_jax.build.robots import error_at_rest  # imports jax

            error = error_at_rest(robot_file)
        listed.append(robot_file.model_dump(exclude_none=True) | {"fault": error})
    return listed


def catalogue_table():
    """The catalogue for a terminal, one line a robot."""
    rows = [
        (
            spec["name"],
            str(len(spec["base_points"])),
            _pattern(spec),
            f"{spec['mass']:g}",
            spec.get("z_axis", "down"),
            ", ".join(_remarks(spec)),
        )
        for spec in catalogue_specs()
    ]
    table = _table(("name", "cables", "moves", "kg", "z", "remarks"), rows, wraps=False)
    table.caption, table.caption_justify = "cspr robots NAME shows all about one", "left"
    return table


def _pattern(spec: dict[str, Any]) -> str:
    usual = "3R3T" if "platform_points" in spec else "2T" if spec.get("planar") else "3T"
    return str(spec.get("pattern", usual))


def _remarks(spec: dict[str, Any]) -> list[str]:
    remarks = [PLACEHOLDER] if spec.get("source", "").startswith(PLACEHOLDER) else []
    remarks += ["translates"] if spec.get("translation_only") else []
    return remarks + (["cannot hang taut"] if spec["name"] in REST_ERRORS else [])


def robot_details(robot: dict[str, Any]):
    """Details of a robot for a terminal."""
    pattern = _pattern(robot)
    shown = {"source": robot["source"], "moves": f"{pattern}, {_motion(pattern)}"}
    shown |= {"cables": str(len(robot["base_points"])), "mass (kg)": f"{robot['mass']:g}"}
    limits = {row.name: _written(robot[row.name]) for row in LIMITS if row.name in robot}
    left_out = {*shown, *limits, "name", "mass", "pattern", "planar", "fault"}
    shown |= {key: _written(value) for key, value in robot.items() if key not in left_out}
    shown |= limits | {"at rest": robot["fault"] or "hangs still with every cable taut"}
    return _table((robot["name"], ""), list(shown.items()))


def _motion(pattern: str) -> str:
    row = PATTERNS[pattern]
    return "a point mass in the plane y = 0" if pattern == "2T" else row.description.partition(",")[0]


def _written(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "\n".join(", ".join(f"{number:.6g}" for number in row) for row in value)
    if isinstance(value, list):
        return ", ".join(f"{number:.6g}" for number in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def quantities() -> list[dict[str, Any]]:
    """The quantities that a result or a motion can hold."""
    groups = {"axis": AXES, "map": QUANTITIES, "motion": TRAJECTORY, "segment": SEGMENTS}
    groups |= {"flight": FLIGHT, "failure": FAILURES, "path": PATHS}
    return [{"group": group, **dataclasses.asdict(q)} for group, table in groups.items() for q in table.values()]


def quantities_table(listed: list[dict[str, Any]]):
    """The quantities for a terminal."""
    heads = ("group", "name", "units", "description")
    return _table(heads, [tuple(row[head] for head in heads) for row in listed])


def _table(heads: tuple[str, ...], rows: list[tuple], *, wraps: bool = True):
    from rich import box  # only a terminal needs it
    from rich.table import Table

    table = Table() if wraps else Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for head in heads:
        table.add_column(cell(head), no_wrap=not wraps)
    for row in rows:
        table.add_row(*(cell(*str(value).strip("\n").split("\n")) for value in row))
    return table
