"""`jax.jit` whose traced programs persist from run to run, beside the compiled code.

jax finds compiled code by its program, so that each run traces and lowers a function again. This module reads the
program instead (`lowered_programs`), in the same folder and with the same checks and limits as compiled code
(`compile_cache`). The key of a program contains all that tracing depends on: sources of this package, versions,
settings of jax, the function, static arguments, structure and shapes of the others. A run that makes a program calls
the program that it has written, so that first and later runs compile the same one.
"""

import contextlib
import functools
import hashlib
import inspect
import json
import os
import struct
import sys
import threading
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import jax
import jaxlib.version
import numpy as np

from cspr_jax.numerics.elementary import keeps_nan
from cspr_jax.runtime import compile_cache
from cspr_jax.runtime.compile_cache import PROGRAMS
from cspr_jax.runtime.compiled_code import limit_compiled_code
from cspr_jax.runtime.packed import inflated
from cspr_jax.runtime.program_keys import Undescribed, described, described_tree, tree_of

# Version of the format, part of each key, so that programs of earlier formats are not found.
_FORMAT = 1
_FASTEST = 1  # fastest level of zlib
_SCALARS = (bool, int, float, complex)
# Settings of a thread on which programs depend; settings of the process are in `jax.config.values`.
_SETTINGS = (
    "jax_enable_x64",
    "jax_numpy_dtype_promotion",
    "jax_numpy_rank_promotion",
    "jax_default_matmul_precision",
)
# Settings without effect on programs, such as the folder of compiled code, which differs between runs.
_IRRELEVANT = ("jax_compilation_cache", "jax_persistent_cache", "jax_log", "jax_raise_persistent")
# Errors of programs that cannot be written, read or called; then jax traces the function as usual.
_TROUBLE = (Undescribed, ImportError, OSError, ValueError, TypeError, LookupError, AttributeError, RuntimeError)
_UNREADABLE = (*_TROUBLE, struct.error)
LARGEST_PROGRAM = 1 << 26  # bytes before compression
Function = TypeVar("Function", bound=Callable)


def persistent_jit(
    function: Function | None = None,
    *,
    static_argnames: str | Sequence[str] = (),
    compiler_options: dict[str, Any] | None = None,
) -> Any:
    """Compile a function like `jax.jit`, and keep its programs where compiled code is kept.

    Inside of other compiled functions, and wherever a program cannot be kept, it behaves as `jax.jit`.
    """
    static = (static_argnames,) if isinstance(static_argnames, str) else tuple(static_argnames)
    if function is None:
        return functools.partial(persistent_jit, static_argnames=static, compiler_options=compiler_options)
    compiled = jax.jit(function, static_argnames=static, compiler_options=compiler_options)
    programs = _Programs(function, static, compiler_options)

    @functools.wraps(function)
    def call(*arguments: Any, **keywords: Any) -> Any:
        limit_compiled_code()
        # jax does not declare the types of its settings.
        if PROGRAMS in os.environ and not jax.config.jax_disable_jit:  # type: ignore[attr-defined]
            with contextlib.suppress(*_TROUBLE):
                return programs.result(arguments, keywords)
        # Let jax report errors of arguments.
        return compiled(*arguments, **keywords)

    call.lower = compiled.lower  # type: ignore[attr-defined]
    return call


class _Program(NamedTuple):
    # A function of arrays, the structure of its result, and the name of the file from which it was read, if it was.
    call: Callable
    tree: Any
    file: str | None


class _Programs:
    # Programs of a function, by everything on which they depend within this process.

    def __init__(self, function: Callable, static: tuple[str, ...], options: dict[str, Any] | None) -> None:
        self._function, self._static, self._options = function, static, options
        self._signature = inspect.signature(function)
        self._lock = threading.RLock()
        self._programs: dict[Any, _Program | None] = {}

    def result(self, arguments: tuple, keywords: dict[str, Any]) -> Any:
        bound = self._signature.bind(*arguments, **keywords).arguments
        static = {name: bound.pop(name) for name in self._static if name in bound}
        leaves, tree = jax.tree.flatten(bound)
        shapes = tuple([_shape(array) for array in leaves])
        typed = tuple([(name, type(value), value) for name, value in static.items()])
        key = (tree, shapes, typed, tuple([getattr(jax.config, name) for name in _SETTINGS]))
        make = functools.partial(self._made, leaves, tree, shapes, static)
        if key not in self._programs:
            with self._lock:  # another thread may be making the same program
                if key not in self._programs:
                    self._programs[key] = make()
        program = self._programs[key]
        try:
            return self._called(program, leaves)
        except _TROUBLE:
            if program is None or program.file is None:
                self._programs[key] = None
                raise
        # The program from the file, or its compiled code, cannot be used.
        with self._lock:
            if self._programs[key] is program:
                compile_cache.set_aside(program.file)
                compile_cache.set_aside(f"jit_{self._function.__name__}-")
                self._programs[key] = make(is_anew=True)
        return self._called(self._programs[key], leaves)

    def _called(self, program: _Program | None, leaves: list) -> Any:
        if program is None:
            raise Undescribed(self._function.__name__)
        return jax.tree.unflatten(program.tree, program.call(*leaves))

    def _made(
        self, leaves: list, tree: Any, shapes: tuple, static: dict[str, Any], *, is_anew: bool = False
    ) -> _Program | None:
        is_wanted = jax.config.jax_enable_compilation_cache  # type: ignore[attr-defined]
        if not is_wanted or jax.default_backend() != "cpu" or jax.device_count() != 1:
            return None
        try:
            words = [_name(self._function), described(static), described_tree(tree), _written(shapes), _settings()]
            key = json.dumps([_FORMAT, *_versions(), checksum_of_sources(), *words])
            path = Path(os.environ[PROGRAMS]) / f"{self._function.__name__}-{hashlib.sha256(key.encode()).hexdigest()}"
            program = None if is_anew else _read(path, key)
            if program is not None:
                with contextlib.suppress(*_UNREADABLE):
                    return _Program(*self._compiled(*program), path.name)
            program = self._lowered(leaves, tree, static)
            with contextlib.suppress(OSError):
                _write(path, key, *program)
            return _Program(*self._compiled(*program), None)
        except _UNREADABLE:
            return None

    def _lowered(self, leaves: list, tree: Any, static: dict[str, Any]) -> tuple[Any, bytes]:
        # Programs take and return arrays only; pytrees of this package's classes are flattened and rebuilt outside.
        from cspr_jax.runtime.lowered_programs import lowered

        trees = []

        def flat(*leaves: Any) -> list:
            results, results_tree = jax.tree.flatten(self._function(**jax.tree.unflatten(tree, leaves), **static))
            trees.append(results_tree)
            return results

        flat.__name__ = self._function.__name__
        program = lowered(flat, leaves)
        if program is None:
            raise Undescribed(flat.__name__)
        return [described_tree(trees[-1]), program.name, program.results], program.code

    def _compiled(self, head: list, code: bytes) -> tuple[Callable, Any]:
        from cspr_jax.runtime.lowered_programs import LoweredProgram, call

        tree, name, results = head
        program = LoweredProgram(name, code, tuple((tuple(shape), dtype) for shape, dtype in results))

        def called(*leaves: Any) -> list:
            return call(program, *leaves)

        called.__name__ = name  # shown to users while it is compiled
        return jax.jit(called, compiler_options=self._options), tree_of(tree)


def _name(function: Callable) -> str:
    # The module's name now refers to the compiled function, so identify the original by its module and qualified name.
    name = f"{function.__module__}:{function.__qualname__}"
    if not name.startswith(f"{__name__.partition('.')[0]}.") or "<" in name:
        raise Undescribed(name)
    return name


def _shape(array: Any) -> tuple:
    if isinstance(array, np.ndarray | np.generic):
        return array.shape, array.dtype
    if isinstance(array, jax.Array) and not isinstance(array, jax.core.Tracer):
        return array.shape, array.dtype, array.weak_type
    if type(array) in _SCALARS:
        return (type(array),)
    raise Undescribed(type(array).__name__)


def _written(shapes: tuple) -> list:
    return [[described(part) for part in shape] for shape in shapes]


def _settings() -> list[str]:
    # All settings of the process, whatever their meaning, and those of this thread.
    of_process = [
        f"{name}={value}" for name, value in sorted(jax.config.values.items()) if not name.startswith(_IRRELEVANT)
    ]
    of_thread = [f"{name}={getattr(jax.config, name)}" for name in _SETTINGS]
    return [*of_process, *of_thread, f"keeps_nan={keeps_nan()}"]


def _versions() -> tuple[str, ...]:
    return jax.__version__, jaxlib.version.__version__, np.__version__, sys.version


@functools.cache
def checksum_of_sources(endings: tuple[str, ...] = (".py",)) -> str:
    """Checksum of all files of the package with these endings; reading them takes 15 ms, and times are not reliable."""
    package, total = Path(__file__).parents[1], hashlib.sha256()
    for path in sorted(path for path in package.rglob("*") if path.suffix in endings):
        content = path.read_bytes()
        total.update(f"{path.relative_to(package)} {len(content)}\n".encode() + content)
    return total.hexdigest()


def _read(path: Path, key: str) -> tuple[Any, bytes] | None:
    # Read a program; None where it is absent, incomplete or of another function, so that it is made again.
    try:
        data = inflated(compile_cache.plain_bytes(path), LARGEST_PROGRAM)
        checksum, _, content = data.partition(b"\n")
        if checksum != hashlib.sha256(content).hexdigest().encode():
            return None
        head, _, program = content.partition(b"\n")
        written_key, description = json.loads(head)
    except _UNREADABLE:
        return None
    return (description, program) if written_key == key else None


def _write(path: Path, key: str, description: Any, program: bytes) -> None:
    # Replace the file instead of writing into it: it may be a link to a damaged file of former runs.
    content = json.dumps([key, description]).encode() + b"\n" + program
    checksum = hashlib.sha256(content).hexdigest().encode()
    partial = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}")
    try:
        partial.write_bytes(zlib.compress(checksum + b"\n" + content, _FASTEST))
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
