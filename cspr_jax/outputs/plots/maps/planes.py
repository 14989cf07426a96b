"""Plane of a map that pictures show: two of its axes."""

from collections.abc import Sequence

from cspr_jax.outputs.plots.maps.sections import AROUND, POLAR
from cspr_jax.store.reading.result import Result

# Pairs of axes that make a plane, the second upward or, in polar coordinates, outward. A picture shows the first pair
# that varies, or else the pair with the most cells.
PLANES = (("x", "y"), POLAR, ("from_x", "from_y"))
OTHERS = (AROUND, ("x", "z"), ("y", "z"), ("radius", "z"))


def in_order(result: Result, across: Sequence[str]) -> list[str]:
    """Axes that vary, those of the plane first."""
    plane = next((pair for pair in PLANES if set(pair) <= set(across)), None) or max(
        (pair for pair in OTHERS if set(pair) <= set(across)),
        key=lambda pair: len(result.axes[pair[0]]) * len(result.axes[pair[1]]),
        default=(),
    )
    return [*plane, *(axis for axis in across if axis not in plane)]
