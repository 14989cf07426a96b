"""Motions chosen from many, by indices and by a mask, from NumPy's arrays and from jax's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cspr_jax.families.platforms.platform_segment import Motions, take_segments

LEAVES = {"angle": np.arange(5.0), "pose": np.arange(60.0).reshape(5, 4, 3)}


@pytest.mark.parametrize("of", [np.asarray, jnp.asarray])
@pytest.mark.parametrize("which", [np.array([3, 0, 3]), np.array([True, False, False, True, True]), [4], 2])
def test_rows_are_those_of_an_index(of, which):
    found = take_segments(jax.tree.map(of, LEAVES), which)
    for name, leaf in LEAVES.items():
        np.testing.assert_array_equal(found[name], leaf[which])


def test_motions_keep_their_numbers_of_arcs():
    chosen = Motions(LEAVES, np.arange(10, 15)).take(LEAVES["angle"] > 2.0)
    np.testing.assert_array_equal(chosen.arcs, [13, 14])
    np.testing.assert_array_equal(chosen.segments["angle"], [3.0, 4.0])
