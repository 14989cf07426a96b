"""Numbers from 0 to the largest there are, anywhere in a sweep, a plan or a robot: used, or refused with one line."""

import copy
import json
import warnings

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cspr_jax.build.problems import build_problem
from cspr_jax.config.catalogue import CATALOGUE
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.reading import checked, read_toml
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError, CsprError, InputError
from cspr_jax.plans.choices import chosen_depth
from cspr_jax.plans.sequence import PlanLegs
from cspr_jax.robots.statics.reference_pose import reference_pose
from cspr_jax.sweep.definition import read_sweep
from cspr_jax.sweep.tile import TileMap

POINT = {
    "name": "r",
    "base_points": [[0.2, -0.1, 0.0], [-0.2, -0.1, 0.0], [0.0, 0.3, 0.0]],
    "mass": 0.2,
    "gravity": 9.8,
}
PLANAR = {"name": "p", "planar": True, "base_points": [[0.7, 0.0, 0.0], [-0.7, 0.0, 0.0]], "mass": 0.1}
PLATFORM = read_toml(CATALOGUE / "laval-mssm.toml") | {"gravity": 9.81, "centre_of_mass": [0.0, 0.0, 0.0]}
LIMITS = {"tension_min": 0.1, "tension_max": 50.0, "cable_length_max": 9.0, "cable_speed_max": 9.0, "floor": 3.0}
QUINTIC = {"polynomial": [0.0, 0.0, 0.0, 10.0, -15.0, 6.0, 0.0]}
PLACE = {"x": [1.0], "y": [0.1], "z": {"start": 1.2, "stop": 1.5, "count": 2}, "z0": [1.7]}


def sweep(kind, robot, trajectory, axes=PLACE, **more):
    return {"schema": 1, "map": kind, "robot": robot, "axes": axes, "trajectory": trajectory, **more}


TILTED = {"tilt": [0.1], "tilt_azimuth": [0.2], "torsion": [0.3]}
START = {"position": [0.1, 0.1, 1.5], "tilt_torsion": [0.0, 0.1, 0.1], "beta_hat": 0.2}
ATTAINED = {"radius": [1.0], "azimuth": [0.1], "z": [1.5], "z0": [1.7]}
FILES = {
    "arcs": sweep(
        "minimum-arcs",
        POINT,
        {"max_arcs": 4, "from": {"position": [0.0, 0.1, 1.5]}, "amplitude": QUINTIC},
        limits=LIMITS,
    ),
    "transitions": sweep("minimum-oscillations", PLANAR, {"family": "transition", "amplitude": "A1", "max_arcs": 4}),
    "poses": sweep("poses", PLATFORM, {"family": "hypocycloid", "from": START, "beta_hat": 0.1}, PLACE | TILTED),
    "attainability": sweep("attainability", PLATFORM, {"max_arcs": 4}, ATTAINED, orientations={"divisions": 4}),
    "point plan": {
        "schema": 1,
        "robot": POINT,
        "z0": 1.7,
        "floor": 3.5,
        "samples": 10,
        "amplitude": QUINTIC,
        "pose": [{"rest": True}, {"position": [0.3, 0.1, 1.5], "arcs": 2}],
    },
    "chosen z0": {
        "schema": 1,
        "robot": POINT,
        "z0": {"choose": "conservative"},
        "amplitude": {"name": "effective", "epsilon": 0.1},
        "pose": [{"rest": True}, {"position": [0.3, 0.1, 1.5]}],
    },
    "pose plan": {
        "schema": 1,
        "robot": PLATFORM,
        "family": "hypocycloid",
        "z0": 1.7,
        "pose": [
            {"rest": True},
            {"position": [1.0, 0.1, 1.5], "tilt_torsion": [0.1, 0.1, 0.1], "beta_hat": 0.1},
            {"position": [1.0, 0.1, 1.5], "quaternion": [1.0, 0.0, 0.0, 0.0]},
        ],
    },
}
# An integer stands for one of 400 digits.
EXTREMES = (
    *(0.0, -0.0, 5e-324, -5e-324, 1e-300, 1e-150, 1e-18, 1e-9, 1e-3, 1.0, -1.0, 1e3, 1e6, -1e6, 1e9, -1e9),
    *(1e18, -1e18, 1e60, 1e150, 1.7976931348623157e308, -1.7976931348623157e308, 10**400),
)


def places(value, at=()):
    """Where the numbers of a file are, and its lists of points, which are scaled as a whole."""
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from places(inner, (*at, key))
        if at and isinstance(value, list) and isinstance(value[0], list):
            yield at
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield at


def changed(data, at, number):
    """A number in place of another, or a list of points scaled to it."""
    table = data
    for key in at[:-1]:
        table = table[key]
    if isinstance(table[at[-1]], list):
        largest = max((abs(x) for row in table[at[-1]] for x in row), default=0.0)
        factor = 0.0 if isinstance(number, int) or largest in (0.0, 10**400) else number / largest
        table[at[-1]] = [[x if isinstance(x, int) else x * factor for x in row] for row in table[at[-1]]]
    else:
        table[at[-1]] = number


def toml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return repr(value) if isinstance(value, float) else json.dumps(value)


def write(path, data):
    path.write_text("\n".join(f"{key} = {toml(value)}" for key, value in data.items()))


def ready(path):
    """As far as a command goes before it computes."""
    if "map" in read_toml(path):
        return TileMap(read_sweep(path))
    keys = checked(PlanFile, read_toml(path), path)
    robot_file = resolve_robot(keys.robot, path, path.parent)
    sequence, problem = PlanLegs(robot_file, keys, path), build_problem(robot_file, keys, keys, path, epsilon=0.2)
    if not robot_file.is_platform:
        return sequence.waypoints.points(chosen_depth(problem, sequence))
    for leg in sequence.legs:
        leg.check(problem)
    try:
        return reference_pose(problem.robot, chosen_depth(problem, sequence))
    except InputError as error:
        raise ConfigError(path, f"robot.{error}") from error


def outcome(path):
    """Whether a file was refused; any warning, and any error that is not one line, fails."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            ready(path)
    except CsprError as error:
        assert error.exit_code == 2 and len(str(error).splitlines()) == 1 and str(path) in str(error), str(error)
        return str(error)
    return ""


CASES = {
    "a highest coefficient near zero": ("arcs", ("trajectory", "amplitude", "polynomial", 6), 5e-324, ""),
    "a target a hair below the spools": ("chosen z0", ("pose", 1, "position", 2), 5e-324, "z0.choose"),
    "z0 beyond all lengths": ("point plan", ("z0",), 1e8, "z0 = 100000000.0: must be at most 1e6 m"),
    "an inertia tensor of 1e19": ("pose plan", ("robot", "inertia"), 1e19, "robot.inertia[0][0]"),
    "a mass of 400 digits": ("pose plan", ("robot", "mass"), 10**400, "robot.mass"),
    "no gravity to speak of": ("pose plan", ("robot", "gravity"), 5e-324, ""),
}


@pytest.mark.parametrize("name", CASES)
def test_extreme_numbers_that_were_found(tmp_path, name):
    kind, at, number, words = CASES[name]
    data, path = copy.deepcopy(FILES[kind]), tmp_path / "extreme.toml"
    write(path, data)
    assert outcome(path) == ""
    changed(data, at, number)
    write(path, data)
    found = outcome(path)
    assert words in found and (words or name == "no gravity to speak of" or not found)


@pytest.mark.soak
def test_extreme_numbers(tmp_path):
    path, refused = tmp_path / "extreme.toml", []
    where = {kind: list(places(data)) for kind, data in FILES.items()}
    edits = st.sampled_from(sorted(FILES)).flatmap(
        lambda kind: st.tuples(
            st.just(kind),
            st.lists(st.tuples(st.sampled_from(where[kind]), st.sampled_from(EXTREMES)), min_size=1, max_size=4),
        )
    )

    @settings(max_examples=20_000, suppress_health_check=list(HealthCheck), database=None, deadline=None)
    @given(edits)
    def check(edit):
        kind, numbers = edit
        data = copy.deepcopy(FILES[kind])
        for at, number in numbers:
            changed(data, at, number)
        write(path, data)
        refused.append(bool(outcome(path)))

    check()
    assert 0.3 < sum(refused) / len(refused) < 0.98
