"""Files to begin with, and completion of commands: all that is written works at once."""

import re
import subprocess
import tomllib

import pytest

from cspr_jax import new_file
from cspr_jax.cli import main
from cspr_jax.config.plan import read_plan
from cspr_jax.config.robot import RobotFile, catalogue_names, read_robot
from cspr_jax.errors import ConfigError
from cspr_jax.outputs import templates
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.sweep.definition import read_sweep


def every_key(text):
    """Keys of a template, those in comments too."""
    return {line.removeprefix("# ").partition(" = ")[0] for line in text.splitlines() if " = " in line}


def test_robots_to_begin_with(tmp_path):
    keys = {field.alias or name for name, field in RobotFile.model_fields.items()}
    for like in catalogue_names():
        path = new_file("robot", tmp_path / f"{like}.toml", like=like)
        assert read_robot(path).name == "my robot", like
        text = path.read_text("utf-8")
        tables = set(re.findall(r"^(?:# )?\[(\w+)\]", text, re.M))
        assert keys <= every_key(text) | tables, like


def test_sweeps_to_begin_with(tmp_path):
    for kind, row in MAP_KINDS.items():
        path = new_file("sweep", tmp_path / f"{kind}.toml", map=kind)
        assert read_sweep(path).grid.n_cells > 0, kind
        text = path.read_text("utf-8")
        assert tomllib.loads(text)["map"] == kind
        heads = {line.strip("# []").partition("]")[0] for line in text.splitlines() if "[" in line}
        assert {key.rpartition(".")[2] for key in row.keys} <= every_key(text) | heads, kind


def test_plans_to_begin_with(tmp_path):
    for family in FAMILIES:
        path = new_file("plan", tmp_path / f"{family}.toml", family=family)
        assert read_plan(path.read_text("utf-8"), path).family == family


def test_defaults_that_are_shown_are_the_schema_s(tmp_path):
    """A comment that gives a value reads as that value."""
    path = new_file("robot", tmp_path / "mine.toml")
    text = path.read_text("utf-8")
    lines = [line.removeprefix("# ") for line in text.splitlines() if re.match(r"# \w+ = ", line)]
    shown = tomllib.loads("\n".join(line for line in lines if not line.endswith("= ...")))
    assert shown
    for name, value in shown.items():
        assert RobotFile.model_fields[name].default == value


def test_nothing_is_overwritten(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert main(["new", "plan", str(path), "--family", "transition"]) == 0
    assert capsys.readouterr().out == f"{path}\n"
    before = path.read_bytes()
    assert main(["new", "robot", str(path)]) == 3
    assert path.read_bytes() == before
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sweep", "x.toml", "--map", "arcs"), '--map = "arcs": must be one of minimum-arcs'),
        (
            ("plan", "x.toml", "--family", "line"),
            '--family = "line": did you mean spline? must be one of hypocycloid-standard',
        ),
        (("robot", "x.toml", "--like", "none"), '--like = "none": must be one of'),
        (("robot", "x.txt"), "must be a name that ends in .toml"),
    ],
)
def test_what_there_is_no_template_of_is_refused(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["new", *words]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    with pytest.raises(ConfigError, match="must be one of robot, sweep, plan"):
        new_file("map", "x.toml")


def test_bash_completes_commands_options_and_files(tmp_path, capsys):
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "cspr.bash"
    script.write_text(capsys.readouterr().out, "utf-8")
    (tmp_path / "sweep.toml").touch()
    for words, wanted in (("cspr ver", "verify"), ("cspr run --wor", "--workers"), ("cspr run swee", "sweep.toml")):
        ask = f"""
source {script}
COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); COMP_LINE="{words}"; COMP_POINT=${{#COMP_LINE}}
$(complete -p cspr | sed 's/.*-F \\([^ ]*\\).*/\\1/') cspr "${{COMP_WORDS[COMP_CWORD]}}"
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
        done = subprocess.run(["bash", "-c", ask], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert wanted in done.stdout.split(), (words, done)
    for shell in ("zsh", "tcsh"):
        assert main(["completion", shell]) == 0
        assert "verify" in capsys.readouterr().out


def test_a_new_robot_begins_with_what_every_robot_has():
    text = templates.robot_template("prototype")
    keys = re.findall(r"^(?:# )?(\w+) = ", text, re.MULTILINE)
    assert keys[:4] == ["name", "base_points", "mass", "z_axis"]
