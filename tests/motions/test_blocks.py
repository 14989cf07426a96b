"""Blocks of motions: they cover all of time, are cut at the knots, and are shorter where motions swing farther."""

import jax
import numpy as np
import pytest

from cspr_jax.families.platforms.six_cable_proof.work_list import smallest_nodes
from cspr_jax.motion.amplitudes import from_polynomial, named
from cspr_jax.verification.bounds.blocks import SAMPLES, Parts, growing, parts_of_arcs

AMPLITUDES = {
    "quintic": named("quintic"),
    "effective": named("effective", 0.07),
    "overshoots": from_polynomial([0.0, 0.0, 0.0, 60.0, -165.0, 156.0, -50.0]),
}
RAMPS = (1.0, 5.0), (2.0, 9.0)


@pytest.mark.parametrize("name", AMPLITUDES)
@pytest.mark.parametrize("how", ["equal", "growing", "few"])
def test_blocks_cover_all_of_time(name, how):
    """One after the other from 0 to 1, no knot inside, those of a motion side by side."""
    amplitude = AMPLITUDES[name]
    knots = np.asarray(amplitude.knots)
    few = growing(amplitude, (0.5, 0.3), (0.01, 0.02))
    parts = {"equal": 3, "growing": growing(amplitude, *RAMPS), "few": few}[how]
    arcs = np.array([1, 7, 2, 30, 7])
    blocks = parts_of_arcs(arcs, knots, parts)
    assert (np.diff(blocks.row) >= 0).all() and set(blocks.row) == set(range(len(arcs)))
    for row, p in enumerate(arcs):
        own = blocks.part(blocks.row == row)
        edges = np.append(own.start, own.stop[-1])
        assert edges[0] == 0.0 and edges[-1] == 1.0 and (np.diff(edges) > 0.0).all()
        np.testing.assert_array_equal(own.start[1:], own.stop[:-1])
        assert np.isin(knots, edges).all()
        wanted = p * (parts if how == "equal" else np.mean(parts.of(p)))
        assert wanted - len(knots) - 1.0 <= len(own.row) <= wanted + 2.0 * (len(knots) + 1.0)


def test_parts_grow_with_the_amplitude():
    """The ramps at the values of A themselves, and blocks that are longer where fewer parts are asked for."""
    amplitude = AMPLITUDES["effective"]
    tau = np.linspace(0.0, 1.0, SAMPLES)
    parts, values = growing(amplitude, *RAMPS), np.asarray(amplitude.at(tau))
    np.testing.assert_allclose(parts.at_cusps, 1.0 + 4.0 * values, atol=1e-12)
    np.testing.assert_allclose(parts.at_middles, 2.0 + 7.0 * values, atol=1e-12)
    blocks = parts_of_arcs(np.array([12]), np.asarray(amplitude.knots), parts)
    lengths, middles = 12.0 * (blocks.stop - blocks.start), 0.5 * (blocks.start + blocks.stop)
    late = (middles > 0.75) & (middles < 0.93)
    cusp = late & (np.abs(np.mod(12.0 * middles + 0.5, 1.0) - 0.5) < 0.1)
    middle = late & (np.abs(np.mod(12.0 * middles, 1.0) - 0.5) < 0.1)
    each = [np.interp(middles[which], tau, 1.0 / parts.of(12)) for which in (cusp, middle)]
    for which, wanted in zip((cusp, middle), each, strict=True):
        assert which.any()
        np.testing.assert_allclose(lengths[which], wanted, rtol=0.25)
    assert lengths[cusp].min() > 1.3 * lengths[middle].max()
    assert lengths[middles < 0.1].max() > 2.0 * lengths[late].max()


@pytest.mark.parametrize("arcs", [1, 2, 5, 20])
def test_parts_of_an_arc_between_cusps(arcs):
    """Cusps are where an arc ends: whole numbers of arcs, whether that is odd or even."""
    parts = Parts(np.full(SAMPLES, 2.0), np.full(SAMPLES, 6.0)).of(arcs)
    at = np.interp(np.arange(2 * arcs + 1) / (2.0 * arcs), np.linspace(0.0, 1.0, SAMPLES), parts)
    np.testing.assert_allclose(at[::2], 2.0, atol=0.01)
    np.testing.assert_allclose(at[1::2], 6.0, atol=0.01)


def test_least_values_and_where_the_worst_is():
    """Of each criterion over all nodes, also of the last, which is no slack."""
    rng, places = np.random.default_rng(0), np.array([-1.0, -0.2, 0.5, 1.0])
    nodes = rng.normal(size=(3, 4, 200))
    nodes[0, 2, 5] = np.nan
    nodes[0, 1:3, 7] = -9.0  # the first of equal ones
    least, place = jax.jit(lambda x: smallest_nodes(x, 2, places))(list(nodes))
    np.testing.assert_array_equal(least, nodes.min(1)[None])
    worst = np.minimum(nodes[0], nodes[1])
    wanted = np.where(np.isnan(worst).any(0), np.nan, places[worst.argmin(0)])
    np.testing.assert_array_equal(place, wanted)
    assert place[7] == -0.2 and np.isnan(place[5])
