"""The library for exact arithmetic, which is optional; without jax."""

import functools
import importlib.util
import threading

from cspr_jax.errors import ConfigError

HOW = "pip install 'cspr_jax[exact]'"
# The library holds precision and number of coefficients for the whole process, so that threads take turns.
LIBRARY_LOCK = threading.RLock()


@functools.cache
def has_exact() -> bool:
    """Tell whether the library is installed."""
    return importlib.util.find_spec("flint") is not None


def need_exact(key: str) -> None:
    """Refuse an option or argument that needs the library where it is not installed, and say how to install it."""
    if not has_exact():
        raise ConfigError(key, f"python-flint is not installed: {HOW}")
