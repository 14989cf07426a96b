"""Robot, plan or sweep: the kind of a file, so that a file of another kind is refused as a whole."""

from typing import Any

from cspr_jax.errors import ConfigError

# Keys that only one kind has, and where it belongs.
_MARKS = {
    "sweep": ("map", "axes", "trajectory", "run", "orientations"),
    "plan": ("pose",),
    "robot": ("base_points", "platform_points", "mass", "inertia"),
}
_EXPECTED = {
    "sweep": "a sweep file, with map, [axes] and [trajectory]",
    "plan": "a plan file, with [[pose]] tables",
    "robot": "a robot file, with base_points and mass",
}
_PLACES = {
    "sweep": "a sweep is computed by `cspr run`",
    "plan": "a plan is computed by `cspr plan`",
    "robot": 'a robot file is named in a plan or sweep, robot = "FILE.toml"',
}


def refuse_other_kinds(data: dict[str, Any], expected: str, file: object) -> None:
    """Refuse a file of another kind, rather than every key of it."""
    if any(key in data for key in _MARKS[expected]):
        return
    for kind, marks in _MARKS.items():
        # The trajectory of a plan is a name, that of a sweep a table.
        theirs = [key for key in marks if key in data and not (key == "trajectory" and isinstance(data[key], str))]
        if theirs:
            keys = ", ".join(theirs)
            raise ConfigError(file, f"is a {kind} file (it has {keys}): must be {_EXPECTED[expected]}; {_PLACES[kind]}")
