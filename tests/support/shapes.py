"""Shapes in signatures of the package, compared with those of the arrays that functions take and return.

With CSPR_TESTS_SHAPES=1 each function of the package is wrapped when its module is imported, below its other
decorators, and a call with other shapes than the signature says fails. A name in a shape is one size throughout a call.
"""

import ast
import functools
import importlib.abc
import importlib.machinery
import inspect
import os
import re
import sys
from typing import Any

import jaxtyping

SHAPED = re.compile(r"""(\w+)\[[\w.]+, ['"]([^'"]*)['"]\]""")
DECORATOR = ast.parse("__import__('support.shapes', fromlist=['checked']).checked", mode="eval").body


class _Loader(importlib.machinery.SourceFileLoader):
    # Nothing is read from or written to compiled files, which hold modules as they are.
    def get_code(self, fullname):
        tree = ast.parse(self.get_data(self.path))
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                node.decorator_list.append(ast.copy_location(DECORATOR, node))
        return compile(ast.fix_missing_locations(tree), self.path, "exec", dont_inherit=True)


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, fullname, path=None, target=None):
        if fullname.partition(".")[0] != "cspr_jax":
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def install() -> None:
    """Before the package is imported."""
    if os.environ.get("CSPR_TESTS_SHAPES"):
        sys.meta_path.insert(0, _Finder())


def checked(function):
    """The function, which checks the arrays that it takes and returns."""
    if not inspect.isfunction(function):
        return function
    annotations = {name: shaped_types(text) for name, text in function.__annotations__.items()}
    annotations = {name: kinds for name, kinds in annotations.items() if kinds}
    if not annotations:
        return function
    signature, result = inspect.signature(function), annotations.pop("return", ())

    @functools.wraps(function)
    def with_checks(*args, **kwargs):
        with jaxtyping.jaxtyped("context"):
            given = signature.bind(*args, **kwargs).arguments
            for name, kinds in annotations.items():
                if name in given:
                    check(function, name, given[name], kinds)
            value = function(*args, **kwargs)
            check(function, "return", value, result)
        return value

    return with_checks


def shaped_types(annotation) -> tuple[type, ...]:
    """Types of the arrays of an annotation that holds nothing else."""
    text = str(annotation)
    if not re.fullmatch(r"(X|tuple\[X(, X)*\])( \| None)?", SHAPED.sub("X", text)):
        return ()
    return tuple(getattr(jaxtyping, kind)[Any, dims] for kind, dims in SHAPED.findall(text))


def check(function, name: str, value, kinds: tuple[type, ...]) -> None:
    """Refuse arrays of other shapes; what is no array has none."""
    values = value if isinstance(value, tuple) and len(kinds) > 1 else (value,)
    for one, kind in zip(values, kinds, strict=False):
        if hasattr(one, "shape") and hasattr(one, "dtype") and not is_of(one, kind):
            where = f"{function.__module__}.{function.__qualname__}"
            message = f"{where}: {name} is {kind.__name__}, not {one.dtype}{one.shape}"
            raise AssertionError(message)


def is_of(array, kind: type) -> bool:
    """Whether an array has a shape; also if that is a sum of a name that no argument has."""
    try:
        return isinstance(array, kind)
    except jaxtyping.AnnotationError:
        return True
