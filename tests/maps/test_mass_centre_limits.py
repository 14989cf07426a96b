"""Limits of the speed and the acceleration of the mass centre in every kind of map that takes limits of motions.

Speeds and accelerations are differences of the positions of each cell's motion: no derivative of the package is used.
"""

import numpy as np
import pytest
from support.commands import cspr

import cspr_jax
from cspr_jax.plans.cell_plan import cell_plan
from cspr_jax.schema.map_kinds import MAP_KINDS
from cspr_jax.schema.verdicts import Verdict

REST, PLACE = {"rest": True}, {"position": [0.05, 0.05, 1.4]}
PLATFORM = {"family": "hypocycloid", "amplitude": {"name": "effective-c3", "epsilon": 0.15}, "max_arcs": 8}
LINE = {"robot": "prototype", "axes": {"x": [-0.1, 0.0, 0.12], "y": [-0.05, 0.1], "z": [1.4]}}
# By kind: a map of motions whose time is their own, and one of motions as fast as limits allow.
FIXED = {
    "ellipse": {
        "robot": "prototype",
        "axes": {"x": [-0.2, 0.0], "y": [-0.1, 0.1], "z": [1.0], "circle_radius": [0.1, 0.3, 0.5]},
        "trajectory": {"family": "ellipse"},
    },
    "minimum-oscillations": {
        "robot": "prototype",
        "axes": {"x": [-0.9, -0.3, 0.2], "y": [-0.5, 0.1], "z": [1.5], "z0": [1.5]},
        "trajectory": {"family": "transition", "amplitude": "quintic", "max_arcs": 24},
    },
    "minimum-arcs": {
        "robot": "prototype",
        "axes": {"x": [-0.9, -0.3, 0.2], "y": [-0.5, 0.1, 0.8], "z": [1.5], "z0": [1.5]},
        "trajectory": {"family": "hypocycloid-standard", "max_arcs": 12, "from": {"position": [0.3, 0.2, 1.5]}},
    },
    "redundant arcs": {
        "map": "minimum-arcs",
        "robot": "boralugoda-rectangle",
        "axes": {"x": [18.0, 24.0, 30.0], "y": [16.0, 18.0], "z": [8.0], "z0": [20.0]},
        "trajectory": {"family": "hypocycloid-standard", "from": REST, "max_arcs": 4},
    },
    "poses": {
        "robot": "laval-mssm",
        "axes": {"x": [-1.0, 0.3, 1.4], "y": [0.2], "z": [1.7], "z0": [1.7]},
        "trajectory": {**PLATFORM, "from": REST},
    },
    "redundant poses": {
        "map": "poses",
        "robot": "cogiro",
        "axes": {"x": [-1.0, 0.3, 1.4], "y": [0.2], "z": [1.7], "z0": [4.0]},
        "trajectory": {**PLATFORM, "max_arcs": 4, "from": REST},
    },
    "orientations": {
        "robot": "laval-mssm",
        "axes": {"x": [0.0], "y": [0.9, 1.29], "z": [1.7]},
        "trajectory": {**PLATFORM, "max_arcs": 6},
        "orientations": {"divisions": 4},
    },
}
FASTEST = {
    "least-time": LINE | {"trajectory": {"family": "s-curve", "max_acceleration": 10.0, "from": PLACE}},
    "paths": LINE | {"map": "least-time", "trajectory": {"family": "path", "from": PLACE}},
    "free": {
        **LINE,
        "map": "least-time",
        "axes": {"x": [-0.2, 0.2], "y": [0.1], "z": [1.4]},
        "trajectory": {"family": "free", "from": PLACE},
        "limits": {"tension_max": 3.0},
    },
}
QUICK, PLATFORMS = ("ellipse",), ("poses", "redundant poses", "orientations")
FLAGS = {"speed_max": Verdict.TOO_FAST, "acceleration_max": Verdict.OVER_ACCELERATION}
MOST = 12  # cells whose plans are looked at
FAR = dict.fromkeys(FLAGS, 1e6)  # the other limit is given all the same, so that kernels compile once


def cases():
    """Each kind, and that of point masses in both axes."""
    both = [(name, False) for name in FIXED] + [(name, True) for name in FIXED if name not in PLATFORMS]
    marks = {case: pytest.mark.soak if case[1] else pytest.mark.thorough for case in both if case[0] not in QUICK}
    return [pytest.param(*case, marks=marks.get(case, ())) for case in both]


def turned_over(keys):
    """The same map where z points the other way: robot, places, and heights."""
    robot = cspr_jax.load_robot(keys["robot"])
    base = (np.asarray(robot.base_points) * [1.0, 1.0, -1.0]).tolist()
    own = {"name": "turned over", "base_points": base, "mass": float(robot.mass)}
    own["z_axis"] = "up" if robot.z_axis == "down" else "down"
    start = keys["trajectory"].get("from", {})
    if "position" in start:
        start = {"position": [*start["position"][:2], -start["position"][2]]}
    trajectory = keys["trajectory"] | ({"from": start} if start else {})
    return keys | {
        "robot": own,
        "trajectory": trajectory,
        "axes": keys["axes"] | {"z": [-z for z in keys["axes"]["z"]]},
    }


def computed(folder, keys, **limits):
    limits = keys.get("limits", {}) | limits
    return cspr_jax.open_result(cspr_jax.run({"schema": 1, **keys} | ({"limits": limits} if limits else {}), folder))


def cells_of(result):
    """Index, coordinates and values of each cell."""
    for index in np.ndindex(*(len(points) for points in result.axes.values())):
        place = {name: float(points[i]) for (name, points), i in zip(result.axes.items(), index, strict=True)}
        yield index, place, {name: values[index] for name, values in result.data.items()}


def largest(planned):
    """Largest speed and acceleration by differences of positions: never more than the motion has, nearly as much."""
    rows = planned.rows()
    step = rows["t"][1] - rows["t"][0]
    speed, acceleration = (np.diff(rows["position"], n=n, axis=0) / step**n for n in (1, 2))
    return {name: np.linalg.norm(x, axis=1).max() for name, x in zip(FLAGS, (speed, acceleration), strict=True)}


def motions_of(result):
    """Plan and largest speed and acceleration of some feasible cells, by their indices."""
    found, verdict, duration = {}, result.data["verdict"], result.data["duration"]
    cells = [cell for cell in cells_of(result) if verdict[cell[0]] == 0 and duration[cell[0]] > 0.0]
    for index, place, values in cells[:: len(cells) // MOST + 1]:
        planned = cspr_jax.plan(cell_plan(result.settings, place, values, samples=2000))
        assert planned.feasible
        found[index] = planned, largest(planned)
    return found


def between(peaks):
    """A limit far from every peak, which about half of them exceed."""
    ordered = np.sort(peaks)
    middle = ordered[len(ordered) // 4 : 3 * len(ordered) // 4 + 2]
    gap = int(np.argmax(np.diff(middle)))
    return float(0.5 * (middle[gap] + middle[gap + 1]))


@pytest.mark.ci("minimum-arcs-False", "minimum-oscillations-False")
@pytest.mark.parametrize(("kind", "is_turned"), cases())
def test_motions_of_their_own_time_are_checked(tmp_path, kind, is_turned):
    keys = {"map": kind} | FIXED[kind]
    keys = turned_over(keys) if is_turned else keys
    bare = computed(tmp_path / "bare", keys)
    motions = motions_of(bare)
    for name, flag in FLAGS.items():
        limit = between([peaks[name] for _, peaks in motions.values()])
        limited = computed(tmp_path / name, keys, **FAR | {name: limit})
        assert (limited.data["verdict"][bare.data["verdict"] != 0] != 0).all()
        changed = 0
        for index, place, values in cells_of(limited):
            verdict = Verdict(int(values["verdict"]))
            if index not in motions:
                continue
            peaks = motions[index][1]
            if peaks[name] < limit:
                assert verdict == 0 and values["duration"] == pytest.approx(bare.data["duration"][index], rel=1e-12)
                continue
            planned = cspr_jax.plan(cell_plan(limited.settings, place, values, samples=2000))
            segment = planned.to_dict()["segments"][0]
            assert segment["verdict"].removeprefix("no_arcs+") == (verdict & ~Verdict.NO_ARCS).text
            if verdict == 0:
                assert largest(planned)[name] < limit
            else:
                assert verdict & flag and not verdict & ~(flag | Verdict.NO_ARCS)
                assert segment["cause"][0]["criterion"] == flag.text
            changed += 1
        assert 0 < changed < len(motions)


@pytest.mark.ci("least-time-False")
@pytest.mark.thorough
@pytest.mark.parametrize("is_turned", [False, pytest.param(True, marks=pytest.mark.soak)])
@pytest.mark.parametrize("kind", FASTEST)
def test_motions_in_the_least_time_keep_them(tmp_path, kind, is_turned):
    keys = {"map": kind} | FASTEST[kind]
    keys = turned_over(keys) if is_turned else keys
    bare = computed(tmp_path / "bare", keys)
    for name in FLAGS:
        limit = 0.7 * float(np.median([peaks[name] for _, peaks in motions_of(bare).values()]))
        limited = computed(tmp_path / name, keys, **FAR | {name: limit})
        motions = motions_of(limited)
        np.testing.assert_array_equal(limited.data["verdict"] == 0, bare.data["verdict"] == 0)
        assert len(motions) > 1
        for index, (planned, peaks) in motions.items():
            assert peaks[name] <= limit * (1.0 + 1e-9)
            duration, rel = limited.data["duration"][index], 2e-2 if kind == "free" else 1e-3
            # Plans of free motions look from more starts.
            assert planned.to_dict()["segments"][0]["duration"] == pytest.approx(duration, rel=rel)
            assert duration > 1.001 * bare.data["duration"][index] or peaks[name] < 0.999 * limit
        if kind != "least-time":
            assert (limited.data["lower_bound"] <= limited.data["duration"]).all()


SHORT = "[axes]\nx = [0.0]\ny = [0.1]\nz = [1.4]\n"


@pytest.mark.quick("speed_max-workspace", "acceleration_max-swing-range")
@pytest.mark.parametrize("kind", ["transition-envelopes", "feasible-acceleration", "swing-range", "workspace"])
@pytest.mark.parametrize("name", FLAGS)
def test_maps_without_motions_refuse_them_in_one_line(tmp_path, kind, name):
    """They name the limits that they take."""
    (family,) = MAP_KINDS[kind].families or ("",)
    trajectory = f'[trajectory]\nfamily = "{family}"\nfrom = {{ position = [0, 0, 1] }}\n' if family else ""
    path = tmp_path / "s.toml"
    path.write_text(f'schema = 1\nmap = "{kind}"\nrobot = "prototype"\n{SHORT}{trajectory}[limits]\n{name} = 1.0\n')
    code, out, err = cspr("run", path, "-o", tmp_path / "run")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"{path}: limits.{name}: must be absent in this map, which takes {MAP_KINDS[kind].limits[0]}" in err
    assert not (tmp_path / "run").exists()
