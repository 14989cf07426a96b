"""Free motions beside lines in their least time: starts from them, none slower, lines where nothing is found."""

import dataclasses
import time

import numpy as np
import pytest
from support.commands import plan
from support.motions import states_along

import cspr_jax
from cspr_jax.config.robot import resolve_robot
from cspr_jax.families.free import leg
from cspr_jax.families.free.free_motion import FreeMotion, free_motion
from cspr_jax.families.free.search.interior_point import Ending
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.schema.verdicts import Verdict

# Below the spools, where the robot can stand still, so that lines are there.
PLACES = [[0.06, 0.0, 1.5], [-0.05, 0.03, 1.4], [0.0, -0.05, 1.45]]
KEYS = {"schema": 1, "robot": "prototype", "family": "free", "starts": 1, "limits": {"tension_max": 1.6}}
STOPPED = "the search was stopped before its end"

ROBOTS = {"six": "laval-mssm", "eight": "cogiro"}
LINE = {"family": "path", "path": {"ramp_time": 0.0, "grid": 200}}
SAMPLES = 5000
# By how much least times on different grids differ.
SAME = 1e-6
PAIRS = 15  # of each kind


def asked(kind, seed):
    """A plan between two random poses below the spools, within random limits."""
    rng = np.random.default_rng(seed)
    cables, _, pulleys = kind.partition(" ")
    file = resolve_robot(ROBOTS[cables], "a plan", None)
    frame, base = frame_of(file.base_points, file.z_axis), np.asarray(file.base_points)
    radius = float(np.linalg.norm((base - base.mean(0))[:, :2], axis=1).mean())
    robot = dict(file.settings)
    if pulleys:
        count = len(base)
        robot |= {"pulley_radius": rng.uniform(0.01, 0.04, count).tolist(), "pulley_axes": [[0.0, 0.0, 1.0]] * count}
    poses = []
    for _ in range(2):
        place = radius * np.array([*rng.uniform(-0.25, 0.25, 2), rng.uniform(0.5, 0.9)])
        unit = np.array([1.0, *rng.uniform(-0.06, 0.06, 3)])
        poses.append({"position": frame.outward(place).tolist(), "quaternion": (unit / np.linalg.norm(unit)).tolist()})
    weight = file.mass * 9.81
    limits = {
        "tension_min": 0.004 * weight,
        "tension_max": weight * rng.uniform(0.6, 1.5),
        "cable_speed_max": float(np.sqrt(9.81 * radius) * rng.uniform(0.3, 0.8)),
        "acceleration_max": rng.uniform(5.0, 12.0),
    }
    return {"schema": 1, "robot": robot, "limits": limits, "pose": poses}


def compared(kind, seed):
    """Durations of free motion and straight line, s, inf without a proof, and whose motion the free one is."""
    keys = asked(kind, seed)
    free, line = (cspr_jax.plan(keys | more) for more in ({"family": "free", "starts": 2}, LINE))
    durations = [float(one.answers.duration.sum()) if one.feasible else np.inf for one in (free, line)]
    if free.feasible:
        rows = free.rows(rate=SAMPLES / durations[0])
        assert rows["tension"].max() <= keys["limits"]["tension_max"] * (1.0 + 1e-9), seed
        assert np.abs(rows["rate"]).max() <= keys["limits"]["cable_speed_max"] * (1.0 + 1e-9), seed
    return *durations, free.details(0)["source"]


def poses(count=2, **keys):
    return {"pose": [{"position": place} | keys for place in PLACES[:count]]}


def straight(count=2):
    """Durations of the straight lines, s."""
    return cspr_jax.plan(KEYS | {"starts": None} | LINE | poses(count)).answers.duration


def missed(free, rows):
    """A motion some of whose segments the proof leaves open."""
    verdict = free.answers.verdict.copy()
    verdict[rows] = Verdict.UNDECIDED
    return dataclasses.replace(free, answers=dataclasses.replace(free.answers, verdict=verdict), is_optimal=False)


def never(*arguments):
    raise AssertionError("nothing is to be searched")


@pytest.fixture(scope="module")
def begun():
    """What the search of a leg is asked, and what it finds."""
    box = []

    def grasp(*arguments):
        box.append((arguments, free_motion(*arguments)))
        return box[-1][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(leg, "free_motion", grasp)
        planned = cspr_jax.plan(KEYS | poses(3))
    return (*box[0], planned)


@pytest.mark.thorough
def test_searches_begin_from_lines_that_are_no_slower_than_straight_ones(begun):
    arguments, free, planned = begun
    (line,) = arguments[6]
    assert line.is_feasible.all()
    assert (line.duration <= straight(3) * (1.0 + 1e-9)).all()
    assert free.answers.feasible.all() and free.duration < line.duration.sum()
    assert planned.warnings == ()
    assert [segment["source"] for segment in planned.to_dict()["segments"]] == ["free", "free"]
    ends = states_along(line.motions[0], [0.0, 1.0])
    np.testing.assert_allclose(ends.velocity, 0.0, atol=1e-9)
    np.testing.assert_allclose(planned.frame.outward(ends.position), PLACES[:2], atol=1e-12)


@pytest.mark.quick("rows1")
@pytest.mark.parametrize("rows", [[0, 1], [1]])
def test_lines_stand_in_where_nothing_is_proved(monkeypatch, begun, rows):
    """On single segments, too; the plan says so, and not that nothing was found."""
    arguments, free, _ = begun
    monkeypatch.setattr(leg, "free_motion", lambda *others: missed(free, rows))
    planned = cspr_jax.plan(KEYS | poses(3))
    (line,), (warning,) = arguments[6], planned.warnings
    names = ", ".join(f"pose[{row + 1}]" for row in rows)
    assert planned.feasible
    assert 'family = "path"' in warning and f"leads to {names}; accelerations jump" in warning
    for i, segment in enumerate(planned.to_dict()["segments"]):
        assert segment["source"] == ("path" if i in rows else "free")
        expected = line.duration[i] if i in rows else free.answers.duration[i]
        assert segment["duration"] == pytest.approx(expected, rel=1e-12)
        assert segment["energy"] > 0.0 and segment["lower_bound"] < segment["duration"]


@pytest.mark.thorough
def test_a_slower_motion_gives_way_to_a_line(monkeypatch, begun):
    """Of other objectives it does not."""
    arguments, free, _ = begun
    slower = dataclasses.replace(free.answers, duration=5.0 * free.answers.duration)
    monkeypatch.setattr(leg, "free_motion", lambda *others: dataclasses.replace(free, answers=slower))
    planned = cspr_jax.plan(KEYS | poses(3))
    np.testing.assert_allclose(planned.answers.duration, arguments[6][0].duration, rtol=1e-12)
    energy = cspr_jax.plan(KEYS | poses(3) | {"objective": "energy", "duration_max": 9.0})
    assert energy.answers.source.tolist() == ["free", "free"]


@pytest.mark.thorough
def test_accelerations_that_are_asked_for_are_kept(monkeypatch, begun):
    """At rest a line begins and ends without acceleration; one that begins otherwise does not stand in."""
    _, free, _ = begun
    first = {name: getattr(free, name)[:1] for name in ("motions", "energy", "level")}
    one = dataclasses.replace(free, **first, answers=free.answers.rows(np.arange(1)))
    monkeypatch.setattr(leg, "free_motion", lambda *others: missed(one, [0]))
    resting = cspr_jax.plan(KEYS | poses(2, rest=True))
    assert resting.feasible and resting.answers.source.tolist() == ["path"]
    assert "accelerations jump" not in resting.warnings[0]
    with double_precision():
        np.testing.assert_allclose(states_along(resting.motions[0], [0.0, 1.0]).acceleration, 0.0, atol=1e-8)
    other = cspr_jax.plan(KEYS | poses(2) | {"end_accelerations": [[0.0, 0.0, 1.0]] * 2})
    assert "path" not in other.answers.source


def test_without_time_the_line_is_the_answer(monkeypatch):
    monkeypatch.setattr(leg, "free_motion", never)
    planned = cspr_jax.plan(KEYS | poses() | {"search_time": 1e-6})
    assert planned.feasible
    assert planned.answers.duration[0] <= straight()[0] * (1.0 + 1e-9)
    assert STOPPED in planned.warnings[0]
    assert not any("found no motion" in line for line in planned.warnings)


def test_ctrl_c_leaves_the_line(monkeypatch):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(leg, "free_motion", interrupted)
    planned = cspr_jax.plan(KEYS | poses())
    assert planned.feasible and planned.answers.source.tolist() == ["path"]
    assert STOPPED in planned.warnings[0]


def test_time_bounds_every_search(begun):
    """Where it is over, one optimum of each task can be enough; a search that keeps nothing says that it has ended."""
    problem, scene, poses, settings, *_ = begun[0]
    with double_precision():
        late = free_motion(problem, scene, poses, settings._replace(until=time.monotonic() - 1.0))
        assert isinstance(late, FreeMotion) and late.is_stopped and not late.is_optimal
    none, one = np.zeros(3, bool), np.array([True, False, True])
    of_task = np.array([0, 0, 1])
    assert not Ending().is_over(one)
    assert Ending(until=-1.0).is_over(none)
    assert Ending(enough=-1.0, of_task=of_task).is_over(one)
    assert not Ending(enough=-1.0, of_task=of_task).is_over(none)
    assert not Ending(enough=-1.0, of_task=of_task).is_over(np.array([True, True, False]))


@pytest.mark.parametrize(
    ("keys", "first", "line"),
    [
        (
            '[[obstacle]]\nkind = "sphere"\ncentre = [0.06, 0.0, 1.5]\nradius = 0.05',
            PLACES[0],
            "position = [0.06, 0.0, 1.5]: must be one that a motion can have: cable 1 is -0.05 m from sphere",
        ),
        ("floor = 1.45", PLACES[0], "z = 1.5 m, the floor is at 1.45"),
        ("cable_length_max = 1.5", PLACES[0], "needs 1.5"),
        ("", [0.0, 0.0, -0.2], "m above the plane of the spools"),
        ("", "rest", "pose[0].rest = true: must be where the robot can stand still: cable"),
    ],
)
def test_poses_that_no_motion_can_have_are_refused_at_once(tmp_path, monkeypatch, keys, first, line):
    monkeypatch.setattr(leg, "free_motion", never)
    head, _, tail = keys.partition("[[obstacle]]")
    text = f'schema = 1\nrobot = "prototype"\nfamily = "free"\ntension_max = 1.6\n{head}\n'
    place = "position = [1.0, 0.0, 1.5]\nrest = true" if first == "rest" else f"position = {first}"
    text += f"[[pose]]\n{place}\n[[pose]]\nposition = {PLACES[1]}\n" + (f"[[obstacle]]{tail}\n" if tail else "")
    code, out, err = plan(tmp_path, text)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and line in err


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["six pulleys", "eight"])
def test_platforms(kind):
    free, line, _ = compared(kind, 1)
    assert free <= line * (1.0 + SAME)
    assert np.isfinite(free)


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["six", "six pulleys", "eight", "eight pulleys"])
def test_pairs_of_platforms(kind, capsys):
    """No line is faster, and where one is proved, a motion is."""
    results = [compared(kind, seed) for seed in range(PAIRS)]
    ratios = np.array([free / line for free, line, _ in results if np.isfinite(line)])
    with capsys.disabled():
        sources = [source for *_, source in results]
        print(f"\n{kind}: {len(ratios)} lines, free over line {np.quantile(ratios, [0.0, 0.5, 1.0])}, {sources}")
    assert len(ratios)
    assert (ratios <= 1.0 + SAME).all()
