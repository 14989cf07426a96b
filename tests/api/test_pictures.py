"""Pictures from Python: those of the command."""

import pytest
from outputs.test_outputs import cspr, made

import cspr_jax


@pytest.mark.thorough
def test_pictures(tmp_path, capsys):
    """The same bytes as the command's; no file where none is asked for."""
    path = made(tmp_path / "map.h5")
    cspr(capsys, "plot", path, "--quantity", "margin", "--at", "z=1.0", "--size", "12x9", "-o", tmp_path / "told.png")
    choices = {"quantity": "margin", "at": {"z": 1.0}}
    for given in (str(path), [cspr_jax.open_result(path)]):
        figure = cspr_jax.plot(given, **choices, size=(12, 9), output=tmp_path / "mine.png")
        assert (tmp_path / "mine.png").read_bytes() == (tmp_path / "told.png").read_bytes()
        assert "margin" in figure.get_suptitle() or "pseudotension" in figure.get_suptitle()
    before = set(tmp_path.iterdir())
    figure = cspr_jax.plot(path, size="12x9")
    assert set(tmp_path.iterdir()) == before and tuple(figure.get_size_inches() * 2.54) == pytest.approx((12, 9))
    results = [cspr_jax.open_result(path), cspr_jax.open_result(made(tmp_path / "other.h5"))]
    (panel,) = cspr_jax.plot(results, at={"x": 1.5, "y": 0.5}).axes
    assert [line.get_label() for line in panel.lines] == ["result 1", "result 2"]
