"""Templates of robot, sweep and plan files: values of an example, and all other keys as comments.

Keys, their order, defaults and meanings come from the schema, so that no template is out of date.
"""

import textwrap
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic.fields import FieldInfo

from cspr_jax.config import catalogue
from cspr_jax.config.formats.writing import value_text
from cspr_jax.config.keys.obstacles import ObstacleKeys
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.reading import Table
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.errors import InputError, RefusedError, StoreError, printable
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs.example_files import folder
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import make_folders

# Keys that are tables of their own; one of them is an array of tables.
TABLES = ("axes", "trajectory", "orientations", "launch", "ellipse", "workspace", "limits", "run", "winch", "pose")
MANY = "pose"
WIDTH = 100
# Every robot has these, whatever else its file holds.
FIRST = ("name", "base_points", "mass", "z_axis")
# Keys that only some families of a template take.
OWN = {"rule": ("s-curve",)}


def robot_template(like: str) -> str:
    """A robot file with the values of a robot of the catalogue."""
    if like not in catalogue.catalogue_names():
        raise InputError("--like", like, one_of(like, catalogue.catalogue_names()))
    values = tomllib.loads((catalogue.CATALOGUE / f"{like}.toml").read_text("utf-8"))
    values |= {"name": "my robot", "source": ""}
    head = "A robot; change what stands here, and take off the # of what you need."
    return f"# {head}\n" + _section("", RobotFile, values, frozenset())


def sweep_template(kind: str) -> str:
    """A sweep file of a kind of map, with the values of an example."""
    if kind not in MAP_KINDS:
        raise InputError("--map", kind, one_of(kind, MAP_KINDS))
    row = MAP_KINDS[kind]
    examples = _examples("map")
    alike = (name for name, other in MAP_KINDS.items() if name in examples and other.families == row.families)
    values = dict(examples[kind if kind in examples else next(alike)], map=kind)
    # Keys that only other kinds of maps have, which this kind refuses.
    special = (*ObstacleKeys.model_fields, *(key for other in MAP_KINDS.values() for key in other.keys))
    refused = frozenset(special) - frozenset(row.keys)
    for key in refused:
        table, _, name = key.partition(".")
        if not name:
            values.pop(table, None)
        elif isinstance(values.get(table), dict):
            values[table] = {inner: value for inner, value in values[table].items() if inner != name}
    head = f"{row.description[:1].upper()}{row.description[1:]}."
    return f"# {head}\n" + _section("", SweepFile, values, refused)


def plan_template(family: str) -> str:
    """A plan file of a trajectory family, with the values of an example."""
    if family not in FAMILIES:
        raise InputError("--family", family, one_of(family, FAMILIES))
    examples = _examples("family")
    alike = (name for name, other in FAMILIES.items() if name in examples and other.legs == FAMILIES[family].legs)
    values = dict(examples[family if family in examples else next(alike)], family=family)
    refused = frozenset(key for key, families in OWN.items() if family not in families)
    values = {key: value for key, value in values.items() if key not in refused}
    head = f"A plan: {FAMILIES[family].description}."
    return f"# {head}\n" + _section("", PlanFile, values, refused)


def write_new(path: Path, text: str) -> Path:
    """Write a template to a new file."""
    if path.suffix != ".toml":
        raise InputError("file", str(path), "a name that ends in .toml")
    make_folders(Disk(), path.parent)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise RefusedError(printable(f"{path}: is there already: remove it, or choose another name")) from error
    except OSError as error:
        raise StoreError(printable(f"{path}: {error.strerror}")) from error
    return path


def _examples(key: str) -> dict[str, dict[str, Any]]:
    # Example of each map or family: the shortest one.
    files = [tomllib.loads(path.read_text("utf-8")) for path in sorted(folder().glob("*.toml"))]
    kind = [values for values in files if key in values and ("pose" in values) == (key == "family")]
    examples: dict[str, dict[str, Any]] = {}
    for values in sorted(kind, key=lambda values: len(str(values))):
        examples.setdefault(values[key], values)
    return examples


def _section(at: str, model: type[Table], values: Mapping[str, Any], refused: frozenset[str]) -> str:
    # Plain keys come first: after the head of a table they would belong to the table.
    plain, tables = [], []
    for name in _ordered(model):
        field = model.model_fields[name]
        key = field.alias or name
        if (f"{at}.{key}" if at else key) in refused:
            continue
        if not at and key in TABLES and (inner := _model(field.annotation)) is not None:
            tables.append(_tables(key, field, inner, values.get(key), refused))
        else:
            plain.append(_key(key, field, values.get(key)))
    return "\n".join([*plain, *tables])


def _ordered(model: type[Table]) -> list[str]:
    first = [name for name in FIRST if name in model.model_fields] if model is RobotFile else []
    return [*first, *(name for name in model.model_fields if name not in first)]


def _tables(key: str, field: FieldInfo, model: type[Table], value: Any, refused: frozenset[str]) -> str:
    if key == MANY:
        each = value or [{}]
        first = f"\n[[{key}]]\n{_section(key, model, each[0], refused)}"
        rest = [f"\n[[{key}]]\n" + "".join(f"{k} = {value_text(v)}\n" for k, v in entry.items()) for entry in each[1:]]
        return first + "".join(rest)
    head = f"[{key}]" if value else f"# [{key}]"
    return f"\n{head}  # {_default(field)}\n{_section(key, model, value or {}, refused)}"


def _key(key: str, field: FieldInfo, value: Any) -> str:
    comment = textwrap.fill(
        field.description or "", WIDTH, initial_indent="# ", subsequent_indent="# ", break_long_words=False
    )
    if value is not None:
        return f"{comment}\n{key} = {value_text(value)}\n"
    shown = value_text(field.default) if _has_default(field) else "..."
    return f"{comment}\n# {key} = {shown}\n"


def _has_default(field: FieldInfo) -> bool:
    return not field.is_required() and isinstance(field.default, str | bool | int | float | list)


def _default(field: FieldInfo) -> str:
    return "required" if field.is_required() else "may be absent"


def _model(annotation: Any) -> type[Table] | None:
    # Table that a key holds, as its type or among the types of a union.
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation
    return next((table for choice in get_args(annotation) if (table := _model(choice)) is not None), None)
