"""Numbers as somebody gives them from Python."""

from typing import Any

import numpy as np

from cspr_jax.errors import InputError


def numbers(key: str, given: Any, allowed: str) -> np.ndarray:
    """Numbers that somebody gave.

    Args:
        key: named in errors.
        given: number or nested sequence.
        allowed: what is allowed, for errors.

    Returns:
        float64 array.

    Raises:
        InputError: no numbers, or rows of several lengths.
    """
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError) as error:
        raise InputError(key, given, allowed) from error
