"""Several numbers packed into one: for each output array, XLA's CPU backend repeats the computations that all share.

A complex number holds two real numbers in float64, or four in float32.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array, lax

# Relative error of rounding to float32; numbers above the largest become the largest.
SINGLE_ERROR = 2.0**-24
LARGEST = float(np.finfo(np.float32).max)
WIDTH = 4
_HALF = 32  # bits


def paired(values: Sequence[Array]) -> tuple[Array, ...]:
    """Pack two real numbers into one complex number."""
    return tuple(lax.complex(a, b) for a, b in zip(values[::2], values[1::2], strict=True))


def parts(pairs: Sequence[Array]) -> list[Array]:
    """Unpack the numbers that `paired` has packed."""
    return [part(x) for x in pairs for part in (jnp.real, jnp.imag)]


def packed(values: Sequence[Array]) -> tuple[Array, ...]:
    """Pack four real numbers, rounded to float32, into one complex number."""
    filled = [*values, *([jnp.zeros_like(values[0])] * (-len(values) % WIDTH))]
    return paired([_joined(a, b) for a, b in zip(filled[::2], filled[1::2], strict=True)])


def unpacked(fours: Sequence[Array]) -> list[Array]:
    """Unpack the numbers that `packed` has packed."""
    return [x for both in parts(fours) for x in _halves(both)]


def _joined(first: Array, last: Array) -> Array:
    low, high = (
        lax.bitcast_convert_type(jnp.clip(x, -LARGEST, LARGEST).astype(jnp.float32), jnp.uint32).astype(jnp.uint64)
        for x in (first, last)
    )
    return lax.bitcast_convert_type(low | (high << _HALF), jnp.float64)


def _halves(both: Array) -> list[Array]:
    bits = lax.bitcast_convert_type(both, jnp.uint64)
    return [
        lax.bitcast_convert_type(half.astype(jnp.uint32), jnp.float32).astype(jnp.float64)
        for half in (bits, bits >> _HALF)
    ]
