"""Films of plans: as long as their motions, with the robot where it is."""

import io

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

import cspr_jax
from cspr_jax.cli import main
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.plots.films import film as films
from cspr_jax.outputs.plots.style.style import Style, in_style

PLAN = """
schema = 1
robot = "prototype"
family = "hypocycloid-standard"
z0 = 1.2
tension_min = 0.02
tension_max = 3.0
cable_speed_max = 9.0
[[pose]]
rest = true
[[pose]]
position = [0.3, 0.1, 1.2]
arcs = 6
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path = tmp_path_factory.mktemp("films") / "plan.toml"
    path.write_text(PLAN, "utf-8")
    return cspr_jax.plan(path)


def test_a_film_is_as_long_as_its_motion(plan, tmp_path, capsys):
    """By the delays of its pictures, which a GIF has in hundredths of a second."""
    file = tmp_path / "plan.toml"
    file.write_text(PLAN, "utf-8")
    assert main(["plan", str(file), "--animate", str(tmp_path / "film.gif"), "--speed", "64"]) == 0
    length = plan.to_dict()["segments"][0]["duration"] / 64.0
    with Image.open(tmp_path / "film.gif") as picture:
        delays = []
        for number in range(picture.n_frames):
            picture.seek(number)
            delays.append(picture.info["duration"] / 1000.0)
    assert 0.0 <= sum(delays[:-1]) - length <= 0.05 + 1e-9
    assert (tmp_path / "film.gif").read_bytes() == plan.animate(tmp_path / "again.gif", speed=64.0).read_bytes()


def test_cables_are_where_the_plan_has_them(plan):
    columns = plan.rows(200.0)
    rows = np.array([0, len(columns["t"]) // 3, len(columns["t"]) - 1])
    with in_style(Style()):
        picture = films._Picture("film", columns, plan.robot_file, plan.keys, rows)
        for number, row in enumerate(rows):
            picture.show(number)
            for k, cable in enumerate(picture.cables):
                start, end = np.transpose(cable.get_data_3d())
                assert start == pytest.approx(plan.robot_file.base_points[k])
                assert end == pytest.approx(columns["position"][row])
                assert np.linalg.norm(end - start) == pytest.approx(columns["length"][row, k])


def test_an_object_flies_where_free_fall_takes_it(plan):
    """From its release on; it lies where it lands."""
    time, fall = np.linspace(1.0, 1.5, 11)[:, None], np.array([0.0, 0.0, 4.905])
    flight = np.array([0.3, 0.1, 1.2]) + (time - 1.0) * np.array([1.0, 0.2, -0.5]) + (time - 1.0) ** 2 * fall
    columns = plan.rows(200.0) | {"flight_t": time[:, 0], "flight_position": flight}
    rows = np.searchsorted(columns["t"], [0.99, 1.0, 1.2, 1.9])
    with in_style(Style()):
        picture = films._Picture("film", columns, plan.robot_file, plan.keys, rows)
        places = []
        for number in range(len(rows)):
            picture.show(number)
            places.append(np.transpose(picture.object.get_data_3d()))
    assert not len(places[0])
    for place, instant in zip(places[1:], (1.0, 1.2, 1.5), strict=True):
        wanted = [np.interp(instant, time[:, 0], values) for values in flight.T]
        assert place[0] == pytest.approx(wanted, abs=0.02)


@pytest.mark.thorough
def test_pictures_are_those_of_the_whole_figure(plan):
    """Pixel for pixel, though only what moves is drawn again: spools and clock lie over the cables and the mark."""
    columns = plan.rows(200.0) | {"flight_t": np.array([1.0, 1.5]), "flight_position": np.array([[0.3, 0.1, 1.2]] * 2)}
    rows = np.searchsorted(columns["t"], [0.0, 1.2, 1.9])
    with in_style(Style()):
        picture = films._Picture("film", columns, plan.robot_file, plan.keys, rows)
        moved = picture.figure.findobj(lambda artist: artist.get_animated())
        for number in range(len(rows)):
            picture.show(number)
            quick = picture.figure.picture()
            for artist in moved:
                artist.set_animated(False)
            canvas = FigureCanvasAgg(picture.figure)
            canvas.draw()
            assert np.array_equal(quick, np.asarray(canvas.buffer_rgba()))
            for artist in moved:
                artist.set_animated(True)


@pytest.mark.thorough
def test_a_gif_keeps_what_covers_most_of_its_pictures(plan):
    """White, the greys of the panes and black exactly; lines nearly."""
    columns = plan.rows(200.0)
    rows = np.arange(len(columns["t"]))[:: len(columns["t"]) // 5]
    with in_style(Style()):
        picture = films._Picture("film", columns, plan.robot_file, plan.keys, rows)
        true = picture.figure.picture()[..., :3].astype(int)
        data = films.film(".gif", "film", columns, plan.robot_file, plan.keys, speed=32.0)
    with Image.open(io.BytesIO(data)) as shown:
        differences = np.abs(np.asarray(shown.convert("RGB")) - true).max(axis=2)
    assert (differences > 0).mean() < 0.06 and (differences > 24).mean() < 0.002


@pytest.mark.thorough
def test_other_kinds_of_films(plan, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    assert plan.animate(tmp_path / "film.mp4", speed=32.0).read_bytes()[4:8] == b"ftyp"
    page = plan.animate(tmp_path / "film.html", speed=32.0).read_text("utf-8")
    assert "data:image/png;base64" in page and "http://" not in page
    assert plan.animate(tmp_path / "again.html", speed=32.0).read_text("utf-8") == page


@pytest.mark.thorough
def test_long_films_have_fewer_pictures(plan, monkeypatch):
    monkeypatch.setattr(films, "LARGEST_COUNT", 7)
    columns = plan.rows(200.0)
    with in_style(Style()):
        data = films.film(".gif", "film", columns, plan.robot_file, plan.keys, speed=2.0)
    with Image.open(io.BytesIO(data)) as picture:
        assert picture.info["duration"] in (200, 500, 1000)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--animate", "film.avi"), "must end in .gif, .mp4 or .html"),
        (("--animate", "film.gif", "--speed", "0"), "--speed: 0.0: must be a number > 0"),
        (("--speed", "2"), "--speed: must be absent without --animate"),
    ],
)
def test_no_film_is_written(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.toml").write_text(PLAN, "utf-8")
    assert main(["plan", "plan.toml", *words]) == 2
    assert said in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["plan.toml"]


@pytest.mark.thorough
def test_what_is_not_feasible_is_shown_anyway_only(tmp_path):
    infeasible = cspr_jax.plan(
        {"schema": 1, "robot": "prototype", "family": "hypocycloid-standard", "z0": 1.2}
        | {"pose": [{"rest": True}, {"position": [0.9, 0.1, 1.2], "arcs": 2}]}
    )
    with pytest.raises(ConfigError, match="not proved feasible"):
        infeasible.animate(tmp_path / "film.gif")
    assert not list(tmp_path.iterdir())
    for speed in (0.0, -1.0, float("nan")):
        with pytest.raises(ConfigError, match="must be a number > 0"):
            infeasible.animate(tmp_path / "film.gif", speed=speed, anyway=True)
