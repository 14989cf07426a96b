"""Cocircuits of a wrench matrix: the vectors of its row space with the fewest components that are not zero.

They decide what cables can do. A wrench w is given by tensions within limits, W t = w, with a distance s from all
limits, if and only if for each cocircuit y and any tensions t0 with W t0 = w the product y . t0 is far enough from
what the limits allow (hyperplane shifting: Bouchard, Gosselin and Moore 2010; Gouttefarde and Krut 2010). Every wrench
can be resisted if and only if the rank is full and each cocircuit has components of both signs.

One lane a pose: all numbers here are arrays (...) of any one shape.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from jax import Array

from cspr_jax.arithmetic.lanes import cross, dot

CABLES = 6  # of a base block, in two groups of three


class Cocircuit(NamedTuple):
    """One of them, of any length; its negative counts as well.

    Fields:
        entries: by cable, those that need not be zero.
        products: for each wrench y . t0, where W t0 is the wrench.
    """

    entries: Mapping[int, Array]
    products: Sequence[Array]


class Block(NamedTuple):
    """Tensions of six cables for some wrenches, times a common number.

    Fields:
        tensions: for each wrench six, in the order of the block.
        common: what they are multiplied by: the cube of a volume and the determinant of the block.
    """

    tensions: Sequence[Sequence[Array]]
    common: Array


def direct(columns: Sequence[Sequence[Array]], wrenches: Sequence[Sequence[Array]]) -> Iterator[Cocircuit]:
    """Cocircuits of up to three components, from the normals to dof - 1 columns.

    Args:
        columns: of the wrench matrix, one a cable, of dof components each.
        wrenches: of dof components each.

    Yields:
        one for each choice of dof - 1 cables; of columns that are parallel all is 0.
    """
    dof = len(columns[0])
    for chosen in itertools.combinations(range(len(columns)), dof - 1):
        normal = _normal([columns[k] for k in chosen], columns[0])
        rest = [k for k in range(len(columns)) if k not in chosen]
        yield Cocircuit({k: _product(normal, columns[k]) for k in rest}, [_product(normal, w) for w in wrenches])


def _normal(columns: Sequence[Sequence[Array]], like: Sequence[Array]) -> Sequence[Array]:
    if not columns:
        return (0.0 * like[0] + 1.0,)
    if len(columns) == 1:
        return (-columns[0][1], columns[0][0])
    return cross(*columns)


def _product(a: Sequence[Array], b: Sequence[Array]) -> Array:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def block(columns: Sequence[Sequence[Array]], wrenches: Sequence[Sequence[Array]]) -> Block:
    """Tensions of six cables by adjugates, the cables in two groups of three; no division.

    Args:
        columns: six, of three forces and three moments each; the forces of the first three should span space.
        wrenches: of six components each.

    Returns:
        the tensions.
    """
    a, c = [column[:3] for column in columns[:3]], [column[3:] for column in columns[:3]]
    adjugate = (cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1]))
    volume = dot(a[0], adjugate[0])

    def reduced(six):
        # What the first three give to cancel the force, times the volume, and the moment that is then left.
        given = [dot(row, six[:3]) for row in adjugate]
        left = tuple(volume * six[3 + i] - sum(c[j][i] * given[j] for j in range(3)) for i in range(3))
        return given, left

    pulls, lefts = zip(*[reduced(column) for column in columns[3:]], strict=True)
    inner = (cross(lefts[1], lefts[2]), cross(lefts[2], lefts[0]), cross(lefts[0], lefts[1]))
    determinant = dot(lefts[0], inner[0])
    tensions = []
    for wrench in wrenches:
        given, left = reduced(wrench)
        last = [dot(row, left) for row in inner]
        first = [given[j] * determinant - sum(pulls[n][j] * last[n] for n in range(3)) for j in range(3)]
        tensions.append([*first, *(volume * x for x in last)])
    return Block(tensions, volume * determinant)


def by_block(
    columns: Sequence[Sequence[Array]], wrenches: Sequence[Sequence[Array]], order: Sequence[int]
) -> tuple[Iterator[Cocircuit], Array]:
    """Cocircuits of six components and six to eight cables, from what pulls on nothing.

    Args:
        columns: of the wrench matrix, one a cable.
        wrenches: of six components each.
        order: the cables, the six of the base block first, of these three whose forces span space.

    Returns:
        the cocircuits, scaled so that their entries are products of as many unit columns; (...) what they are divided
        by, near 0 where the base block is singular: nothing of them can be trusted there.
    """
    base, others = order[:CABLES], order[CABLES:]
    found = block([columns[k] for k in base], [*[columns[k] for k in others], *wrenches])
    # Row k of the null space: how cable k changes with the tension of each further cable.
    null = {k: [tensions[i] for tensions in found.tensions[: len(others)]] for i, k in enumerate(base)}
    for i, k in enumerate(others):
        null[k] = [-found.common if i == j else 0.0 * found.common for j in range(len(others))]
    inverse = 1.0 / found.common
    particular = [{k: tensions[i] * inverse for i, k in enumerate(base)} for tensions in found.tensions[len(others) :]]
    return _relations(null, others, particular), found.common


def _relations(
    null: Mapping[int, Sequence[Array]], others: Sequence[int], particular: Sequence[Mapping[int, Array]]
) -> Iterator[Cocircuit]:
    cables = sorted(null)
    freedom = len(others)
    products = _products(null, cables) if freedom == 2 else {}
    for chosen in itertools.combinations(cables, freedom + 1):
        if freedom == 0:
            entries = {chosen[0]: 0.0 * particular[0][chosen[0]] + 1.0}
        elif freedom == 1:
            i, j = chosen
            entries = {i: null[j][0], j: -null[i][0]}
        else:
            i, j, k = chosen
            entries = {i: products[j, k], j: -products[i, k], k: products[i, j]}
        held = [k for k in entries if k not in others]
        yield Cocircuit(entries, [_total(entries, tensions, held) for tensions in particular])


def _products(null: Mapping[int, Sequence[Array]], cables: Sequence[int]) -> dict[tuple[int, int], Array]:
    return {(i, j): null[i][0] * null[j][1] - null[i][1] * null[j][0] for i, j in itertools.combinations(cables, 2)}


def _total(entries: Mapping[int, Array], tensions: Mapping[int, Array], held: Sequence[int]) -> Array:
    # Further cables have no tension in it.
    if not held:
        return 0.0 * next(iter(entries.values()))
    total = entries[held[0]] * tensions[held[0]]
    for k in held[1:]:
        total = total + entries[k] * tensions[k]
    return total
