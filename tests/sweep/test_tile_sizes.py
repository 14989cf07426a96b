"""Tiles of sweeps: equal parts of a grid, by what cells cost; not so few that a killed run loses much."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.tiles import LARGEST_TILE, Tiling, tile_shape
from cspr_jax.sweep import tile_sizes
from cspr_jax.sweep.definition import sweep_of

MAP = {
    "schema": 1,
    "map": "minimum-arcs",
    "robot": "prototype",
    "axes": {
        "x": {"start": -1.5, "stop": 1.5, "count": 81},
        "y": {"start": -1.5, "stop": 1.5, "count": 81},
        "z": {"start": 0.7, "stop": 3.2, "count": 15},
        "z0": [1.7],
    },
    "trajectory": {"family": "hypocycloid-standard", "from": {"position": [0.7, 0.7, 3.0]}},
}
SPEED = {"limits": {"cable_speed_max": 2.5, "tension_max": 5.0}}
UNCERTAIN = {"limits": {"uncertainty": {"mass_factor": 1.05}}}


def sweep(**changes):
    return sweep_of(MAP | changes, Path("map.toml"), text="")


@given(st.lists(st.integers(1, 300), min_size=1, max_size=4).map(tuple), st.integers(1, LARGEST_TILE))
def test_tiles_are_equal_parts(shape, most):
    """No more cells than allowed; along each axis no part is so short that one less would do."""
    tile = tile_shape(shape, most)
    assert math.prod(tile) <= most
    for length, part in zip(shape, tile, strict=True):
        assert 1 <= part <= length
        assert -(-length // part) * part - length < -(-length // part)


def test_a_map_with_limits_has_many_tiles():
    """98,415 cells: two tiles without limits, more with some, a score with what costs most."""
    assert len(sweep().grid.tiling) == 2
    assert 2 < len(sweep(**SPEED).grid.tiling) < 20
    limited = sweep(**UNCERTAIN)
    assert 20 <= len(limited.grid.tiling) <= 60
    seconds = tile_sizes.cell_seconds(limited.kind, limited.spec)
    assert 20.0 <= seconds * math.prod(limited.grid.tile) <= 60.0
    more_arcs = sweep(**UNCERTAIN, trajectory=MAP["trajectory"] | {"max_arcs": 60})
    assert len(more_arcs.grid.tiling) > len(limited.grid.tiling)


def test_long_runs_have_a_score_of_tiles_and_short_ones_fewer():
    limited = sweep(**UNCERTAIN)
    for cells in (1, 100, 2_000, 50_000, 10**7):
        tile = tile_sizes.tile_cells(limited.kind, limited.spec, cells)
        seconds = tile_sizes.cell_seconds(limited.kind, limited.spec)
        assert seconds * (tile - 1) <= tile_sizes.TILE_SECONDS
        if cells * seconds > tile_sizes.FEWEST_TILES * tile_sizes.SHORTEST_SECONDS:
            assert cells / tile >= tile_sizes.FEWEST_TILES - 1


@pytest.mark.parametrize("name", MAP_KINDS)
def test_every_kind_of_map_has_a_cost(name):
    cost = MAP_KINDS[name].cost
    assert cost.seconds > 0.0 and cost.orientation >= 0.0 and cost.limits >= 0.0


def test_a_tile_of_the_file_is_taken_as_it_is():
    tiled = sweep(run={"tile": [3, 81, 15, 1]})
    assert tiled.grid.tile == (3, 81, 15, 1)
    assert len(Tiling(tiled.grid.shape, tiled.grid.tile)) == 27


def test_which_maps_a_gpu_computes():
    """Large ones by formulas for all cells at once: not small ones, searches in many steps, nor platforms' sets."""
    assert sweep().prefers_cpu  # 98,415 cells
    large = sweep(axes=MAP["axes"] | {"z0": [1.7, 1.8]})
    assert not large.prefers_cpu
    axes = {name: {"start": 0.5, "stop": 1.5, "count": 50} for name in "xyz"}
    path = {"family": "path", "from": {"position": [0.1, 0.0, 1.5]}}
    assert sweep(map="least-time", axes=axes, trajectory=path, limits={"tension_max": 3.0}).prefers_cpu
