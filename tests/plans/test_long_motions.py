"""Tables that are too long to be held: checked window by window as they are as a whole; nothing is written of them."""

import numpy as np
import pytest
from support.commands import cspr, strict_json

import cspr_jax
from cspr_jax.config.motions import text
from cspr_jax.plans import long_motions
from cspr_jax.store.reading import motion_samples

LIMITS = {"cable_speed_max": 0.015}


@pytest.fixture
def table(tmp_path, monkeypatch):
    """A table of 1,501 rows where 500 are many, and windows have 400."""
    times = np.linspace(0.0, 30.0, 1501)
    fraction = np.clip(np.minimum(times, 30.0 - times) / 6.0, 0.0, 1.0)
    ends = fraction**3 * (10.0 - 15.0 * fraction + 6.0 * fraction**2)
    turn = times * (1.0 + times / 60.0)  # the fastest part is not in the first window
    places = np.stack([0.1 * ends * np.cos(turn), 0.1 * ends * np.sin(turn), 1.0 + 0.0 * times], axis=1)
    path = tmp_path / "own.csv"
    np.savetxt(path, np.column_stack([times, places]), fmt="%.17g", delimiter=",", header="t,x,y,z", comments="")
    (tmp_path / "limits.toml").write_text("cable_speed_max = 0.015\n")
    whole = cspr_jax.check("prototype", path, limits=LIMITS)
    monkeypatch.setattr(text, "MAX_ROWS", 500)
    monkeypatch.setattr(long_motions, "motion_windows", lambda path: motion_samples.motion_windows(path, 400))
    return path, whole


def test_windows_are_checked_as_the_whole(table):
    path, whole = table
    check = cspr_jax.check("prototype", path, limits=LIMITS)
    assert check.verdict == whole.verdict == "cable_too_fast" and check.plan.legs[0].motions == []
    np.testing.assert_allclose(check.failing, whole.failing, atol=2e-6)
    assert check.margin == pytest.approx(whole.margin, rel=0.02) and check.duration == pytest.approx(30.0)
    for key in ("interpolation", "ends"):
        assert check.to_dict()[key] == whole.to_dict()[key] in ("cubic", "rest")
    for name in ("tension_max", "cable_length_max", "cable_speed_max"):
        assert check.to_dict()[name] == pytest.approx(whole.to_dict()[name], rel=1e-3)
    margins = [each.plan.demands.tension_margin[0] for each in (check, whole)]
    assert margins[0] == pytest.approx(margins[1], rel=0.02)
    time = check.cause[0]["t"]
    assert any(start <= time <= end for start, end in check.failing) and abs(time - whole.cause[0]["t"]) < 0.1
    assert check.cause[0]["needed"] == pytest.approx(whole.cause[0]["needed"], rel=5e-3)


def test_nothing_is_written_of_them(table, monkeypatch):
    path, _ = table
    options = ("check", path, "--robot", "prototype", "--limits", path.with_name("limits.toml"))
    code, out, _ = cspr(*options, "--json")
    assert code == 1 and strict_json(out)["verdict"] == "cable_too_fast"
    for more in (("-o", path.with_name("out.csv")), ("--slower",), ("--animate", path.with_name("film.gif"))):
        with monkeypatch.context() as patch:
            patch.setattr(long_motions, "motion_windows", None)  # it is refused before the work
            code, out, err = cspr(*options, *more)
        assert (code, out) == (2, "") and err.count("\n") == 1 and "too long to be held" in err
    code, out, err = cspr(*options, "--smooth", "0.001")
    assert (code, out) == (2, "") and err.count("\n") == 1 and "smooth" in err
    path.with_name("limits.toml").write_text("uncertainty = { spool_positions = 0.001 }\n")
    code, out, err = cspr(*options)
    assert (code, out) == (2, "") and err.count("\n") == 1 and "uncertainty" in err
