"""Best points of an axis that may be chosen freely, such as z0.

Every cell of the other axes takes all of its quantities from one point of that axis: a feasible point if there is one,
else an undecided one; among several, the point with the fewest arcs, or the best value of the map's main quantity;
among equals, the point with the largest margin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Float
from cspr_jax.schema.meanings import CELL_SIDES
from cspr_jax.schema.quantities import AXES, BEST, QUANTITIES, best_name
from cspr_jax.schema.verdicts import FLAGS, Verdict

# Unless the kind of map names others, these quantities are compared first, then all others that have a better side.
FIRST = ("arcs", "oscillations", "release_speed", "margin")
# Counts in which 0 stands for none; an undecided point may be feasible with fewer.
COUNTS = ("arcs", "oscillations")
_DOUBT = Verdict.UNDECIDED.value | Verdict.FEWER_ARCS_UNDECIDED.value
_INSIDE, _OUTSIDE = CELL_SIDES.index("inside"), CELL_SIDES.index("outside")


class Best(NamedTuple):
    """Arrays reduced over one of their axes, and the indices of the best points on that axis.

    Fields:
        data: arrays by name; `schema.quantities.best_name` is the coordinate of the best point, NaN where none will do.
        indices: (...) index of the best point on the axis, or of the best candidate where none will do.
    """

    data: dict[str, np.ndarray]
    indices: np.ndarray


def check_axis(axis: str, names: Sequence[str]) -> None:
    """Refuse an axis on which no best point can be chosen."""
    allowed = [name for name in names if name not in AXES or best_name(name) in BEST]
    if axis not in allowed:
        raise InputError("--best", axis, f"one of {', '.join(allowed)}" if allowed else "absent: there is no such axis")


def best_of(
    data: Mapping[str, np.ndarray],
    name: str,
    points: Float[np.ndarray, "n"],
    dimension: int,
    pictured: Sequence[str] = (),
) -> Best:
    """Reduce arrays over one of their axes."""
    order = ranked(data, pictured)
    verdict = data.get("verdict")
    if not order and verdict is None:
        raise InputError("--best", name, "absent: no stored quantity says which cell is better")
    sort_keys = [] if verdict is None else [_unfitness(verdict)]
    sort_keys += [_badness(quantity, data[quantity]) for quantity in order]
    indices = np.asarray(np.take(np.lexsort(sort_keys[::-1], axis=dimension), 0, axis=dimension))
    reduced = {quantity: _selected(values, indices, dimension) for quantity, values in data.items()}
    if verdict is not None:
        will_do = _unfitness(reduced["verdict"]) == 0
        reduced["verdict"] = _with_doubt(reduced, verdict, will_do, dimension)
    else:
        will_do = np.isfinite(_badness(order[0], reduced[order[0]]))
    if "cell_side" in data:
        reduced["cell_side"] = _side(data["cell_side"], dimension)
    chosen = np.where(will_do, np.asarray(points, float)[indices], np.nan)
    return Best({best_name(name): chosen} | reduced, indices)


def ranked(names: Mapping[str, np.ndarray], pictured: Sequence[str] = ()) -> list[str]:
    """Quantities by which cells are compared, in order."""
    order = dict.fromkeys((*pictured, *FIRST, *QUANTITIES))
    return [name for name in order if name in names and QUANTITIES[name].better]


def _unfitness(verdict: np.ndarray) -> np.ndarray:
    # Rank: 0: feasible, perhaps with fewer arcs; 1: undecided; 2: not feasible; 3: not even accessible.
    flags = verdict.astype(np.int64)
    rank = np.where(flags & Verdict.UNDECIDED.value, 1, np.where(flags & Verdict.NOT_ACCESSIBLE.value, 3, 2))
    return np.where(flags & ~Verdict.FEWER_ARCS_UNDECIDED.value, rank, 0)


def _badness(name: str, values: np.ndarray) -> np.ndarray:
    # A number that is smaller for better values; infinite without a value.
    drawn = values.astype(float)
    worse = drawn if QUANTITIES[name].better == "smaller" else -drawn
    is_none = np.isnan(drawn) | ((drawn <= 0.0) if name in COUNTS else False)
    return np.where(is_none, np.inf, worse)


def _selected(values: np.ndarray, indices: np.ndarray, dimension: int) -> np.ndarray:
    where = np.expand_dims(indices, dimension)
    where = where.reshape(*where.shape, *[1] * (values.ndim - where.ndim))
    return np.take_along_axis(values, where, axis=dimension).squeeze(dimension)


def _with_doubt(reduced: dict[str, np.ndarray], verdict: np.ndarray, will_do: np.ndarray, dimension: int) -> np.ndarray:
    # An undecided point may turn out feasible with fewer arcs than the best feasible point.
    count = next((reduced[name] for name in COUNTS if name in reduced), None)
    if count is None:
        return reduced["verdict"]
    doubtful = will_do & (count > 1) & ((verdict.astype(np.int64) & _DOUBT) != 0).any(dimension)
    fewer = np.where(doubtful, Verdict.FEWER_ARCS_UNDECIDED.value, 0).astype(FLAGS)
    return reduced["verdict"] | fewer


def _side(sides: np.ndarray, dimension: int) -> np.ndarray:
    # A cell is proved inside if it is for some point, and outside if it is for every point.
    is_inside, is_outside = (sides == _INSIDE).any(dimension), (sides == _OUTSIDE).all(dimension)
    return np.where(is_inside, _INSIDE, np.where(is_outside, _OUTSIDE, 0)).astype(sides.dtype)
