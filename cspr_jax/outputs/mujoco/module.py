"""MuJoCo, which is optional; without jax, so that commands ask for it before they set jax up."""

from typing import Any

from cspr_jax.errors import ConfigError


def need_mujoco() -> Any:
    """MuJoCo, an optional dependency."""
    try:
        import mujoco
    except ImportError as error:
        raise ConfigError("mujoco", "is not installed: pip install 'cspr_jax[sim]'") from error
    return mujoco
