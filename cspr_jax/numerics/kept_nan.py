"""Flag with which XLA keeps NaN: without it, some versions leave NaN out of minima, maxima and sums; without jax."""

import os
import sys

# Minima, maxima and sums of many values go to a library that takes NaN for the larger number; an empty list of such
# operations leaves them all to XLA.
FLAG = "--xla_cpu_experimental_ynn_fusion_type="
# Versions of jaxlib that know the flag and need it. XLA ends a process that sets flags which it does not know.
_NEED_IT = (0, 10)
# Holds True once the flag was set before jax was imported, so that jax is certain to read it.
_set_before_jax: list[bool] = []


def with_flag(flags: str) -> str:
    """XLA flags of a process, with the one that keeps NaN where XLA needs it and they do not name it."""
    import jaxlib.version

    is_named = FLAG in flags or (flags.strip() and not flags.lstrip().startswith("-"))  # the name of a file of flags
    if is_named or jaxlib.version.__version_info__[:2] != _NEED_IT:
        return flags
    return f"{FLAG} {flags}".strip()


def set_flag() -> None:
    """Set the flag for this process, in which jax reads it when it starts, and for those that it starts."""
    flags = with_flag(os.environ.get("XLA_FLAGS", ""))
    if flags:
        os.environ["XLA_FLAGS"] = flags
    if "jax" not in sys.modules and FLAG in flags.split():
        _set_before_jax.append(True)


def was_set_in_time() -> bool:
    """Tell whether jax is certain to have read the flag."""
    return bool(_set_before_jax)
