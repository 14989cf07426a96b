"""Files that cannot be written where they are to be: refused before the work, which here would fail otherwise."""

import pytest
from support.commands import cspr

CASES = [
    ("plan", "work.toml", "-o", "none/out.csv"),
    ("plan", "work.toml", "--mjcf", "none/out.xml"),
    ("plan", "work.toml", "--animate", "none/out.gif"),
    ("replay", "work.toml", "-o", "none/out.png"),
    ("check", "work.csv", "--robot", "prototype", "-o", "none/out.h5"),
    ("check", "work.csv", "--robot", "prototype", "--mjcf", "none/out.xml"),
    ("check", "work.csv", "--robot", "prototype", "--animate", "work.toml/out.html"),
    ("check", "work.csv", "--robot", "prototype", "-o", "folder.csv"),
    ("plot", "work.h5", "-o", "none/out.png"),
    ("report", "work.h5", "-o", "none/out.html"),
    ("report", "work.toml", "-o", "none/out.html"),
]


NAME = "n" * 251 + ".csv"
CASES += [("plan", "work.toml", "-o", NAME), ("check", "work.csv", "--robot", "prototype", "-o", NAME)]


@pytest.mark.parametrize("words", CASES, ids=" ".join)
def test_a_place_that_takes_no_file(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    for name in ("work.toml", "work.csv", "work.h5"):
        (tmp_path / name).write_text("no work can be done with this\n")
    (tmp_path / "folder.csv").mkdir()
    code, out, err = cspr(*words)
    assert (code, out) == (4, "") and err.count("\n") == 1 and f"{words[-1]}: cannot be written" in err
