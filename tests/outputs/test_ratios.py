"""Pictures of the ratio of a quantity of two maps."""

from pathlib import Path

import numpy as np
import pytest
from support.reading import read_here

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.plots.maps.ratio import ratio_of
from cspr_jax.store.reading.result import open_result
from outputs.test_pictures import bar, made

FREE = {"x": [0.0, 1.0, 2.0], "y": [0.0, 1.0], "z": [1.0]}
ARCS = {"y": [0.0, 1.0], "x": [0.0, 1.0, 2.0], "z": [1.0], "z0": [1.7]}
OVER = np.array([[1.0, 2.0], [np.nan, 4.0], [5.0, 6.0]])
UNDER = np.array([[2.0, 2.0], [2.0, np.nan], [0.0, 4.0]])


@pytest.fixture(autouse=True)
def files_are_read_here(monkeypatch):
    """By this process; how another one reads them is for reliability/test_hostile_results.py."""
    read_here(monkeypatch)


def files(path: Path):
    """A map of free motions, and one of arcs with its axes in another order and one more."""
    free = {"duration": OVER[..., None], "lower_bound": 0.5 * OVER[..., None]}
    trajectory = {"family": "free", "from": {"position": [0.1, 0.0, 1.0]}}
    return [
        made(path / "free.h5", FREE, free, "least-time", trajectory=trajectory),
        made(path / "arcs.h5", ARCS, {"duration": UNDER.T[..., None, None]}),
    ]


def test_ratio_of_cells(tmp_path):
    paths = files(tmp_path)
    ratio = ratio_of([open_result(path) for path in paths], [str(path) for path in paths], None)
    expected = [[0.5, 1.0], [np.nan, np.nan], [np.nan, 1.5]]
    np.testing.assert_array_equal(ratio.data["ratio"][..., 0], expected)
    figure = cspr_jax.plot(paths, ratio=True)
    assert bar(figure).get_ylabel().startswith("duration, over that of ")
    np.testing.assert_allclose(
        cspr_jax.plot(paths[::-1], ratio=True, quantity="duration")
        .axes[0]
        .collections[0]
        .get_array()
        .compressed()
        .max(),
        2.0,
    )


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"quantity": "margin"}, '--quantity = "margin": must be one that both maps have (duration)'),
        ({"solid": True}, "absent with --ratio"),
    ],
)
def test_what_has_no_ratio(tmp_path, keys, message):
    with pytest.raises(ConfigError) as caught:
        cspr_jax.plot(files(tmp_path), ratio=True, **keys)
    text = str(caught.value)
    assert message in text and "\n" not in text


def test_maps_over_other_cells(tmp_path):
    paths = [made(tmp_path / f"{x}.h5", {"x": [0.0, x], "y": [0.0, 1.0], "z": [1.0], "z0": [1.4]}) for x in (1.0, 2.0)]
    for chosen in (paths, paths[:1]):
        with pytest.raises(ConfigError, match="absent but for two maps"):
            cspr_jax.plot(chosen, ratio=True)
