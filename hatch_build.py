"""What the build of a wheel adds: the sweep files as examples. An editable install reads them in the checkout."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Examples(BuildHookInterface):
    """Puts `sweeps` into the package of a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before a wheel is built."""
        if version == "standard":
            build_data["force_include"]["sweeps"] = "cspr_jax/examples"
