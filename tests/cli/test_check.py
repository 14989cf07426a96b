"""`cspr check`: verdict, cause and intervals in words and in JSON, exit codes, files of the motion, slower motions."""

import numpy as np
import pytest
from support.commands import cspr, strict_json

import cspr_jax

FILE = "t,x,y,z\n0,0,0,1\n1,0.1,0.05,0.9\n2,-0.05,0.1,1.1\n3,0,0,1\n"


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.csv").write_text(FILE)
    (tmp_path / "limits.toml").write_text("cable_speed_max = 0.15\n")
    return tmp_path


def test_feasible(own):
    code, out, err = cspr("check", own / "own.csv", "--robot", "prototype", "--json")
    answer = strict_json(out)
    assert (code, err) == (0, "") and answer["feasible"] and answer["verdict"] == "feasible"
    assert answer["cause"] == answer["failing"] == [] and 0.0 < answer["margin_bound"] <= answer["margin"]
    assert (answer["schema"], answer["margin_unit"], answer["interpolation"], answer["ends"]) == (
        1,
        "N",
        "cubic",
        "rest",
    )
    code, out, _ = cspr("check", own / "own.csv", "--robot", "prototype")
    assert code == 0 and "proved to hold at every time" in out and "a cubic spline (C2) through 4 samples" in out


def test_not_feasible(own):
    options = ("--robot", "prototype", "--limits", own / "limits.toml")
    code, out, _ = cspr("check", own / "own.csv", *options, "--json")
    answer = strict_json(out)
    assert code == 1 and answer["verdict"] == "cable_too_fast"
    (cause,) = answer["cause"]
    assert cause["criterion"] == "cable_too_fast" and cause["needed"] > cause["allowed"] == 0.15
    assert any(start <= cause["t"] <= end for start, end in answer["failing"])
    code, out, _ = cspr("check", own / "own.csv", *options)
    assert code == 1 and f"cable {cause['cable'] + 1} needs" in out and "it fails from" in out


def test_slower(own):
    code, out, _ = cspr(
        "check", own / "own.csv", "--robot", "prototype", "--limits", own / "limits.toml", "--slower", "--json"
    )
    answer = strict_json(out)
    assert code == 0 and not answer["feasible"] and answer["slower"]["check"]["feasible"]
    assert answer["slower"]["factor"] > 1.0


def test_files_of_the_motion(own):
    """They are those of a plan, and the one that is not feasible is written on demand alone."""
    code, _, _ = cspr("check", own / "own.csv", "--robot", "prototype", "-o", own / "out.csv", "--rate", 10)
    table = np.genfromtxt(own / "out.csv", delimiter=",", names=True)
    assert code == 0 and len(table) == 31 and table["t"][-1] == 3.0
    code, _, err = cspr(
        *("check", own / "own.csv", "--robot", "prototype", "--limits", own / "limits.toml", "-o", own / "no.csv")
    )
    assert code == 1 and not (own / "no.csv").exists() and "--anyway" in err


def test_files_know_limits_and_failures(own):
    """Pictures of a motion that fails need nothing beside its file."""
    options = ("--robot", "prototype", "--limits", own / "limits.toml", "--anyway")
    assert cspr("check", own / "own.csv", *options, "-o", own / "out.h5")[0] == 1
    code, _, err = cspr("plot", own / "out.h5", "--quantity", "summary", "-o", own / "out.png")
    assert (code, err) == (0, "") and (own / "out.png").stat().st_size > 10_000


def test_it_reads_what_it_wrote(own):
    """The motion of a plan, written and checked: Hermite pieces through its rows come near it."""
    code, _, _ = cspr("check", own / "own.csv", "--robot", "prototype", "-o", own / "out.csv", "--json")
    assert code == 0
    first, again = (cspr_jax.check("prototype", own / name) for name in ("own.csv", "out.csv"))
    assert again.feasible and again.duration == first.duration
    assert again.margin == pytest.approx(first.margin, rel=0.02)


def test_limits_files(own):
    """With a header [limits] or without; with obstacles, which name their file in mistakes."""
    options = ("check", own / "own.csv", "--robot", "prototype", "--limits", own / "limits.toml", "--json")
    first = cspr(*options)[1]
    (own / "limits.toml").write_text("[limits]\ncable_speed_max = 0.15\n")
    assert cspr(*options)[1] == first
    ball = '[[obstacle]]\nkind = "sphere"\nname = "lamp"\ncentre = [0.1, 0.05, 0.9]\nradius = {}\n'
    (own / "limits.toml").write_text(ball.format(0.02))
    code, out, _ = cspr(*options)
    answer = strict_json(out)
    assert code == 1 and "obstacle" in answer["verdict"] and answer["cause"][0]["obstacle"] == "lamp"
    (own / "limits.toml").write_text(ball.format(-1))
    code, out, err = cspr(*options)
    assert (code, out) == (2, "") and err.count("\n") == 1 and "limits.toml" in err and "radius = -1" in err


def test_the_motion_is_not_overwritten(own):
    content = (own / "own.csv").read_text()
    code, _, err = cspr("check", own / "own.csv", "--robot", "prototype", "-o", own / "." / "own.csv")
    assert code == 2 and err.count("\n") == 1 and "the motion is there" in err
    assert (own / "own.csv").read_text() == content


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("--robot", "nobody"), "nobody"),
        (("--robot", "prototype", "--smooth", "-1"), "--smooth"),
        (("--robot", "prototype", "--limits", "limits.csv"), "limits.csv"),
        (("--robot", "prototype", "-o", "out.txt"), "must end in .csv or .h5 or .json"),
    ],
)
def test_one_line_for_a_mistake(own, change, words):
    code, out, err = cspr("check", own / "own.csv", *change)
    assert (code, out) == (2, "") and err.count("\n") == 1 and words in err


def test_mistakes_that_only_a_robot_shows_name_the_file_of_limits(own):
    (own / "narrow.toml").write_text("tension_min = 9.0\ntension_max = 8.0\n")
    words = ("check", own / "own.csv", "--robot", "prototype", "--limits", own / "narrow.toml")
    code, out, err = cspr(*words)
    assert (code, out) == (2, "") and err.startswith(
        f"cspr: {own / 'narrow.toml'}: tension_min = [9.0, 9.0, 9.0]: must"
    )
