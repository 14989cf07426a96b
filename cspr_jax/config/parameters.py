"""Parameters of robots, plans and sweeps: numbers that move others by multiples of their change; without jax."""

import copy
import decimal
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any

import numpy as np
from pydantic.functional_validators import ModelWrapValidatorHandler

from cspr_jax.config.keys.parameter import ParameterTable
from cspr_jax.config.reading import Model, checked
from cspr_jax.config.wording import table_error
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.errors.suggestions import did_you_mean
from cspr_jax.robots.model.arrangements import arrangement_of
from cspr_jax.schema.quantities import ARRANGEMENT, PARAMETER

# Fraction of the bounds by which rounding may put a value beyond them.
ROUNDING = 1e-12
# Factors of points about their centroid and about the origin of the platform's axes; 1 in a file.
SCALES = {"scale": "base_points", "platform_scale": "platform_points"}
# Keys of plans and sweeps whose numbers do not move: robots have parameters of their own, and axes have points.
_FIXED = ("schema", "robot", "axes")
# Numbers move as people write and add them: 1.4 by 1.7 - 1.4 gives 1.7. Contradictions of infinities give NaN.
_EXACT = decimal.Context(prec=40, traps=[])
_PART = re.compile(r"[^.\[\]]+|\[[0-9]+\]")


def check_parameters(parameters: Sequence[ParameterTable], spec: Mapping[str, Any]) -> None:
    """Refuse parameters of one name, that move what is no number of the file, or that move themselves."""
    names = [parameter.name for parameter in parameters]
    for i, name in enumerate(names):
        if name in [*names[:i], ARRANGEMENT]:
            raise table_error(f"parameter[{i}].name", name, f"a name that no other parameter has, nor {ARRANGEMENT}")
    numbers = [*dict(numbers_in(spec)), *(key for key, points in SCALES.items() if spec.get(points) is not None)]
    targets = {*numbers, *(PARAMETER + name for name in names)}
    for i, parameter in enumerate(parameters):
        for target in parameter.moves:
            if target not in targets:
                hint = did_you_mean(target, sorted(targets))
                allowed = f"{hint}numbers of the file, such as {', '.join(numbers[:2])}, or parameter.NAME"
                raise table_error(f"parameter[{i}].moves", shown(target), allowed)
    for i, name in enumerate(names):
        if (cycle := _cycle(parameters, name)) is not None:
            text = " -> ".join(cycle)
            raise table_error(f"parameter[{i}].moves", text, "parameters that do not move themselves")


def check_names(
    of_file: Sequence[ParameterTable], of_robot: Sequence[ParameterTable], values: Mapping[str, float]
) -> None:
    """Refuse parameters of a plan or sweep that its robot has too, and values of those that neither has."""
    names = [table.name for table in of_robot]
    for i, table in enumerate(of_file):
        if table.name in names:
            raise InputError(f"parameter[{i}].name", table.name, "a name that no parameter of the robot has")
    for name in values:
        if name not in (ARRANGEMENT, *names):
            raise _unknown(name, values[name], [*(table.name for table in of_file), *names])


def check_bounds(parameters: Sequence[ParameterTable], spec: Mapping[str, Any], model: type[Model], kind: str) -> None:
    """Refuse parameters one of whose bounds alone moves the numbers of a file so that they are none of its kind."""
    for i, parameter in enumerate(parameters):
        for bound in ("lower", "upper"):
            value = getattr(parameter, bound)
            try:
                of_numbers(model, _moved(spec, _changes(parameters, {parameter.name: value}, kind)), kind)
            except (ConfigError, InputError) as error:
                allowed = f"a value that gives a {kind} ({error})"
                raise table_error(f"parameter[{i}].{bound}", value, allowed) from error


def of_numbers(model: type[Model], spec: dict[str, Any], kind: str) -> Model:
    """A robot, plan or sweep of numbers that have moved; errors name its kind in place of a file."""
    try:
        return checked(model, spec, "")
    except ConfigError as error:
        raise ConfigError(kind, error.lines[0].removeprefix(": ")) from error


def at_values(model: type[Model], data: Any, handler: ModelWrapValidatorHandler[Model], kind: str) -> Model:
    """A plan or sweep, whose numbers are those at the values of its own parameters; `parameters` keeps the robot's."""
    written: Any = handler(data)
    if not isinstance(data, Mapping) or not written.parameter:
        return written
    tables, names = written.parameter, {table.name for table in written.parameter}
    values: dict[str, float] = {}
    others: dict[str, float] = {}
    for name, value in (written.parameters or {}).items():
        (values if name in names else others)[name] = value
    spec = {key: value for key, value in data.items() if key not in ("parameter", "parameters")}
    spec |= {"parameters": others} if others else {}
    check_parameters(tables, {key: value for key, value in spec.items() if key not in _FIXED})
    check_bounds(tables, spec, model, kind)
    try:
        there = moved(tables, spec, values, kind)
        if there is None:
            return written.model_copy(update={"parameters": others or None}) if values else written
        return of_numbers(model, there[0], kind).model_copy(update={"parameter": there[1]})
    except InputError as error:
        raise table_error(error.key, error.value, error.allowed) from error
    except ConfigError as error:
        raise table_error("parameters", values, f"values that give a {kind} ({error})") from error


def moved(
    parameters: Sequence[ParameterTable], spec: Mapping[str, Any], values: Mapping[str, float], kind: str = "robot"
) -> tuple[dict[str, Any], list[ParameterTable]] | None:
    """The numbers of a file at other values of its parameters, and its parameters there; None if nothing changes.

    Raises:
        InputError: no parameter has this name, a value is beyond its bounds, or a scale is not positive.
    """
    number = _arrangement(spec, values)
    changes = _changes(parameters, {name: value for name, value in values.items() if name != ARRANGEMENT}, kind)
    if not any(changes.values()) and not number:
        return None
    tables = [_moved_parameter(table, spec, changes) for table in parameters]
    return _arranged(_moved(spec, changes), tables, number) if number else (_moved(spec, changes), tables)


def _arrangement(spec: Mapping[str, Any], values: Mapping[str, float]) -> int:
    # Number of the arrangement among the values; 0 where there is none.
    number, points = values.get(ARRANGEMENT, 0.0), spec.get("platform_points")
    is_whole = float(number).is_integer()
    value = int(number) if is_whole else number
    if ARRANGEMENT in values and points is None:
        raise InputError(f"parameters.{ARRANGEMENT}", value, "absent: all cables of a point mass end in it")
    largest = math.factorial(len(points or ())) - 1
    if not is_whole or not 0 <= number <= largest:
        raise InputError(f"parameters.{ARRANGEMENT}", value, f"a whole number from 0 to {largest}")
    return int(number)


def _arranged(
    spec: dict[str, Any], tables: list[ParameterTable], number: int
) -> tuple[dict[str, Any], list[ParameterTable]]:
    # Attachment points in another order, with the parameters that move them.
    points = spec["platform_points"]
    arrangement = arrangement_of(number, len(points))
    cables = {f"platform_points[{old}]": f"platform_points[{new}]" for new, old in enumerate(arrangement)}

    def renamed(key: str) -> str:
        first = key.find("]") + 1
        return cables.get(key[:first], key[:first]) + key[first:]

    moved_tables = [
        table.model_copy(update={"moves": {renamed(key): multiple for key, multiple in table.moves.items()}})
        for table in tables
    ]
    return spec | {"platform_points": [points[old] for old in arrangement]}, moved_tables


def _changes(parameters: Sequence[ParameterTable], values: Mapping[str, float], kind: str) -> dict[str, Decimal]:
    # Changes of numbers of the file, and of values of parameters, by their keys.
    tables = {parameter.name: parameter for parameter in parameters}
    changes: dict[str, Decimal] = {}

    def move(key: str, change: Decimal) -> None:
        changes[key] = _EXACT.add(changes.get(key, Decimal(0)), change)
        if key.startswith(PARAMETER):
            for target, multiple in tables[key.removeprefix(PARAMETER)].moves.items():
                move(target, _EXACT.multiply(_decimal(multiple), change))

    for name, value in values.items():
        if name not in tables:
            raise _unknown(name, value, tables)
        move(PARAMETER + name, _EXACT.subtract(_decimal(value), _decimal(tables[name].value)))
    for name, table in tables.items():
        value = _value(table, changes)
        slack = ROUNDING * max(abs(table.lower), abs(table.upper))
        if not table.lower - slack <= value <= table.upper + slack:
            allowed = f"from {shown(table.lower)} to {shown(table.upper)}, as [[parameter]] of the {kind} file says"
            raise InputError(f"parameters.{name}", value, allowed)
    return changes


def _decimal(number: float) -> Decimal:
    # The shortest decimal number that is read as this one, as people write it.
    return Decimal(repr(float(number)))


def _value(table: ParameterTable, changes: Mapping[str, Decimal]) -> float:
    return float(_EXACT.add(_decimal(table.value), changes.get(PARAMETER + table.name, Decimal(0))))


def _unknown(name: str, value: float, names: Collection[str]) -> InputError:
    allowed = f"{did_you_mean(name, names)}one of {', '.join(names)}"
    absent = "absent: the robot file has no [[parameter]]"
    return InputError(f"parameters.{name}", value, allowed if names else absent)


def _moved(spec: Mapping[str, Any], changes: Mapping[str, Decimal]) -> dict[str, Any]:
    result = copy.deepcopy(dict(spec))
    for key, change in changes.items():
        if key.startswith(PARAMETER):
            continue
        if key in SCALES and not 1.0 + float(change) > 0.0:
            raise InputError(key, 1.0 + float(change), "a number > 0")
        for number, multiple in _numbers_of(key, spec):
            *parents, last = (_index(part) for part in _PART.findall(number))
            table: Any = result
            for part in parents:
                table = table[part]
            value = float(_EXACT.fma(_decimal(multiple), change, _decimal(table[last])))
            # Numbers of arcs, samples and the like stay whole numbers where they move to one.
            table[last] = int(value) if isinstance(table[last], int) and value.is_integer() else value
    return result


def _moved_parameter(
    parameter: ParameterTable, spec: Mapping[str, Any], changes: Mapping[str, Decimal]
) -> ParameterTable:
    # Numbers still move by the same multiples, so that scales, which depend on where points are, become numbers.
    moves: dict[str, float] = {}
    for key, multiple in parameter.moves.items():
        for number, factor in _numbers_of(key, spec):
            moves[number] = moves.get(number, 0.0) + factor * multiple
    inside = min(max(_value(parameter, changes), parameter.lower), parameter.upper)
    return parameter.model_copy(update={"value": inside, "moves": moves})


def _numbers_of(target: str, spec: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    # Numbers that a target stands for, with factors: a scale moves points away from their center.
    if target not in SCALES:
        yield target, 1.0
        return
    points = np.asarray(spec[SCALES[target]], float)
    arms = points - points.mean(0) if target == "scale" else points
    for (i, j), arm in np.ndenumerate(arms):
        if arm != 0.0:
            yield f"{SCALES[target]}[{i}][{j}]", float(arm)


def with_values(spec: dict[str, Any], values: Mapping[str, float] | None) -> dict[str, Any]:
    """A parsed plan or sweep with more values of parameters, which replace its own."""
    if not values:
        return spec
    earlier = spec.get("parameters", {})
    return spec | {"parameters": {**(earlier if isinstance(earlier, Mapping) else {}), **values}}


def numbers_in(value: Any, key: str = "") -> Iterator[tuple[str, float]]:
    """All numbers of a parsed file, by their keys."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from numbers_in(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from numbers_in(inner, f"{key}[{i}]")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield key, value


def _index(part: str) -> str | int:
    return int(part[1:-1]) if part.startswith("[") else part


def _cycle(parameters: Sequence[ParameterTable], first: str) -> list[str] | None:
    # Names from a parameter back to itself; None if there is no such way.
    moves = {
        parameter.name: [key.removeprefix(PARAMETER) for key in parameter.moves if key.startswith(PARAMETER)]
        for parameter in parameters
    }
    paths = [[first]]
    seen: set[str] = set()
    while paths:
        path = paths.pop()
        for name in moves[path[-1]]:
            if name == first:
                return [*path, name]
            if name not in seen:
                seen.add(name)
                paths.append([*path, name])
    return None
