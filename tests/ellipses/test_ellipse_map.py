"""Maps of ellipses: cells are what formulas and plans say; symmetry, tiles, limits, pictures, lines of mistakes."""

import dataclasses
import json

import numpy as np
import pytest
from support.commands import cspr

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.families.ellipses import map as ellipse_map
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.schema.verdicts import Verdict

HEAD = {"schema": 1, "map": "ellipse", "robot": "prototype", "trajectory": {"family": "ellipse"}}
# Level and equilateral, of radius 1, as in the check of the theory.
UNIT = {
    "name": "unit",
    "base_points": [[1.0, 0.0, 0.0], [-0.5, 0.75**0.5, 0.0], [-0.5, -(0.75**0.5), 0.0]],
    "mass": 1.0,
}
FOUR = {"name": "four", "base_points": [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0.0]], "mass": 2.0, "z_axis": "up"}
# One spool is out of the plane of the others.
BENT = FOUR | {"name": "bent", "base_points": [[1, 1, 0], [-1, 1, 0.3], [-1, -1, 0], [1, -1, 0.0]]}
PLANAR = {"name": "planar", "base_points": [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "mass": 1.0, "planar": True}
# As flat as this, slower is always better.
SLOW = HEAD | {
    "axes": {"x": [0.0, 0.05], "y": [-0.05], "z": [0.3], "scale": [0.02], "tilt": [1.4]},
    "ellipse": {"half_axes": [[1.0, 0.0, 0.0], [0.0, 0.1, 0.0]]},
}


def mapped(**changes):
    return cspr_jax.compute_sweep(HEAD | changes)


def cells_of(result):
    values = {name: data.values for name, data in result.data_vars.items()}
    names = list(result.verdict.dims)
    for index in np.ndindex(*(result.sizes[name] for name in names)):
        place = {name: float(result[name].values[i]) for name, i in zip(names, index, strict=True)}
        yield place, {name: data[index] for name, data in values.items()}


def half_axes(place, a, b):
    """By matrices: Z_phi X_theta Z_-phi, in the axes of the file."""
    (c, s), (cos, sin) = (
        (np.cos(angle), np.sin(angle)) for angle in (place.get("tilt_azimuth", 0.0), place.get("tilt", 0.0))
    )
    about = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turn = about @ np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]]) @ about.T
    size = place.get("circle_radius", place.get("scale", 1.0))
    return size * turn @ a, size * turn @ b


CASES = {
    "circles": (
        {
            "axes": {"x": [0.0, 0.08, 0.3], "y": [-0.04], "z": [0.5, -0.2], "circle_radius": [0.1, 0.7]}
            | {"tilt": [0.0, 0.6], "tilt_azimuth": [0.7]}
        },
        np.array([1.0, 0.0, 0.0]),
        np.array([0.0, 1.0, 0.0]),
    ),
    "redundant, z up": (
        {
            "robot": FOUR,
            "axes": {
                "x": [0.2, 1.2],
                "y": [0.6],
                "z": [-1.5],
                "scale": [0.5, 2.0],
                "tilt": [0.2],
                "tilt_azimuth": [0.7],
            }
            | {"frequency": [1.0, 2.5, 4.0]},
            "ellipse": {"half_axes": [[0.5, 0.0, 0.0], [0.0, 0.3, 0.1]]},
        },
        np.array([0.5, 0.0, 0.0]),
        np.array([0.0, 0.3, 0.1]),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_cells_are_what_the_formulas_say(name):
    sweep, a, b = CASES[name]
    result = mapped(**sweep)
    robot = (
        cspr_jax.load_robot("prototype")
        if "robot" not in sweep
        else cspr_jax.point_mass(np.array(FOUR["base_points"]), mass=2.0, z_axis="up")
    )
    places, values = zip(*cells_of(result), strict=True)
    centres = np.array([[place[axis] for axis in "xyz"] for place in places])
    axes = np.array([half_axes(place, a, b) for place in places])
    intervals = cspr_jax.ellipse_frequencies(robot, centres, axes[:, 0], axes[:, 1])
    used = np.array([value["used_frequency"] for value in values])
    margins = cspr_jax.ellipse_margins(robot, centres, axes[:, 0], axes[:, 1], np.nan_to_num(used, nan=1.0))
    feasible = 0
    for place, value, interval, margin in zip(places, values, intervals, margins, strict=True):
        ends = interval[0] if len(interval) else [np.nan, np.nan]
        np.testing.assert_allclose([value["lowest_frequency"], value["highest_frequency"]], ends, rtol=1e-12)
        assert (value["verdict"] == 0) == (margin > 0.0 and bool(len(interval)))
        if np.isfinite(value["used_frequency"]):
            assert value["margin"] == pytest.approx(margin, rel=1e-12, abs=1e-13)
            assert value["duration"] == pytest.approx(2.0 * np.pi / value["used_frequency"])
        if "frequency" in place:
            assert value["used_frequency"] == place["frequency"]
        elif len(interval):
            # No other frequency has a larger margin.
            others = np.linspace(ends[0], min(ends[1], 20.0), 400)
            at = cspr_jax.ellipse_margins(
                robot, *(np.repeat(x[None], 400, 0) for x in half_axes_of(place, a, b)), others
            )
            assert at.max() <= value["margin"] + 1e-12
        feasible += value["verdict"] == 0
    assert 0 < feasible < len(values)


def half_axes_of(place, a, b):
    return (np.array([place[axis] for axis in "xyz"]), *half_axes(place, a, b))


def test_circles_about_p0_have_the_numbers_of_the_theory():
    """Level spools at radius 1, 2 m above, g = 9.81: 1.56605 to 2.71247 rad/s at R = 1, from 0 at R = 0.5."""
    result = mapped(robot=UNIT, axes={"x": [0.0], "y": [0.0], "z": [2.0], "circle_radius": [0.4, 0.5, 1.0]})
    low, high = result.lowest_frequency.values.ravel(), result.highest_frequency.values.ravel()
    np.testing.assert_allclose(low, [0.0, 0.0, 1.56605], atol=1e-5)
    np.testing.assert_allclose(high[2], 2.71247, atol=1e-5)
    np.testing.assert_allclose(result.natural_frequency.values, 2.21472, atol=1e-5)
    np.testing.assert_allclose(result.used_frequency.values, 4.905**0.5, rtol=1e-12)
    wave = mapped(
        robot=UNIT,
        axes={"x": [0.0], "y": [0.0], "z": [2.0], "circle_radius": [0.3, 1.5], "frequency": [1.0, 2.0, 3.0]},
    )
    radius, rate = (wave[name].values for name in ("circle_radius", "frequency"))
    margin = 1.0 - 2.0 * radius[:, None] * np.abs(1.0 - rate**2 * 2.0 / 9.81)
    np.testing.assert_allclose(wave.margin.values[0, 0, 0], margin, rtol=1e-12, atol=1e-12)
    assert np.array_equal(wave.verdict.values[0, 0, 0] == 0, margin > 0.0)


def test_a_point_turns_at_any_frequency_and_best_at_the_natural_one():
    result = mapped(axes={"x": [0.05], "y": [0.0], "z": [1.0], "circle_radius": [0.0]})
    _, values = next(cells_of(result))
    assert (values["lowest_frequency"], values["highest_frequency"], values["verdict"]) == (0.0, np.inf, 0)
    assert values["used_frequency"] == pytest.approx(values["natural_frequency"], rel=1e-12)
    assert (
        cell_plan(json.loads(result.attrs["settings"]), {"x": 0.05, "y": 0.0, "z": 1.0, "circle_radius": 0.0}, {})
        is None
    )


def test_maps_have_the_symmetry_of_the_robot():
    """A third of a turn, and a mirror that exchanges cables 1 and 2, of level circles."""
    third = 2.0 * np.pi / 3.0
    around = [0.3, 0.3 + third, 0.3 + 2.0 * third, np.pi - 0.3]
    result = mapped(
        axes={"radius": [0.05, 0.12], "azimuth": around, "z": [1.0], "circle_radius": [0.1, 0.6]}
        | {"frequency": [2.5, 3.4]}
    )
    for name in ("verdict", "margin", "lowest_frequency", "highest_frequency", "natural_frequency"):
        values = result[name].values
        for other in range(1, 4):
            np.testing.assert_allclose(values[:, other], values[:, 0], rtol=1e-9, atol=1e-12, err_msg=name)
    cables = result.binding_cable.values
    assert np.array_equal(cables[:, 3], np.array([0, 2, 1, 3, 4])[cables[:, 0]])
    assert len(np.unique(cables)) > 1 and 0 < (result.verdict.values == 0).mean() < 1


def test_the_binding_cable_is_the_one_of_the_smallest_tension():
    """By a balance of forces at 720 instants; on redundant cables the two that alone keep a tension."""
    result = mapped(axes={"x": [-0.08, 0.02, 0.1], "y": [-0.03, 0.06], "z": [0.8], "circle_radius": [0.4]})
    spools = np.asarray(cspr_jax.load_robot("prototype").base_points)
    angle = np.linspace(0.0, 2.0 * np.pi, 720)[:, None]
    out = np.cos(angle) * [1.0, 0.0, 0.0] + np.sin(angle) * [0.0, 1.0, 0.0]
    for place, values in cells_of(result):
        at = np.array([place[axis] for axis in "xyz"]) + place["circle_radius"] * out
        needed = -(values["used_frequency"] ** 2) * place["circle_radius"] * out - [0.0, 0.0, 9.81]
        fraction = np.linalg.solve(np.swapaxes(spools - at[:, None], 1, 2), needed[..., None])[..., 0]
        least = fraction.min(0)
        assert least[values["binding_cable"] - 1] <= least.min() * (1.0 + 1e-3)
    four = mapped(robot=FOUR, axes={"x": [0.7], "y": [0.2], "z": [-1.5], "circle_radius": [0.5], "frequency": [2.0]})
    # Towards x = 1 the mass hangs on cables 1 and 4, of which "all but 1, 4" get slack: the third of six pairs.
    assert four.binding_cable.values.ravel().tolist() == [3]
    assert four.binding_cable.attrs["flag_meanings"].split()[3] == "all_but_1_4"


LIMITED = {
    "axes": {"x": [0.0, 0.06], "y": [0.03], "z": [1.0], "circle_radius": [0.1, 0.6], "tilt": [0.0, 0.3]},
    "ellipse": {"frequency": {"hertz": 0.5}},
    "limits": {"tension_max": 1.3, "cable_speed_max": 0.4, "floor": 1.14},
}
PLANS = {
    "formulas": {"axes": LIMITED["axes"]},
    "limits": LIMITED,
    "several planes": {
        "robot": BENT,
        "axes": {"x": [0.2], "y": [0.1], "z": [-1.5], "circle_radius": [0.4, 1.5], "frequency": [1.0, 2.5]},
    },
}


@pytest.mark.quick("formulas")
@pytest.mark.parametrize("name", ["formulas", "limits", pytest.param("several planes", marks=pytest.mark.thorough)])
def test_plans_say_what_the_cells_say(name):
    result = mapped(**PLANS[name])
    settings, feasible, count, seen = json.loads(result.attrs["settings"]), 0, 0, [0.0]
    for place, values in cells_of(result):
        planned = cspr_jax.plan(cell_plan(settings, place, values))
        segment = planned.to_dict()["segments"][0]
        count, feasible = count + 1, feasible + planned.feasible
        assert planned.feasible == (values["verdict"] == 0), (place, segment["verdict"])
        assert segment["duration"] == pytest.approx(values["duration"], rel=1e-12)
        if name != "several planes":
            assert segment["pseudotension_margin"] == pytest.approx(values["margin"], rel=1e-12)
        if np.isfinite(values.get("tension_margin", np.nan)):
            assert segment["verdict"] == Verdict(int(values["verdict"])).text
            # Plans refine margins; maps keep bounds of proofs that are as close as their text says.
            usual = np.median(np.abs(planned.rows()["tension"]), axis=0).max()
            more = values["tension_margin"] - segment["margin"]
            assert -1e-9 <= more <= 0.002 * max(abs(segment["margin"]), 0.1 * usual), (place, more)
            seen.append(more)
    assert 0 < feasible < count or name == "formulas"
    assert (max(seen) > 1e-9) == (name == "limits")


def test_slow_turns_have_a_limit():
    """Where slower is always better the verdict is that of turns without speed, limits of tension included."""
    result = cspr_jax.compute_sweep(SLOW)
    (place, values), *_ = cells_of(result)
    assert values["used_frequency"] == 0.0 and values["duration"] == np.inf and values["verdict"] == 0
    assert cell_plan(json.loads(result.attrs["settings"]), place, values) is None
    settings = json.loads(result.attrs["settings"]) | {"ellipse": SLOW["ellipse"] | {"frequency": 0.05}}
    slow = cspr_jax.plan(cell_plan(settings, place, {})).to_dict()["segments"][0]
    assert slow["margin"] > 0.0
    for most, verdict in ((1.3, 0), (0.8, Verdict.OVER_TENSION.value)):
        limited = cspr_jax.compute_sweep(SLOW | {"limits": {"tension_max": most}})
        _, values = next(cells_of(limited))
        assert values["verdict"] == verdict
        needed = min(slow["tension_min"], most - slow["tension_max"])
        assert values["tension_margin"] == pytest.approx(needed, abs=5e-3)


def test_an_edge_is_undecided():
    """At the end of the interval the margin is zero but for rounding, and nothing is claimed."""
    axes = {"x": [0.0], "y": [0.0], "z": [2.0], "circle_radius": [1.0]}
    end = float(mapped(robot=UNIT, axes=axes).highest_frequency.values.ravel()[0])
    at = mapped(robot=UNIT, axes=axes | {"frequency": [end, end * (1.0 - 1e-9), end * (1.0 + 1e-9)]})
    assert at.verdict.values.ravel().tolist() == [Verdict.UNDECIDED.value, 0, Verdict.SLACK_CABLE.value]


def test_where_no_frequency_is_feasible():
    """Beside the spools, as high as they are, and on a circle that rises above them."""
    beside = mapped(axes={"x": [0.5], "y": [0.0], "z": [1.0, -0.5], "circle_radius": [0.1]})
    assert np.isnan(beside.lowest_frequency.values).all() and np.isnan(beside.used_frequency.values).all()
    assert beside.verdict.values.ravel().tolist() == [Verdict.SLACK_CABLE, Verdict.SLACK_CABLE | Verdict.ABOVE_SPOOLS]
    high = mapped(axes={"x": [0.0], "y": [0.0], "z": [0.3], "circle_radius": [0.4], "tilt": [1.2]})
    assert np.isnan(high.margin.values).all() and (high.verdict.values & Verdict.ABOVE_SPOOLS).all()


def test_two_cables_in_a_plane():
    axes = {"x": [0.1], "y": [0.0], "z": [1.0], "circle_radius": [0.3, 0.8]}
    result = mapped(robot=PLANAR, axes=axes)
    robot = cspr_jax.point_mass(np.array(PLANAR["base_points"]), mass=1.0, planar=True)
    for place, values in cells_of(result):
        radius = place["circle_radius"]
        centre = np.array([[0.1, 0.0, 1.0]])
        ((low, high),) = cspr_jax.ellipse_frequencies(robot, centre, [0.0, 0.0, radius], [radius, 0.0, 0.0])[0]
        assert (values["lowest_frequency"], values["highest_frequency"]) == pytest.approx((low, high))


TABLE = """schema = 1
map = "ellipse"
robot = "{robot}"
[axes]
x = {x}
y = {y}
z = [{z}]
{axes}
[trajectory]
family = "ellipse"
{more}
"""
GIVEN = {"robot": "prototype", "x": [0.0, 0.05], "y": [0.0, -0.03], "z": 1.0}
RADII = "circle_radius = { start = 0.0, stop = 0.6, count = 13 }"


def written(folder, **changes):
    folder.mkdir(exist_ok=True)
    (folder / "s.toml").write_text(TABLE.format(**(GIVEN | {"axes": RADII, "more": ""} | changes)))
    return folder / "s.toml"


def test_tiles_change_no_bit_and_results_are_verified(tmp_path):
    limits = "[limits]\ntension_max = 1.5"
    for name, more in (("whole", limits), ("tiles", f"{limits}\n[run]\ntile = [1, 2, 1, 5]")):
        path = written(tmp_path / name, more=more)
        assert cspr("run", path, "-o", tmp_path / name / "run")[::2] == (0, "")
        assert cspr("verify", tmp_path / name / "run")[0] == 0 and cspr("status", tmp_path / name / "run")[0] == 0
    one, other = (cspr_jax.open_result(tmp_path / name / "run" / "s.h5") for name in ("whole", "tiles"))
    for name, values in one.data.items():
        assert np.array_equal(values, other.data[name], equal_nan=True), name
    assert {"tension_margin", "limit_margin"} < set(one.data) and one.units["lowest_frequency"] == "rad s-1"


@pytest.mark.parametrize(
    ("name", "fault", "words"),
    [
        ("verdict", lambda cells: np.zeros_like(cells.verdict), "margin below zero"),
        ("verdict", lambda cells: np.ones_like(cells.verdict), "margin above zero"),
        ("used_frequency", lambda cells: 1.5 * cells.highest_frequency, "out of its interval"),
        ("used_frequency", lambda cells: np.nan * cells.margin, "without a frequency"),
        ("lowest_frequency", lambda cells: 1.1 * cells.natural_frequency, "without the natural frequency"),
        ("tension_margin", lambda cells: np.where(cells.verdict == 0, -0.1, np.nan), "tension out of its limits"),
    ],
)
def test_numbers_that_contradict_each_other_are_refused(tmp_path, monkeypatch, name, fault, words):
    whole = ellipse_map.ellipse_cells

    def broken(*arguments):
        cells = whole(*arguments)
        return dataclasses.replace(cells, **{name: fault(cells)})

    monkeypatch.setattr(ellipse_map, "ellipse_cells", broken)
    path = written(tmp_path, axes="circle_radius = [0.1, 0.4]\nfrequency = [1.0, 3.1]")
    code, _, err = cspr("run", path, "-o", tmp_path / "run", "--workers", 1)
    assert code == 5 and words in err, err


def test_the_picture_of_frequencies(tmp_path, figures):
    """Half of the inradius of 0.26 m is the static limit; the natural frequency is sqrt(g / z)."""
    path = written(tmp_path, x=[0.0], y=[0.0])
    assert cspr("run", path, "-o", tmp_path / "run")[0] == 0
    assert cspr("plot", tmp_path / "run", "-o", tmp_path / "s.png")[0] == 0
    (panel,) = figures[0].axes
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("radius of the circle (m)", "frequency (rad/s)")
    lines = {line.get_label(): line for line in panel.lines}
    np.testing.assert_allclose(lines["natural frequency"].get_ydata(), 9.81**0.5, rtol=1e-12)
    np.testing.assert_allclose(lines["largest margin"].get_ydata(), 9.81**0.5, rtol=1e-9)
    np.testing.assert_allclose(lines["static limit"].get_xdata(), 0.13, rtol=1e-9)
    (below, above) = [line for line in panel.lines if line.get_label().startswith("_")]
    at = np.isin(below.get_xdata(), [0.0, 0.3, 0.6])
    radius = below.get_xdata()[at]
    assert len(radius) == 3
    np.testing.assert_allclose(
        below.get_ydata()[at], 9.81**0.5 * np.sqrt([0.0, 1 - 0.13 / 0.3, 1 - 0.13 / 0.6]), rtol=1e-9
    )
    np.testing.assert_allclose(
        above.get_ydata()[at][1:], 9.81**0.5 * np.sqrt([1 + 0.13 / 0.3, 1 + 0.13 / 0.6]), rtol=1e-9
    )
    assert figures[0].get_suptitle() == "prototype: feasible frequencies\nx = 0 m, y = 0 m, z = 1 m, z axis down"


def test_the_picture_says_what_limits_refuse(tmp_path, figures):
    path = written(tmp_path, x=[0.0], y=[0.0], more="[limits]\ncable_speed_max = 0.3\n[ellipse]\nfrequency = 3.0")
    assert cspr("run", path, "-o", tmp_path / "run")[0] == 0
    assert cspr("plot", tmp_path / "run", "-o", tmp_path / "s.png")[0] == 0
    words = [text.get_text() for text in figures[0].axes[0].get_legend().get_texts()]
    assert words == ["feasible", "natural frequency", "frequency of the sweep", "refused by limits", "static limit"]


def test_the_map_of_margins(tmp_path, figures):
    more = "[ellipse]\nhalf_axes = [[0.3, 0, 0], [0, 0.4, 0]]"
    path = written(tmp_path, axes="tilt = [0.0, 0.2]", more=more)
    assert cspr("run", path, "-o", tmp_path / "run")[0] == 0
    assert cspr("plot", tmp_path / "run", "-o", tmp_path / "s.png")[0] == 0
    assert cspr("plot", tmp_path / "run", "--quantity", "binding_cable", "-o", tmp_path / "b.png")[0] == 0
    title = figures[0].get_suptitle().splitlines()
    assert title[0] == "prototype: smallest normalised pseudotension"
    assert title[1].startswith("half-axes 0.3 m and 0.4 m, at the best frequency, z = 1 m")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"axes": ""}, "ellipse.radius is missing: must be there, or half_axes, or axes.circle_radius"),
        ({"more": "[ellipse]\nradius = 0.2"}, "ellipse.radius: must be absent beside axes.circle_radius"),
        ({"axes": f"{RADII}\nscale = [1.0]"}, "axes.scale: must be absent beside axes.circle_radius"),
        ({"axes": "circle_radius = [-0.1]"}, "axes.circle_radius = -0.1: must be a number >= 0"),
        ({"axes": f"{RADII}\nfrequency = [0.0]"}, "axes.frequency = 0.0: must be a number > 0"),
        (
            {"axes": f"{RADII}\nfrequency = [1.0]", "more": "[ellipse]\nfrequency = { hertz = 2 }"},
            "ellipse.frequency = { hertz = 2 }: must be absent beside axes.frequency",
        ),
        ({"more": '[ellipse]\nfrequency = "fastest"'}, 'ellipse.frequency = "fastest": must be "natural" or "best"'),
        ({"more": "[ellipse]\nradius = 1.0\nhalf_axes = [[1, 0, 0]]"}, "ellipse.radius = 1.0: must be half_axes, or"),
        ({"more": "[ellipse]\ncentre = [0, 0, 1]"}, "unknown key ellipse.centre = [0, 0, 1]"),
        ({"more": "[limits.uncertainty]\nmass_factor = 1.1"}, "limits.uncertainty: must be absent in this map"),
        ({"axes": f"{RADII}\nz0 = [1.0]"}, "axes.z0: must be absent in this map"),
        ({"z": -1.0}, "every point is above the spool plane"),
        ({"robot": "laval-mssm"}, "must be a point mass in this map"),
        ({"robot": "transition-planar"}, "axes.y: must be [0] for a planar robot"),
        ({"robot": "transition-planar", "y": [0.0], "axes": f"{RADII}\ntilt = [0.1]"}, "axes.tilt: must be absent"),
        (
            {"robot": "transition-planar", "y": [0.0], "more": "[ellipse]\nnormal = [0, 0, 1]"},
            "ellipse.normal = [0.0, 0.0, 1.0]: must give an ellipse in y = 0: a planar robot",
        ),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path, changes, words):
    code, out, err = cspr("run", written(tmp_path, **changes), "-o", tmp_path / "run")
    assert (code, out, err.count("\n")) == (2, "", 1) and words in err, err


def test_spools_in_several_planes_have_no_best_frequency():
    words = 'ellipse.frequency = "best": must be a number or "natural", or axes.frequency: no formula'
    with pytest.raises(ConfigError, match=words):
        mapped(robot=BENT, axes={"x": [0.2], "y": [0.1], "z": [-1.5], "circle_radius": [0.4]})


def test_the_section_over_frequencies_shows_their_ends(tmp_path, figures):
    path = written(tmp_path, x=[0.0], y=[0.0], axes=f"{RADII}\nfrequency = [1.0, 2.0, 4.0]")
    assert cspr("run", path, "-o", tmp_path / "run")[0] == 0
    assert cspr("plot", tmp_path / "run", "-o", tmp_path / "s.png")[0] == 0
    panel = figures[0].axes[0]
    assert panel.get_ylabel() == "frequency (rad/s)" and panel.get_ylim()[1] < 6.0
    ends = [line.get_ydata()[-1] for line in panel.lines if line.get_color() == "black"]
    np.testing.assert_allclose(ends, 9.81**0.5 * np.sqrt([1.0 - 0.13 / 0.6, 1.0 + 0.13 / 0.6, 1.0]), rtol=1e-9)


@pytest.mark.parametrize(
    "seed",
    [pytest.param(seed, marks=pytest.mark.thorough if seed in (1, 6) else pytest.mark.soak) for seed in range(8)],
)
def test_plans_say_what_the_cells_say_of_random_robots(seed):
    """Three or four level, tilted or uneven spools anywhere, either z axis; limits on tension, speed and floor."""
    draw = np.random.default_rng(seed)
    count, up = 3 + seed % 2, seed % 3 == 0
    around = 2.0 * np.pi * (np.arange(count) + draw.uniform(-0.2, 0.2, count)) / count
    level = np.stack([np.cos(around), np.sin(around)], axis=1) * draw.uniform(0.7, 1.3, (count, 1))
    heights = level @ draw.normal(0.0, 0.1, 2) + (draw.normal(0.0, 0.1, count) if seed >= 6 else 0.0)
    origin, sign = draw.normal(0.0, 3.0, 3), -1.0 if up else 1.0
    spools = np.c_[level, heights] + origin
    robot = {"name": "random", "base_points": spools.tolist(), "mass": 1.3, "z_axis": "up" if up else "down"}
    middle = spools.mean(0) + np.array([*draw.normal(0.0, 0.15, 2), sign * 1.6])
    result = mapped(
        robot=robot,
        axes={"x": [middle[0], middle[0] + 0.4], "y": [middle[1]], "z": [middle[2]], "scale": [0.4, 1.2]}
        | {"tilt": [0.0, 0.35], "tilt_azimuth": [float(draw.uniform(0.0, 6.0))], "frequency": [1.5, 2.4, 3.0]},
        ellipse={"half_axes": [[0.8, 0.1, 0.0], [0.0, 0.5, 0.2]]},
        limits={
            "tension_min": 0.3,
            "tension_max": 12.0,
            "cable_speed_max": 1.6,
            "floor": float(middle[2] + sign * 0.4),
        },
    )
    settings, verdicts = json.loads(result.attrs["settings"]), set()
    for place, values in cells_of(result):
        planned = cspr_jax.plan(cell_plan(settings, place, values))
        segment = planned.to_dict()["segments"][0]
        verdicts.add(planned.feasible)
        assert planned.feasible == (values["verdict"] == 0), (place, segment["verdict"])
        if np.isfinite(values["tension_margin"]):
            assert segment["verdict"] == Verdict(int(values["verdict"])).text
            assert segment["margin"] == pytest.approx(values["tension_margin"], rel=1e-2, abs=2e-3)
        if np.isfinite(values["margin"]):
            assert segment["pseudotension_margin"] == pytest.approx(values["margin"], rel=1e-9, abs=1e-12)
    assert verdicts == {True, False}
