"""Elementary functions that XLA compiles well, for one number or an array of any shape."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import warnings
from collections.abc import Iterator
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics import kept_nan
from cspr_jax.numerics.shapes import Float

# Numbers of terms that keep the truncation error below half a unit in the last place on |x| <= pi / 2.
_SINE_TERMS = {"float64": 11, "float32": 7}
_COSINE_TERMS = {"float64": 12, "float32": 7}
# Number of values from which all versions of XLA that leave NaN out of minima do.
_MANY = 100_000
# jax's settings for promotion of dtypes and of ranks, which replace the caller's; tests use the strictest.
PROMOTION = ("standard", "allow")


def polynomial(coefficients, x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Value of c[0] + c[1] x + c[2] x^2 + ... by Horner's rule."""
    value = jnp.zeros_like(x)
    for coefficient in reversed(coefficients):
        value = value * x + coefficient
    return value


def unit_vectors(vectors: Float[np.ndarray, "... k"]) -> Float[np.ndarray, "... k"]:
    """Vectors scaled to length 1; a zero vector stays zero."""
    norms = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(norms > 0.0, norms, 1.0)


@jax.jit
def sincospi(x: Float[Array, "..."]) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """sin(pi x) and cos(pi x), by range reduction and a polynomial.

    The sine and cosine of XLA's CPU backend compute one element at a time; this uses vector registers. With angles in
    half turns the range reduction is exact.
    """
    half_turns = jnp.round(x)
    angle = x - half_turns
    square = (math.pi * angle) ** 2
    sign = 1.0 - 2.0 * (half_turns - 2.0 * jnp.floor(0.5 * half_turns))
    kind = str(x.dtype)
    sine = polynomial([(-1) ** i / math.factorial(2 * i + 1) for i in range(_SINE_TERMS[kind])], square)
    cosine = polynomial([(-1) ** i / math.factorial(2 * i) for i in range(_COSINE_TERMS[kind])], square)
    return sign * (math.pi * angle) * sine, sign * cosine


def nan_ignoring_min(a: Float[Array, "..."], b: Float[Array, "..."]) -> Float[Array, "..."]:
    """The smaller of two numbers in one machine instruction; XLA's minimum takes four, for the sake of NaN."""
    return jnp.where(a < b, a, b)


def minimum_of(
    values: Float[Array, "..."], axis: Any = None, *, keepdims: bool = False, initial: float | None = None
) -> Float[Array, "..."]:
    """Smallest of the values along axes; NaN where one of them is NaN, also where XLA leaves NaN out of minima."""
    # Bounds that do not exist are NaN, and would count as infinitely good ones.
    return _with_nan(jnp.min(values, axis=axis, keepdims=keepdims, initial=initial), values, axis, keepdims)


def maximum_of(
    values: Float[Array, "..."], axis: Any = None, *, keepdims: bool = False, initial: float | None = None
) -> Float[Array, "..."]:
    """Largest of the values along axes; NaN where one of them is NaN."""
    return _with_nan(jnp.max(values, axis=axis, keepdims=keepdims, initial=initial), values, axis, keepdims)


@functools.cache
def keeps_nan() -> bool:
    """Tell whether XLA keeps NaN here; if not, a warning says how it would."""
    if kept_nan.was_set_in_time():
        return True
    values = np.ones(_MANY, np.float32)
    values[0] = np.nan
    with jax.ensure_compile_time_eval():
        is_kept = bool(_are_nan(values).all())
    if not is_kept:
        lines = "XLA leaves NaN out of minima here, so that proofs test for it, which takes longer: set the environment"
        warnings.warn(f"{lines} variable XLA_FLAGS={kept_nan.FLAG} before jax computes", stacklevel=2)
    return is_kept


@jax.jit
def _are_nan(values: Float[Array, "n"]) -> Float[Array, "2"]:
    return jnp.isnan(jnp.stack([values.min(), jnp.minimum(values, 0.0).sum()]))


def _with_nan(extreme: Array, values: Array, axis: Any, keepdims: bool) -> Array:
    if keeps_nan() or not jnp.issubdtype(extreme.dtype, jnp.floating):
        return extreme
    return jnp.where(jnp.isnan(values).any(axis=axis, keepdims=keepdims), jnp.nan, extreme)


def length(vector: Float[Array, "n"]) -> Float[Array, ""]:
    """Length of a vector, with a gradient of zero where it is zero."""
    square = jnp.sum(vector * vector)
    # A square that is NaN fails both comparisons, so that the length is NaN too.
    return jnp.where(square > 0.0, jnp.sqrt(jnp.where(square > 0.0, square, 1.0)), square)


# Id of the process in which this package first used jax; empty before.
_users: list[int] = []


def _begin() -> None:
    # Set the flag of XLA at first, and refuse computations in forked processes, where jax would wait for ever.
    if not _users:
        _users.append(os.getpid())
        kept_nan.set_flag()  # in time unless the caller has computed with jax before
    if _users[0] != os.getpid():
        raise RuntimeError(
            "this process was forked from one that had used jax, and would wait for ever: start processes by "
            'multiprocessing.get_context("spawn") or "forkserver", or fork before the first call'
        )


@contextlib.contextmanager
def double_precision() -> Iterator[None]:
    """Set jax as this package needs it, whatever the caller has set, and restore the caller's settings afterwards.

    The most important setting is 64 bits, since verdicts are in float64. NaN is a valid result in places, not an error.
    """
    _begin()
    with contextlib.ExitStack() as stack:
        for setting in (
            jax.enable_x64(True),
            jax.numpy_dtype_promotion(PROMOTION[0]),
            jax.numpy_rank_promotion(PROMOTION[1]),
            jax.default_matmul_precision("highest"),
            jax.debug_nans(False),
            jax.debug_infs(False),
            jax.transfer_guard("allow"),
        ):
            stack.enter_context(setting)
        yield


def as_float64(value) -> Array:
    """A float64 NumPy array, as a leaf of a pytree that compiled functions take."""
    return value if isinstance(value, jax.core.Tracer) else cast(Array, np.asarray(value, float))


def vertex(left: Array, middle: Array, right: Array) -> tuple[Array, Array]:
    """Vertex of the parabola through three equidistant values: its position, and the value there."""
    second_derivative = left - 2.0 * middle + right
    move = 0.5 * (left - right) / jnp.where(second_derivative > 0.0, second_derivative, 1.0)
    move = jnp.clip(jnp.where(second_derivative > 0.0, move, jnp.sign(left - right)), -1.0, 1.0)
    return move, middle + 0.5 * move * (right - left) + 0.5 * move**2 * second_derivative


@jax.jit
def solved(matrix: Float[Array, "n n"], right: Float[Array, "n m"]) -> tuple[Float[Array, "n m"], Float[Array, ""]]:
    """Solution of a small linear system, and the determinant, by elimination with pivots.

    It replaces `jnp.linalg`, for which XLA calls LAPACK: in jaxlib 0.10 batches of such calls can wait for ever for
    threads that they occupy themselves.
    """
    count = matrix.shape[0]
    if not count:
        return right, jnp.ones((), matrix.dtype)
    index = jnp.arange(count)

    def eliminate(carry, k):
        rows, determinant = carry
        column, row = lax.dynamic_index_in_dim(rows, k, 1, keepdims=False), lax.dynamic_index_in_dim(rows, k, 0, False)
        pivot_index = jnp.argmax(jnp.where(index < k, -1.0, jnp.abs(column)))
        is_pivot, is_next = index == pivot_index, index == k
        pivot_row = jnp.sum(jnp.where(is_pivot[:, None], rows, 0.0), axis=0)
        pivot = jnp.sum(jnp.where(is_pivot, column, 0.0))
        # Swap the current row and the row of the pivot.
        rows, column = jnp.where(is_pivot[:, None], row, rows), jnp.where(is_pivot, column[k], column)
        determinant = determinant * pivot * jnp.where(pivot_index == k, 1.0, -1.0)
        pivot_row = pivot_row / pivot
        return (jnp.where(is_next[:, None], pivot_row, rows - column[:, None] * pivot_row[None]), determinant), None

    start = jnp.concatenate([matrix, right], axis=1), jnp.ones((), matrix.dtype)
    rows, determinant = lax.scan(eliminate, start, index)[0]
    return rows[:, count:], determinant
