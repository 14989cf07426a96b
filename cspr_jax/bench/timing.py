"""Durations of work, and peak rates of the machine."""

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np

REPEATS = 5
# Number of rows of the multiplied matrices, and bytes of the copied array: far more than caches hold.
SIDE, COPIED = 3072, 2**28


def best(work: Callable[[], object], repeats: int | None = None) -> float:
    """The shortest of several durations, after a first run that compiles."""
    work()
    times = []
    for _ in range(repeats or REPEATS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def cores() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def peak() -> dict[str, float]:
    """Peak rates of the processor: NumPy's products of large matrices, and copies of large arrays."""
    rates = {}
    for dtype in ("float32", "float64"):
        # Rows are divided among threads: the command line has NumPy's library work in the calling thread alone.
        matrix, product = np.ones((SIDE, SIDE), dtype), np.empty((SIDE, SIDE), dtype)
        with ThreadPoolExecutor(cores()) as pool:
            rates[dtype] = 2.0 * SIDE**3 / best(partial(_square, pool, matrix, product))
    array, copy = np.ones(COPIED // 8), np.empty(COPIED // 8)
    rates["bytes"] = 2.0 * COPIED / best(partial(np.copyto, copy, array))
    return rates


def _square(pool: ThreadPoolExecutor, matrix: np.ndarray, product: np.ndarray) -> None:
    rows = [np.array_split(table, cores()) for table in (matrix, product)]
    list(pool.map(lambda part, out: np.matmul(part, matrix, out=out), *rows))


def operations(lowered: Any, cases: int) -> float | None:
    """Arithmetic operations a case of a compiled function, as XLA counts them; it counts the body of a loop once."""
    costs = lowered.compile().cost_analysis() or {}
    return costs["flops"] / cases if "flops" in costs else None
