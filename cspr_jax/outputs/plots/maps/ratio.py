"""Ratio of a quantity of two maps, cell by cell, as a map."""

import dataclasses

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import one_of
from cspr_jax.outputs.plots.maps.conditions import shown_first
from cspr_jax.schema.quantities import RATIO
from cspr_jax.store.reading.result import Result

# Points of axes whose relative difference is less than this are the same.
SAME = 1e-9
PAIR = 2


def ratio_of(results: list[Result], names: list[str], quantity: str | None) -> Result:
    """The map of the ratio of a quantity of one map to that of another."""
    if len(results) != PAIR or not all(result.is_map for result in results):
        raise InputError("--ratio", f"{len(results)} results", "absent but for two maps")
    name = quantity or shown_first(results[0])
    both = sorted(results[0].data.keys() & results[1].data.keys())
    if name not in both:
        raise InputError(
            "--quantity", name, one_of(name, both, f"one that both maps have ({', '.join(both) or 'none'})")
        )
    axes = [{axis: points for axis, points in result.axes.items() if len(points) > 1} for result in results]
    shared = results[0].axes.keys() & results[1].axes.keys()
    if axes[0].keys() != axes[1].keys() or not all(
        _same(*(result.axes[axis] for result in results)) for axis in shared
    ):
        raise InputError("--ratio", f"{names[0]} and {names[1]}", "absent but for two maps over the same cells")
    over, under = (np.asarray(result.data[name], float) for result in results)
    order = [axis for axis in results[1].axes if axis in axes[0]]
    under = under.reshape([len(axes[0][axis]) for axis in order])
    under = under.transpose([order.index(axis) for axis in axes[0]]).reshape(over.shape)
    ratio = over / np.where(under == 0.0, np.nan, under)
    label = f"{results[0].labels[name]}, over that of {_words(results[1])}"
    return dataclasses.replace(
        results[0],
        data={RATIO.name: ratio},
        units=results[0].units | {RATIO.name: RATIO.units},
        labels=results[0].labels | {RATIO.name: label},
    )


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    return len(one) == len(other) and bool(np.allclose(one, other, rtol=SAME, atol=SAME))


def _words(result: Result) -> str:
    family = result.settings.get("trajectory", {}).get("family")
    return f'family "{family}"' if family else f'map "{result.attributes["map"]}"'
