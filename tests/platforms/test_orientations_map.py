"""Tables, maps and pictures of orientations, as a user gets them."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.commands import cspr
from support.platforms import FROM_REST, LOOSE, MSSM, checker_of, ours, place

from cspr_jax.families.platforms.orientations.accessible import accessible
from cspr_jax.families.platforms.orientations.attainable import attainable
from cspr_jax.outputs.plots.style.word_ticks import reasons
from cspr_jax.published import chapter_3
from cspr_jax.published.table_3_4 import smallest_proportions
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import open_result

NEAR = ("x = 1.5b", "y = 1.5b")


@pytest.mark.thorough
def test_tables_of_orientations(monkeypatch):
    """Cells of two places, with a coarse step and few arcs; options that do not belong are refused."""
    monkeypatch.setattr(chapter_3, "MAX_ARCS", 8)
    monkeypatch.setattr(chapter_3, "POSITIONS", {name: chapter_3.POSITIONS[name] for name in NEAR})
    check_tables(monkeypatch)
    code, _, err = cspr("table", "2.1", "--fine")
    assert code == 2 and err == "cspr: --fine: must be absent with table 2.1\n"


@pytest.mark.soak
def test_tables_of_orientations_all(monkeypatch):
    """All places."""
    check_tables(monkeypatch)


def check_tables(monkeypatch):
    """Proportions are of the counts, and near the printed ones."""
    monkeypatch.setattr(chapter_3, "DIVISIONS", 8)
    code, out, err = cspr("table", "3.3", "--json", "--definition", "grid")
    assert code == 0, err
    cells = json.loads(out)["cells"]
    assert len(cells) == 8 * len(chapter_3.POSITIONS) and {c["variant"]["definition"] for c in cells} == {"grid"}
    by = {(c["row"], c["column"]): c for c in cells}
    for row in NEAR:
        fraction = by[row, "attainable"]["computed"] / by[row, "accessible"]["computed"]
        assert 100.0 * fraction == pytest.approx(by[row, "proportion"]["computed"])
        assert by[row, "proportion"]["computed"] == pytest.approx(by[row, "proportion"]["published"], abs=4.0)


@pytest.mark.thorough
def test_the_smallest_proportion_is_that_of_all(monkeypatch):
    """Though not all values of beta-hat are tried at every place."""
    choice = chapter_3.TableSettings(max_arcs=8)
    checker, asked = chapter_3.checker_of("effective-c3"), []
    for radius, azimuth, tilt in ((1.5, 0.2, 0.6), (2.5, 0.0, 1.0), (2.5, 0.5, 1.0), (3.0, 0.1, 0.7), (1.5, 0.1, 0.0)):
        place = np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), 1.7]) * [0.86, 0.86, 1.0]
        angles = np.random.default_rng(1).uniform([-np.pi, 0.0, -1.0], [np.pi, 1.0, 1.0], (60, 3)) * [1.0, tilt, tilt]
        asked.append((place, angles))
    every = [good.mean() for good in chapter_3.attained(checker, asked, choice=choice)]
    tried = []

    def attained(sets, values):
        tried.append(sets)
        return chapter_3.attained(checker, sets, choice=choice, tried=values)

    assert smallest_proportions(attained, [asked]) == [min(every)]
    assert min(every) < max(every) == 1.0
    finished = {tuple(place) for sets in tried[1:] for place, _ in sets}
    assert finished == {tuple(asked[k][0]) for k in (1, 2)}
    preferred = [good.mean() for good in attained(asked, np.array([0]))]
    assert np.argmin(every) != np.argmin(preferred)
    assert smallest_proportions(attained, [asked[-1:]]) == [1.0]
    # Few places at a time, as of many orientations.
    monkeypatch.setattr(chapter_3, "TOGETHER", 100)
    some = chapter_3.attained_there("effective-c3", choice, np.array([0]), asked)
    assert [good.mean() for good in some] == preferred


@pytest.mark.parametrize("seed", range(20))
def test_smallest_proportions_of_many_annuli(seed):
    """Each as if it were alone, and as if every value of beta-hat were tried everywhere."""
    rng = np.random.default_rng(seed)
    # Of each place's orientations, which values attain them; places are numbered, orientations too.
    known = [rng.random((rng.integers(1, 30), 20)) < rng.choice([0.01, 0.1, 0.6]) for _ in range(9)]
    sets = [(k, np.arange(len(own))) for k, own in enumerate(known)]
    annuli = [sets[:2], sets[2:3], sets[3:9]]

    asked = []

    def attained(some, values):
        asked.append([k for k, _ in some])
        return [known[k][which][:, values].any(1) for k, which in some]

    found = smallest_proportions(attained, annuli)
    # Other values than the preferred one are tried first where that one attains least.
    shares = [own[:, 0].mean() for own in known]
    worst = [min((k for k, _ in annulus), key=shares.__getitem__) for annulus in annuli]
    assert [*asked, []][1] == [k for k in worst if shares[k] < 1.0]
    assert found == [min(known[k].any(1).mean() for k, _ in annulus) for annulus in annuli]
    assert found == [smallest_proportions(attained, [annulus])[0] for annulus in annuli]


SWEEP = """schema = 1
map = "attainability"
robot = "laval-mssm"
[axes]
z = [1.7]
radius = [1.29]
azimuth = [0.2, 0.8471975511965976, 1.5]
[trajectory]
family = "hypocycloid"
amplitude = { name = "effective-c3", epsilon = 0.1 }
max_arcs = 8
[orientations]
divisions = 6
values = 4
"""


def swept(folder, *change):
    (folder / "places.toml").write_text(SWEEP.replace(*change) if change else SWEEP)
    return cspr("run", folder / "places.toml", "-o", folder / "run")


@pytest.mark.thorough
def test_maps_of_places(tmp_path):
    """Cells are what the functions give; the mirrored place has the same numbers."""
    code, out, err = swept(tmp_path)
    assert code == 0, err
    data = {name: values[0, 0] for name, values in open_result(Path(out.split()[-1])).data.items()}
    checker = checker_of(kind=FROM_REST)
    for i, azimuth in enumerate((0.2, 0.8471975511965976, 1.5)):
        there = place(1.5, azimuth)
        inside = accessible(ours(MSSM), there, "scan", 6)
        many, z0 = np.tile(there, (len(inside.angles), 1)), np.full(len(inside.angles), 1.7)
        good = attainable(checker, many, inside.angles, z0, max_arcs=8, values=4).arcs > 0
        assert data["accessible"][i] == len(good) and data["attainable"][i] == good.sum()
        assert data["accessible_volume"][i] == pytest.approx(inside.volume.sum(), rel=1e-9)
        assert data["attainable_fraction"][i] == pytest.approx(good.mean())
    for values in data.values():
        assert values[0] == pytest.approx(values[1], nan_ok=True)  # 0.847 is 60 degrees less 0.2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"laval-mssm"', '"prototype"'), "must be a platform"),
        (("z = [1.7]", "z = [1.7]\ntilt = [0.1]"), "axes.tilt: must be absent"),
        (("max_arcs = 8", "max_arcs = 8\nfrom = { position = [0.0, 0.1, 1.0] }"), "trajectory.from: must be"),
        (('"hypocycloid"', '"transition"'), "trajectory.family"),
        (("divisions = 6", "divisions = 1"), "orientations.divisions = 1"),
        (("divisions = 6", "divisions = 7"), "orientations.divisions = 7: must be a multiple of 2"),
        (('map = "attainability"', 'map = "orientation-workspace"'), "orientations.values: must be absent"),
        (
            ('map = "attainability"', 'map = "orientation-workspace"\nlimits = { floor = 3.0 }'),
            "limits: must be absent",
        ),
        (('map = "attainability"', 'map = "poses"'), "orientations: must be absent"),
        (("z = [1.7]", "z = [-1.7]"), "every point is above the spool plane"),
    ],
)
def test_mistakes(tmp_path, change, words):
    code, out, err = swept(tmp_path, *change)
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err


EACH = """schema = 1
map = "orientations"
robot = {robot}
[axes]
x = [{x}]
y = [{y}]
z = [{z}]
[trajectory]
family = "hypocycloid"
amplitude = {{ name = "effective-c3", epsilon = 0.1 }}
max_arcs = 8
[orientations]
divisions = 6
values = 4
"""


def every_orientation(folder, name, **keys):
    (folder / f"{name}.toml").write_text(EACH.format(**keys))
    code, out, err = cspr("run", folder / f"{name}.toml", "-o", folder / name)
    assert code == 0, err
    return Path(out.split()[-1])


THERE = place(1.5, 0.7)


@pytest.fixture(scope="module")
def whole_map(tmp_path_factory):
    """Path of the map of all orientations of a place."""
    at = dict(zip("xyz", THERE, strict=True))
    return every_orientation(tmp_path_factory.mktemp("map"), "down", robot='"laval-mssm"', **at)


@pytest.mark.thorough
def test_a_map_of_every_orientation(whole_map):
    """Its cells are those of the functions."""
    there, result = THERE, open_result(whole_map)
    assert list(result.axes) == ["x", "y", "z", "torsion", "tilt_azimuth", "tilt"]
    arcs, verdict = (result.data[name][0, 0, 0] for name in ("arcs", "verdict"))
    assert verdict.shape == (12, 12, 6)
    inside = accessible(ours(MSSM), there, "grid", 6)
    seen = (verdict & Verdict.NOT_ACCESSIBLE.value) == 0
    assert seen[:, :, 1:].sum() + seen[:, 0, 0].sum() == len(inside.angles)
    sigma, phi, theta = (result.axes[name] for name in ("torsion", "tilt_azimuth", "tilt"))
    checker = checker_of(kind=FROM_REST)
    some = np.argwhere(seen)[::7]
    angles = np.array([[phi[j], theta[k], sigma[i]] for i, j, k in some])
    many, z0 = np.tile(there, (len(some), 1)), np.full(len(some), 1.7)
    found = attainable(checker, many, angles, z0, max_arcs=8, values=4)
    assert (found.arcs == arcs[tuple(some.T)]).all() and (found.verdict == verdict[tuple(some.T)]).all()
    assert (arcs > 0).sum() > 0.8 * seen.sum()


@pytest.mark.thorough
def test_a_map_in_axes_turned_over(whole_map, tmp_path):
    """The same robot, z up: phi becomes -phi, sigma -sigma."""
    arcs, at = open_result(whole_map).data["arcs"][0, 0, 0], dict(zip("xyz", THERE, strict=True))
    up = open_result(every_orientation(tmp_path, "up", robot=_turned_over(), x=at["x"], y=-at["y"], z=-at["z"]))
    around, mirrored = -np.arange(12) % 12, np.array([*range(10, -1, -1), 11])
    assert (up.data["arcs"][0, 0, 0][mirrored][:, around] == arcs).all()


def _turned_over():
    over = np.array([1.0, -1.0, -1.0])
    base, points = ((np.asarray(x) * over).tolist() for x in (MSSM.base, MSSM.platform))
    inertia = (np.asarray(MSSM.inertia) * np.outer(over, over)).tolist()
    return (
        f'{{ name = "over", z_axis = "up", base_points = {base}, platform_points = {points}, '
        f"mass = {float(MSSM.mass)}, inertia = {inertia} }}"
    )


@pytest.mark.thorough
def test_pictures_of_every_orientation(whole_map, tmp_path):
    path, picture = whole_map, tmp_path / "picture.png"
    for options in (["--quantity", "verdict"], ["--envelope", "--at", f"x={THERE[0]}"]):
        code, _, err = cspr("plot", path, "-o", picture, *options)
        assert code == 0 and picture.stat().st_size > 20_000, err
    for options, words in (
        (["--envelope", "--quantity", "arcs"], "--quantity"),
        (["--envelope", "--at", "tilt=0.1"], "--at"),
        (["--envelope", "--lines", "tilt"], "--lines"),
    ):
        code, _, err = cspr("plot", path, "-o", picture, *options)
        assert code == 2 and words in err and len(err.splitlines()) == 1, err


def test_a_map_of_every_orientation_has_its_own_grid(tmp_path):
    text = EACH.format(robot='"laval-mssm"', x=1.0, y=0.5, z=1.7)
    for change, words in (
        (("divisions = 6", 'divisions = 6\ndefinition = "scan"'), 'orientations.definition = "scan": must be "grid"'),
        (("z = [1.7]", "z = [1.7]\ntilt = [0.1]"), "axes.tilt: must be absent"),
    ):
        (tmp_path / "wrong.toml").write_text(text.replace(*change))
        code, out, err = cspr("run", tmp_path / "wrong.toml", "-o", tmp_path / "run")
        assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1, err


def test_reasons_are_told_apart():
    """One colour and word a cell, what lies deeper first."""
    flags = [0, Verdict.NO_ARCS | Verdict.SLACK_CABLE, Verdict.SLACK_CABLE | Verdict.SINGULAR, Verdict.NOT_ACCESSIBLE]
    found, words, colours = reasons(
        np.array([int(flag) for flag in [*flags, Verdict.FEWER_ARCS_UNDECIDED]]), "feasible"
    )
    assert [words[i] for i in found] == ["feasible", "slack cable", "singular", "not accessible", "feasible"]
    assert len(set(colours)) == len(colours) == 4


def test_a_map_of_what_is_accessible(tmp_path):
    text = SWEEP.replace('"attainability"', '"orientation-workspace"').replace("values = 4\n", "")
    (tmp_path / "places.toml").write_text(text)
    code, out, err = cspr("run", tmp_path / "places.toml", "-o", tmp_path / "run")
    assert code == 0, err
    data = open_result(Path(out.split()[-1])).data
    assert "attainable" not in data and (data["accessible"] > 0).all()


@pytest.mark.soak
def test_the_main_reason_may_be_a_limit(tmp_path):
    """Where a limit stands in the way of all, it is named; the others are loose."""
    every = LOOSE | {"tension_max": 0.1}
    limits = "".join(["[limits]\n", *(f"{name} = {value}\n" for name, value in every.items())])
    (tmp_path / "places.toml").write_text(
        SWEEP.replace("[orientations]", limits + "[orientations]")
        .replace("azimuth = [0.2, 0.8471975511965976, 1.5]", "azimuth = [0.2]")
        .replace("divisions = 6", "divisions = 4")
    )
    code, out, err = cspr("run", tmp_path / "places.toml", "-o", tmp_path / "run")
    assert code == 0, err
    data = open_result(Path(out.split()[-1])).data
    assert (data["attainable"] == 0).all() and (data["main_reason"] == Verdict.OVER_TENSION).all()
