"""Import of MuJoCo, which is optional; without jax, so that commands can check for it before they set jax up."""

from typing import Any

from cspr_jax.errors import ConfigError


def need_mujoco() -> Any:
    """Import MuJoCo, or say how to install it."""
    try:
        import mujoco
    except ImportError as error:
        raise ConfigError("mujoco", "is not installed: pip install 'cspr_jax[sim]'") from error
    return mujoco
