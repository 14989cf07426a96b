"""Constants of a picture of a map: the start of the motions, and coordinates on axes that are not shown."""

import numpy as np

from cspr_jax.outputs.plots.style.fitting import shortened
from cspr_jax.outputs.plots.style.labels import unit, value, values
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.store.reading.result import Result


def table(settings: object, key: str) -> dict:
    """A table of a sweep's settings."""
    inner = settings.get(key) if isinstance(settings, dict) else None
    return inner if isinstance(inner, dict) else {}


def start(result: Result) -> dict[str, float]:
    """Start of all segments of a map, if it is the same position for all."""
    coordinates = table(table(result.settings, "trajectory"), "from").get("position") or ()
    moving = any(axis.startswith("from_") for axis in (*result.axes, *result.choices))
    return {} if moving else dict(zip("xyz", coordinates, strict=False))


def starts_at_rest(result: Result, name: str) -> bool:
    """Tell whether a quantity belongs to motions that start at rest."""
    kind = MAP_KINDS[result.attributes["map"]]
    if name in kind.motionless:
        return False
    return kind.start == "rest" or bool(table(table(result.settings, "trajectory"), "from").get("rest"))


def notes(result: Result, name: str, fixed: list[str], used: list[str]) -> list[str]:
    """Constants of a picture of a map, in words."""
    origin = start(result)
    phrases = []
    if origin:
        phrases.append(f"from ({', '.join(f'{number:.4g}' for number in origin.values())}) m")
    elif name and starts_at_rest(result, name):
        phrases.append("from rest")
    phrases += fixed
    phrases += [_best(result, axis) for axis in result.choices]
    phrases += [value(result, a, p[0]) for a, p in result.axes.items() if a not in used and len(p) == 1]
    if "z" in result.axes or "z" in result.choices:
        phrases.append(f"z axis {shortened(str(result.attributes.get('z_axis', 'down')))}")
    return list(dict.fromkeys(phrases))


def _best(result: Result, axis: str) -> str:
    # Words such as "best z0 of 5 (1.2 to 2.4 m)".
    points = np.unique(result.choices[axis].points)
    name, _, low = values(result, axis, points[:1])[0].partition(" = ")
    high = values(result, axis, points[-1:])[0].partition(" = ")[2]
    span = low if low == high else f"{low.removesuffix(unit(result, axis)).rstrip()} to {high}"
    return f"best {name} of {len(points)} ({span})"


def first_of(result: Result, axis: str) -> str:
    """A coordinate that the picture shows by default."""
    points = result.axes[axis]
    words = value(result, axis, points[0])
    return words if len(points) == 1 else f"{words} (the first of {len(points)})"
