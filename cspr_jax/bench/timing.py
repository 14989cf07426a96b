"""How long work takes, and what the machine can do at most."""

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

REPEATS = 5
# Sides of the matrices that are multiplied, and bytes that are copied: far beyond every cache.
SIDE, COPIED = 2048, 2**28


def best(work: Callable[[], object]) -> float:
    """The shortest of several times, after one that compiles.

    Args:
        work: what is timed.

    Returns:
        s.
    """
    work()
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def cores() -> int:
    """How many processors this process may use.

    Returns:
        their number.
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(function: Callable, items: Iterable[Any]) -> list:
    """Results of a compiled function, one thread a core: XLA runs a loop over many cases on one.

    Args:
        function: gives arrays.
        items: its arguments.

    Returns:
        one result an item, in order.
    """
    with ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(lambda item: jax.block_until_ready(function(item)), items))


def peak() -> dict[str, float]:
    """What the machine does at most, by the same library: products of large matrices, and copies of large arrays.

    Returns:
        "float32" and "float64" operations a second, "bytes" read and written a second.
    """
    found, array = {}, jnp.ones(COPIED // 4, jnp.float32)
    for dtype in ("float32", "float64"):
        matrix = jnp.ones((SIDE, SIDE), dtype)
        found[dtype] = 2.0 * SIDE**3 / best(partial(_done, jax.jit(jnp.matmul), matrix, matrix))
    found["bytes"] = 2.0 * COPIED / best(partial(_done, jax.jit(jnp.add), array, jnp.float32(1.0)))
    return found


def _done(function: Callable, *arguments: Any) -> None:
    jax.block_until_ready(function(*arguments))


def operations(lowered: Any, cases: int) -> float:
    """Arithmetic operations of a compiled function, as XLA counts them; a loop's are counted once.

    Args:
        lowered: the function.
        cases: how many it computes.

    Returns:
        of each case.
    """
    found = lowered.compile().cost_analysis()
    return float(np.asarray((found[0] if isinstance(found, list) else found).get("flops", np.nan))) / cases
