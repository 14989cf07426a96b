"""What users get wrong about ellipses: one line that names key, value and what is allowed, or a verdict."""

import numpy as np
import pytest
from support.commands import plan, strict_json

import cspr_jax
from cspr_jax.errors import InputError

HEAD = 'schema = 1\nrobot = "prototype"\nfamily = "ellipse"\n'
WORDS = 'must be "natural", "best", "fastest" or "slowest"'
AXES = "half_axes = [[0.5, 0, 0], [0, 0.4, 0]]"
CENTRE = "centre = [0, 0, 2.0]"
GOOD = f"{CENTRE}, {AXES}"
SPOOLS = [[1.0, 0.2, 0.1], [-0.6, 1.1, -0.2], [-0.7, -0.9, 0.05]]


def from_rest(ellipse, turns=1):
    text = f"ellipse = {{ {ellipse} }}\nturns = {turns}\n"
    return f"{HEAD}[[pose]]\nrest = true\nposition = [0, 0, 2.0]\n[[pose]]\n{text}"


@pytest.mark.parametrize(
    ("ellipse", "line"),
    [
        (f"{GOOD}, frequency = 0", "frequency = 0: must be greater than 0"),
        (f"{GOOD}, frequency = -1.0", "frequency = -1.0: must be greater than 0"),
        (f"{GOOD}, frequency = nan", "frequency = nan: must be a finite number"),
        (f"{GOOD}, frequency = inf", "frequency = inf: must be a finite number"),
        (f"{GOOD}, frequency = 1e200", "frequency = 1e+200: must be at most 1000000000"),
        (f"{GOOD}, frequency = true", "frequency = true: must be a number, not true or false"),
        (f'{GOOD}, frequency = "quick"', f'frequency = "quick": {WORDS}'),
        (f"{GOOD}, frequency = {{ hertz = 0 }}", "frequency.hertz = 0: must be greater than 0"),
        (
            f"{CENTRE}, half_axes = [[0, 0, 0], [0, 0, 0]]",
            "half_axes = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]: must be one",
        ),
        (f"{CENTRE}, half_axes = []", "half_axes = []: must be a list of at least 1"),
        (f"{CENTRE}, half_axes = [[1, 0]]", "half_axes[0] = [1, 0]: must be a list of at least 3"),
        (f"{CENTRE}, half_axes = [[nan, 0, 0]]", "half_axes[0][0] = nan: must be a finite number"),
        (CENTRE, "radius is missing: half_axes, or the radius of a circle"),
        (AXES, "centre is missing"),
        (f"{GOOD}, radius = 0.3", "radius = 0.3: must be half_axes, or the radius of a circle: one of them"),
        (f"{CENTRE}, radius = 0", "radius = 0: must be greater than 0"),
        (
            f"{CENTRE}, radius = 1, normal = [0, 0, 0]",
            "normal = [0.0, 0.0, 0.0]: must be a direction, of length 1e-09 at least",
        ),
        (f"{GOOD}, normal = [0, 0, 1]", "normal = [0.0, 0.0, 1.0]: must be absent beside half_axes"),
        (f"{GOOD}, phase = nan", "phase = nan: must be a finite number"),
        *(
            (
                f'centre = [0, 0, {z}], {AXES}, frequency = "{word}"',
                f'frequency = "{word}": must be a number: the centre',
            )
            for z, word in ((-1.0, "natural"), (0.0, "natural"), (-1.0, "best"), (-1.0, "fastest"), (-1.0, "slowest"))
        ),
        (
            f'{CENTRE}, half_axes = [[0.01, 0, 0]], frequency = "slowest"',
            'frequency = "slowest": must be a number: nothing bounds',
        ),
        (f"{GOOD}, freqency = 1", "freqency = 1: did you mean frequency?"),
    ],
)
def test_mistakes_in_an_ellipse(tmp_path, ellipse, line):
    code, out, err = plan(tmp_path, from_rest(ellipse))
    assert (code, out) == (2, "") and f"pose[1].ellipse.{line}" in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (from_rest(GOOD, -1), "pose[1].turns = -1: must be at least 0"),
        (from_rest(GOOD, "nan"), "pose[1].turns = nan: must be a finite number"),
        (from_rest(GOOD, "1e9"), "pose[1].turns = 1000000000.0: must be at most 1000000"),
        (f"{HEAD}[[pose]]\nellipse = {{ {GOOD} }}\n[[pose]]\nturns = 0\n", "pose[1].turns = 0: must be above 0"),
        (f"{HEAD}ellipse = {{ {GOOD} }}\nturns = 0\n", "turns = 0: must be above 0"),
        (f"{HEAD}[[pose]]\nrest = true\n[[pose]]\nrest = true\n", "pose[1].rest = true: must follow an ellipse"),
        (f"{HEAD}[[pose]]\nellipse = {{ {GOOD} }}\n[[pose]]\narcs = 2\n", "pose[1].arcs = 2: must be absent on one"),
        (
            f"{HEAD}[[pose]]\nellipse = {{ {GOOD} }}\n[[pose]]\nellipse = {{ {CENTRE}, radius = 0.1 }}\narcs = 3\n",
            "pose[1].arcs = 3: must be even between two ellipses",
        ),
    ],
)
def test_mistakes_in_a_plan(tmp_path, text, line):
    code, out, err = plan(tmp_path, text)
    assert (code, out) == (2, "") and line in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("ellipse", "verdict"),
    [
        (f"centre = [0, 0, -1.0], {AXES}, frequency = 2.0", "above_spools"),
        *((f'centre = [3, 0, 2.0], {AXES}, frequency = "{word}"', "slack_cable") for word in ("natural", "fastest")),
        (f"{CENTRE}, half_axes = [[3, 0, 0]], frequency = 4.0", "slack_cable"),
    ],
)
def test_infeasible_ellipses_have_a_verdict(tmp_path, ellipse, verdict):
    code, out, err = plan(tmp_path, f"{HEAD}ellipse = {{ {ellipse} }}\n", "--json")
    (segment,) = strict_json(out)["segments"]
    assert (code, err) == (1, "") and verdict in segment["verdict"].split("+") and segment["cause"]
    if "3, 0, 2.0" in ellipse:
        assert segment["frequency_intervals"] == []


FLAT = cspr_jax.point_mass([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], mass=1.0, planar=True)
FOUR = cspr_jax.point_mass([[1, 1, 0], [-1, 1, 0.3], [-1, -1, 0], [1, -1, 0]], mass=1.0)
PLACE, A, B, LINE = [0.0, 0.0, 2.0], [0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("robot", "change", "line"),
    [
        *((None, {"frequency": x}, "frequency = .*must be a number > 0") for x in (0, -1.0, np.nan, np.inf, "quick")),
        *((None, {"turns": x}, "turns = .*must be a number > 0") for x in (0, -1.0, np.nan, "x")),
        *((None, {"centre": x}, "centre.*three finite numbers") for x in ([0.0, 1.0], [np.nan, 0.0, 1.0])),
        *(
            (None, {"centre": [0.0, 0.0, -1.0], "frequency": x}, f'frequency = "{x}": must be a number: the centre')
            for x in ("natural", "best", "fastest")
        ),
        *((FLAT, {key: [0.0, 0.5, 2.0]}, f"{key} = .*y = 0") for key in ("centre", "a", "b")),
    ],
)
def test_mistakes_from_python(robot, change, line):
    made = robot or cspr_jax.point_mass(SPOOLS, mass=0.8)
    arguments = {"centre": PLACE, "a": A, "b": LINE, "frequency": "natural"} | change
    with pytest.raises(InputError, match=line):
        cspr_jax.ellipse(made, **arguments)


@pytest.mark.parametrize(
    ("robot", "change", "line"),
    [
        *((None, {"frequencies": x}, "frequencies = .*must be numbers > 0") for x in (0.0, -1.0, np.nan)),
        (None, {"frequencies": [1.0, 2.0]}, "frequencies = .*must be a number in rad/s"),
        (None, {"a": [A, A]}, "a = .*must be"),
        (None, {"centres": PLACE}, "centres.*shape"),
        (FLAT, {}, "b = .*y = 0"),
        (FOUR, {}, "base_points: spools in several planes"),
    ],
)
def test_mistakes_with_many(robot, change, line):
    made = robot or cspr_jax.point_mass(SPOOLS, mass=0.8)
    arguments = {"centres": [PLACE], "a": A, "b": B, "frequencies": 2.0} | change
    with pytest.raises(InputError, match=line):
        cspr_jax.ellipse_margins(made, **arguments)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (f"{HEAD}ellipse = 3\n{CENTRE}\n", "unknown key centre"),
        (f"{HEAD}{CENTRE}\n[ellipse]\n{AXES}\n", "unknown key centre"),
        (from_rest(GOOD).replace(HEAD, f"{HEAD}turns = 2\n"), "turns = 2.0: must be absent"),
        (
            f"{HEAD}max_arcs = 1\n[[pose]]\nellipse = {{ {GOOD} }}\n[[pose]]\nellipse = {{ {CENTRE}, radius = 0.4 }}\n",
            "max_arcs = 1: must be at least 2 between two ellipses",
        ),
    ],
    ids=["no table", "in two places", "turns of poses", "no number of arcs"],
)
def test_keys_that_contradict_the_plan(tmp_path, text, line):
    code, _, error = plan(tmp_path, text)
    assert code == 2 and line in error and error.count("\n") <= 2, error
