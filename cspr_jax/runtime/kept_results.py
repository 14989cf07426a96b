"""Results of long computations that one run leaves to the next, beside its compiled code (`runtime.compile_cache`).

Entries bear checksums in their names there: one that was damaged is removed before it is read here.
"""

import contextlib
import functools
import hashlib
import json
import os
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jaxlib.version
import numpy as np

from cspr_jax.runtime.compile_cache import PROGRAMS, plain_bytes
from cspr_jax.runtime.packed import inflated

# Files of the package that decide what it computes.
_SOURCES = (".py", ".toml", ".csv")
LARGEST_RESULT = 1 << 24  # bytes, not compressed


def kept_result(name: str, settings: Any, compute: Callable[[], Any], *, again: bool = False) -> Any:
    """A result of the same sources, libraries and settings: that of an earlier run, else one that is kept from now."""
    folder = os.environ.get(PROGRAMS)
    if not folder:
        return compute()
    versions = [jax.__version__, jaxlib.version.__version__, np.__version__, sys.version, jax.default_backend()]
    key = json.dumps([name, settings, versions, os.environ.get("XLA_FLAGS", ""), _sources()])
    path = Path(folder) / f"{name}-{hashlib.sha256(key.encode()).hexdigest()}"
    if not again:
        with contextlib.suppress(OSError, ValueError, TypeError, RecursionError):
            kept_key, result = json.loads(inflated(plain_bytes(path), LARGEST_RESULT))
            if kept_key == key:
                return result
    result = compute()
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        partial.write_bytes(zlib.compress(json.dumps([key, result]).encode()))
        partial.replace(path)  # it may be a link to the entry of a former run
    return result


@functools.cache
def _sources() -> str:
    package, total = Path(__file__).parents[1], hashlib.sha256()
    for path in sorted(one for one in package.rglob("*") if one.suffix in _SOURCES):
        content = path.read_bytes()
        total.update(f"{path.relative_to(package)} {len(content)}\n".encode() + content)
    return total.hexdigest()
