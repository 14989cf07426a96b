"""Batches of one shape.

XLA compiles for one shape, and the last bits of results can depend on the shape. So every call has the same shape: the
last batch is padded with its own last element, and its results are trimmed. Where many sets of cases are computed one
after the other (`short_batches`), there is a second, shorter shape for what is left over of each set.
"""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar, copy_context
from itertools import pairwise
from typing import TypeVar

import jax
import numpy as np
from jax import lax

from cspr_jax.numerics.cores import cores
from cspr_jax.numerics.elementary import double_precision

# Factors by which batches are larger on other devices than on a CPU, whose caches they have to fit.
LARGER = {"gpu": 16, "tpu": 16}
# Largest length of a batch; tests, which compute few cases at a time, lower it.
LARGEST = 1 << 20
# Number of threads that share the cases; it does not depend on the number of cores, so that results keep their bits.
THREADS = 2
# Fraction 1 / SHORT of a batch's length that short batches have.
SHORT = 4
Found = TypeVar("Found")
_has_short_batches = ContextVar("has_short_batches", default=False)
_is_in_thread = ContextVar("is_in_thread", default=False)


@contextlib.contextmanager
def short_batches() -> Iterator[None]:
    """Let what is left over of a set of cases have short batches: two shapes are compiled, and less is padded."""
    token = _has_short_batches.set(True)
    try:
        yield
    finally:
        _has_short_batches.reset(token)


def in_threads(function: Callable, items: Sequence) -> list:
    """Results of a function for each item, in order, computed by two threads, since XLA often uses one core only.

    In a process that computes on one core, one thread does it all; so does each of these threads with what it calls.
    """
    # jax does not declare the type of this setting.
    device = jax.config.jax_default_device  # type: ignore[attr-defined]

    def one(item):
        # The caller's settings of jax may hold in its own thread alone.
        with double_precision(), jax.default_device(device):
            return function(item)

    if cores() == 1 or len(items) == 1 or _is_in_thread.get():
        return [one(item) for item in items]
    token = _is_in_thread.set(True)
    contexts = [copy_context() for _ in items]
    _is_in_thread.reset(token)
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(lambda context, item: context.run(one, item), contexts, items))


def in_parts(function: Callable[[slice], Found], count: int, length: int) -> list[Found]:
    """Results of many cases, range by range, computed by two threads; see `in_threads`."""
    # All parts have the same length up to one case, and each thread gets the same number of parts.
    rounds = -(-count // (THREADS * length))
    bounds = np.linspace(0, count, min(rounds * THREADS, count) + 1).round().astype(int).tolist()
    return in_threads(function, [slice(*pair) for pair in pairwise(bounds)])


def device_batch_size(batch_size: int) -> int:
    """Length of a batch on the device in use."""
    return min(batch_size * LARGER.get(jax.default_backend(), 1), LARGEST)


def row_by_row(function: Callable, rows):
    """Apply a function of many lanes to each row of a table, inside of a compiled function."""
    if jax.default_backend() == "cpu":
        return lax.map(function, rows)
    count = len(jax.tree.leaves(rows)[0])
    return lax.map(function, rows, batch_size=max(count // 2, 1))


def in_batches(function: Callable, arguments, *, batch_size: int, axis: int = 0):
    """Apply a compiled function to arrays of any length, in batches of one length."""
    batch_size = device_batch_size(batch_size)
    arguments = jax.tree.map(np.asarray, arguments)  # slicing arrays of jax takes a hundred times as long
    count = len(jax.tree.leaves(arguments)[0])
    if count == 0:
        return None
    pending = [
        function(padded(jax.tree.map(lambda a, rows=rows: a[rows], arguments), length))
        for rows, length in _batches(count, batch_size)
    ]
    parts = [jax.tree.map(np.asarray, part) for part in pending]

    def joined(*pieces):
        return np.concatenate(pieces, axis=axis)[(*[slice(None)] * (axis % pieces[0].ndim), slice(count))]

    return jax.tree.map(joined, *parts)


def _batches(count: int, batch_size: int) -> Iterator[tuple[slice, int]]:
    # Cases of each batch, and its length.
    short = max(batch_size // SHORT, 1) if _has_short_batches.get() else batch_size
    start = 0
    while start < count:
        length = short if count - start <= batch_size - short else batch_size
        yield slice(start, start + length), length
        start += length


def padded(arguments, length: int):
    """Arrays padded to the length of a batch."""

    def one(array):
        if len(array) == length:
            return array
        return np.concatenate([array, np.repeat(array[-1:], length - len(array), axis=0)])

    return jax.tree.map(one, arguments)
