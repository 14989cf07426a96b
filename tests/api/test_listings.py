"""Lists from Python: those of the commands."""

import subprocess
import sys

import pytest
from outputs.test_outputs import cspr, strict_json

import cspr_jax
from cspr_jax import cli
from cspr_jax.config.catalogue import catalogue_names
from cspr_jax.errors import RefusedError


def test_lists(capsys, tmp_path):
    assert cspr_jax.list_robots() == strict_json(cspr(capsys, "robots", "--json"))
    assert cspr_jax.list_quantities() == strict_json(cspr(capsys, "quantities", "--json"))
    assert cspr_jax.list_examples() == strict_json(cspr(capsys, "examples", "--json"))
    assert cspr_jax.copy_examples("demo", tmp_path) == [tmp_path / "demo.toml"]
    assert len(cspr_jax.copy_examples(["table_2_1", "poses"], str(tmp_path))) == 2
    with pytest.raises(RefusedError):
        cspr_jax.copy_examples("demo", tmp_path)


def test_points_of_a_robot_stand_below_each_other(capsys, tmp_path):
    """One point a line, and so with a source of several lines; a line break is never written out."""
    path = tmp_path / "lines.toml"
    path.write_text(
        'name = "lines"\nplanar = true\nmass = 1.0\nbase_points = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]\n'
        'source = """\nmeasured\nby hand\n"""\n'
    )
    assert cli.main(["robots", "laval-mssm", str(path)]) == 0
    text = capsys.readouterr().out
    cells = [line.split("│")[2].strip() for line in text.splitlines() if line.startswith("│")]
    assert "\\n" not in text and {"measured", "by hand", "0.744782, -0.43, 0", "1, 0, 0", "-1, 0, 0"} <= {*cells}


@pytest.mark.thorough
def test_the_list_of_robots(capsys, tmp_path):
    """One line a robot, without jax; all about one by its name or file, and what it is where it cannot hang taut."""
    assert cli.main(["robots"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name in catalogue_names():
        assert len([line for line in lines if line.split()[:1] == [name]]) == 1
    assert not any("not known" in line or len(line.rstrip()) > 80 for line in lines)
    code = "import sys; from cspr_jax import cli; cli.main(['robots']); print({'jax', 'pydantic'} & {*sys.modules})"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.endswith("set()\n")
    path = tmp_path / "low.toml"
    spools = "[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 9.0]]"
    path.write_text(f'name = "low [b]x"\nplanar = true\nmass = 1.0\ntension_min = 50.0\nbase_points = {spools}\n')
    assert cli.main(["robots", "cogiro", str(path)]) == 0
    text = capsys.readouterr().out
    assert "hangs still with every cable taut" in text and "low [b]x" in text and "CoGiRo" in text
    listed = strict_json(cspr(capsys, "robots", "cogiro", str(path), "--json"))
    assert [robot["name"] for robot in listed] == ["cogiro", "low [b]x"] and listed == cspr_jax.list_robots(
        ["cogiro", path]
    )
    assert cli.main(["robots", "nobody"]) == 2
    assert capsys.readouterr().err.startswith('cspr: robots: robot = "nobody": must be one of')
