"""Descriptions, in plain JSON, of values on which a traced program depends, and of the pytrees that it returns.

A value that has no such description raises `Undescribed`, and its program is not kept.
"""

import dataclasses
import enum
import functools
import importlib
import sys
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

# Packages whose names descriptions may contain: their versions, or their sources, are part of keys.
_PACKAGES = ("cspr_jax", "builtins", "numpy", "jax")
_PLAIN = (bool, int, str, type(None))


class Undescribed(Exception):
    """A value that has no complete description in JSON."""


def described(value: Any) -> Any:
    """Description of a static argument or of the static part of a pytree: equal for equal values in every process."""
    if type(value) in _PLAIN:
        return value
    for is_kind, parts in _KINDS:
        if is_kind(value):
            return parts(value)
    return ["fields", name_of(type(value)), [[name, described(item)] for name, item in _fields(value).items()]]


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biuf"


def _is_named(value: Any) -> bool:
    return isinstance(value, type) or (callable(value) and hasattr(value, "__qualname__"))


# The first row whose test a value passes describes it.
_KINDS: tuple[tuple[Callable[[Any], bool], Callable[[Any], Any]], ...] = (
    (lambda v: type(v) is float, lambda v: ["float", v.hex()]),
    (lambda v: isinstance(v, enum.Enum), lambda v: ["member", name_of(type(v)), v.name]),
    (_is_named, lambda v: ["name", name_of(v)]),
    (lambda v: isinstance(v, np.dtype), lambda v: ["dtype", v.str]),
    (lambda v: type(v) in (tuple, list), lambda v: [type(v).__name__, [described(item) for item in v]]),
    (lambda v: type(v) is dict, lambda v: ["dict", [[described(key), described(item)] for key, item in v.items()]]),
    (_is_array, lambda v: ["array", name_of(type(v)), v.dtype.str, list(v.shape), v.tobytes().hex()]),
    (
        lambda v: type(v) is functools.partial,
        lambda v: ["partial", described(v.func), described(v.args), described(v.keywords)],
    ),
)


def _fields(value: Any) -> dict[str, Any]:
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return dict(zip(value._fields, value, strict=True))
    if dataclasses.is_dataclass(value):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        if vars(value).keys() <= fields.keys():
            return fields
    raise Undescribed(type(value).__name__)


def name_of(thing: Any) -> str:
    """Name by which another process can find a class or a function."""
    name = f"{getattr(thing, '__module__', None) or 'builtins'}:{getattr(thing, '__qualname__', '')}"
    try:
        is_there = _named(name) is thing
    except (AttributeError, ImportError):
        is_there = False
    if not is_there:
        raise Undescribed(name)
    return name


def _named(name: str) -> Any:
    module, _, path = name.partition(":")
    if module.partition(".")[0] not in _PACKAGES:
        raise ImportError(module)
    loaded = sys.modules.get(module) or importlib.import_module(module)
    return functools.reduce(getattr, path.split("."), loaded)


def described_tree(tree: Any) -> Any:
    """Description of the structure of a pytree, with its static parts."""
    node = tree.node_data()
    if node is None:
        return "leaf"
    kind = "None" if node[0] is type(None) else name_of(node[0])
    return [kind, described(node[1]), [described_tree(child) for child in tree.children()]]


def tree_of(description: Any) -> Any:
    """Structure of a pytree from its description."""
    if description == "leaf":
        return jax.tree.structure(0)
    kind, static, children = description
    if kind == "None":
        return jax.tree.structure(None)
    node = _named(kind), _value(static)
    trees = [tree_of(child) for child in children]
    return jax.tree_util.PyTreeDef.from_node_data_and_children(jax.tree_util.default_registry, node, trees)


def _value(description: Any) -> Any:
    # Value from its description: the inverse of `described`, for static parts of results.
    if type(description) in _PLAIN:
        return description
    kind, *parts = description
    if kind == "float":
        return float.fromhex(parts[0])
    if kind == "name":
        return _named(parts[0])
    if kind in ("tuple", "list"):
        return {"tuple": tuple, "list": list}[kind](_value(item) for item in parts[0])
    if kind == "fields" and isinstance(_named(parts[0]), type):
        return _named(parts[0])(**{name: _value(item) for name, item in parts[1]})
    raise Undescribed(kind)
