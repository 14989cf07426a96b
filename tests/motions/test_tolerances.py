"""An uncertainty in sweeps, plans and Python, from the given numbers to what is written."""

import json

import h5py
import pytest
from support.other_robots import uncertain

from cspr_jax import least_time, load_robot, minimum_arcs
from cspr_jax.cli import main
from cspr_jax.errors import InputError
from cspr_jax.robots.model.limits import Limits, Uncertainty

SWEEP = """
schema = 1
map = "minimum-arcs"
robot = "prototype"
[axes]
x = [0.0, 0.3, 0.9]
y = [0.2]
z = [1.0]
z0 = [1.0]
[trajectory]
family = "hypocycloid-standard"
from = {{ rest = true }}
amplitude = "quintic"
[limits]
uncertainty = {uncertainty}
"""


def run(tmp_path, uncertainty, name="sweep"):
    file = tmp_path / f"{name}.toml"
    file.write_text(SWEEP.format(uncertainty=uncertainty), "utf-8")
    code = main(["run", str(file), "-o", str(tmp_path / name)])
    return code, tmp_path / name / f"{name}.h5"


@pytest.mark.thorough
def test_a_map_of_tolerated_multiples(tmp_path):
    _, small = run(tmp_path, "{ spool_positions = 1e-5 }", "small")
    _, large = run(tmp_path, "{ spool_positions = 0.02 }", "large")
    assert small.exists(), list(tmp_path.rglob("*"))
    with h5py.File(small) as one, h5py.File(large) as other:
        few, many = one["arcs"][()].ravel(), other["arcs"][()].ravel()
        # Robots that may be worse need as many arcs or more, and stand the whole of their uncertainty.
        assert ((many >= few) | (many == 0)).all()
        assert (many > few).any()
        assert (other["tolerated"][()].ravel()[many > 0] >= 1.0).all()
        assert (one["tolerated"][()] <= one["not_tolerated"][()]).all()
        same = (few == many).ravel()
        ratio = one["tolerated"][()].ravel()[same] / other["tolerated"][()].ravel()[same]
        assert ratio == pytest.approx(2000.0, rel=0.3) or (one["tolerated"][()].ravel()[same] == 1000.0).any()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("{ spool_positions = -0.1 }", "limits.uncertainty.spool_positions = -0.1"),
        ("{ mass_factor = 0.5 }", "limits.uncertainty.mass_factor = 0.5"),
        ("{ }", "at least one of its keys"),
        ("{ spools = 1.0 }", "spools"),
        ("{ mass_centre = 0.01 }", "a point mass has no other one"),
    ],
)
def test_what_is_no_uncertainty_is_refused(tmp_path, capsys, given, said):
    code, result = run(tmp_path, given)
    words = capsys.readouterr().err
    assert code == 2 and not result.exists()
    assert said in words and "Traceback" not in words and len(words.strip().splitlines()) == 1


def test_maps_that_prove_nothing_about_other_robots_refuse_an_uncertainty(tmp_path, capsys):
    file = tmp_path / "lines.toml"
    text = SWEEP.format(uncertainty="{ spool_positions = 0.1 }").replace('"minimum-arcs"', '"transition-envelopes"')
    text = text.replace("hypocycloid-standard", "transition").replace("z0 = [1.0]", "z0 = [1.0]\ntau = [0.5]")
    file.write_text(text, "utf-8")
    assert main(["run", str(file), "-o", str(tmp_path / "out")]) == 2
    assert "limits.uncertainty: must be absent in this map" in capsys.readouterr().err


PLAN = """
schema = 1
robot = "prototype"
family = "{family}"
amplitude = "quintic"
z0 = 1.0
[limits]
uncertainty = {{ spool_positions = {spools} }}
[[pose]]
rest = true
[[pose]]
position = [0.5, 0.3, 1.0]
arcs = {arcs}
"""


def plan_of(tmp_path, capsys, **keys):
    file = tmp_path / "plan.toml"
    text = PLAN.format(**keys)
    file.write_text(text.replace("arcs = 1\n", ""), "utf-8")
    code = main(["plan", str(file), "--json"])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.thorough
@pytest.mark.parametrize(("family", "arcs"), [("hypocycloid-standard", 14), ("transition", 14)])
def test_a_plan_says_what_it_stands(tmp_path, capsys, family, arcs):
    _, said, _ = plan_of(tmp_path, capsys, family=family, arcs=arcs, spools=0.001)
    segment = json.loads(said)["segments"][0]
    multiple = segment["tolerated"]
    assert 1.0 < multiple <= segment["not_tolerated"]
    # Beyond it the same motion is infeasible, and only for this.
    beyond = 1.02 * 0.001 * segment["not_tolerated"]
    _, said, _ = plan_of(tmp_path, capsys, family=family, arcs=arcs, spools=beyond)
    other = json.loads(said)["segments"][0]
    assert other["arcs"] is None and "uncertainty" in other["verdict"]
    assert other["margin"] == segment["margin"] > 0.0


def test_families_that_know_no_uncertainty_say_so(tmp_path, capsys):
    code, _, said = plan_of(tmp_path, capsys, family="s-curve", arcs=1, spools=0.001)
    assert code == 2
    assert "uncertainty" in said and "transition" in said


def test_numbers_that_are_none_are_refused_from_python():
    robot = load_robot("prototype")
    for given in (5, Uncertainty(spool_positions=-0.1), Uncertainty(mass_centre=0.1)):
        with pytest.raises(InputError, match="uncertainty"):
            minimum_arcs(robot, [[0.3, 0.0, 1.0]], z0=1.0, limits=Limits(uncertainty=given))
    hall = load_robot("boralugoda-rectangle")
    with pytest.raises(InputError, match="must be absent but for the families"):
        least_time(hall, [[15, 28, 3]], start=[1, 20, 7], limits=Limits(uncertainty=uncertain(spool_positions=0.1)))


POSES = """
schema = 1
robot = "laval-mssm"
family = "hypocycloid"
amplitude = { name = "effective-c3", epsilon = 0.1 }
z0 = 1.7
[limits]
uncertainty = { spool_positions = 0.001, mass_centre = 0.001, mass_factor = 1.1 }
[[pose]]
rest = true
[[pose]]
position = [0.9, 0.3, 1.7]
tilt_torsion = [0.3, 0.3, 0.1]
"""


@pytest.mark.thorough
def test_a_plan_of_poses_says_what_it_stands(tmp_path, capsys):
    file = tmp_path / "plan.toml"
    file.write_text(POSES, "utf-8")
    assert main(["plan", str(file), "--json"]) == 0
    segment = json.loads(capsys.readouterr().out)["segments"][0]
    assert 1.0 < segment["tolerated"] <= segment["not_tolerated"] < 1.2 * segment["tolerated"]
