"""Plans of free motions: keys, accelerations at poses, motions between other families', refusals in one line."""

import numpy as np
import pytest
from support.commands import plan
from support.motions import states_along

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.numerics.elementary import double_precision

LIMITS = {"tension_max": 1.6, "cable_speed_max": 3.85}
PLACES = [[-1.1, -1.1, 0.5], [-1.1, -0.9, 1.5], [0.8, 0.5, 1.5]]
KEYS = {"schema": 1, "robot": "prototype", "family": "free", "z0": 1.7, "limits": LIMITS}


def poses(*places, **keys):
    return [{"position": place} | keys for place in places]


def ends(motion):
    with double_precision():
        return states_along(motion, [0.0, 1.0])


@pytest.fixture(scope="module")
def swung():
    return cspr_jax.plan(KEYS | {"end_accelerations": "swing", "pose": poses(*PLACES[:2])})


def test_motion_is_proved_and_above_its_bound(swung):
    (segment,) = swung.to_dict()["segments"]
    assert segment["verdict"] == "feasible"
    assert segment["objective"] == "time"
    assert 0.0 < segment["lower_bound"] < segment["duration"] < 1.8
    assert segment["gap"] == pytest.approx(1.0 - segment["lower_bound"] / segment["duration"])
    rows = swung.rows(rate=2000.0)
    assert rows["tension"].min() > 0.0
    assert rows["tension"].max() < LIMITS["tension_max"]
    assert np.abs(rows["rate"]).max() < LIMITS["cable_speed_max"]


def test_accelerations_at_the_poses_are_those_of_swings(swung):
    state = ends(swung.motions[0])
    np.testing.assert_allclose(state.position, PLACES[:2], atol=1e-12)
    np.testing.assert_allclose(state.velocity, 0.0, atol=1e-9)
    expected = -9.81 / 1.7 * (np.array(PLACES[:2]) - [0.0, 0.0, 1.7])
    np.testing.assert_allclose(state.acceleration, expected, atol=1e-6)


@pytest.mark.thorough
def test_hypocycloids_go_on_from_free_motions():
    keys = KEYS | {"family": "hypocycloid-standard", "amplitude": "quintic", "end_accelerations": "swing"}
    chosen = poses(*PLACES)
    chosen[1]["family"] = "free"
    planned = cspr_jax.plan(keys | {"pose": chosen})
    before, after = (ends(motion) for motion in planned.motions)
    np.testing.assert_allclose(before.acceleration[1], after.acceleration[0], atol=1e-6)
    assert planned.feasible


@pytest.mark.thorough
def test_accelerations_of_a_file():
    """In the axes of a file with z up, and 0 at rest."""
    chosen = [{"position": [0.0, 0.0, 1.5], "rest": True}, {"position": [0.05, 0.0, 1.4]}]
    planned = cspr_jax.plan(KEYS | {"end_accelerations": [[9.0, 9.0, 9.0], [0.0, 0.1, -0.2]], "pose": chosen})
    np.testing.assert_allclose(ends(planned.motions[0]).acceleration, [[0.0] * 3, [0.0, 0.1, -0.2]], atol=1e-6)


@pytest.mark.thorough
def test_energy_between_velocities():
    """In the axes of a file with z up; no bound of the time is told where a motion does not begin at rest."""
    chosen = [{"position": [0.0, 0.0, 1.5], "velocity": [0.3, 0.0, 0.1]}, {"position": [0.1, 0.0, 1.4], "rest": True}]
    keys = {"objective": "energy", "duration_max": 1.0, "limits": {"tension_max": 3.0}}
    planned = cspr_jax.plan(KEYS | keys | {"pose": chosen})
    (segment,) = planned.to_dict()["segments"]
    assert planned.feasible
    assert segment["duration"] <= 1.0
    assert (segment["objective"], segment["lower_bound"], segment["gap"]) == ("energy", None, None)
    state = ends(planned.motions[0])
    np.testing.assert_allclose(state.velocity, [[0.3, 0.0, 0.1], [0.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(state.acceleration[1], 0.0, atol=1e-6)
    rows = planned.rows(rate=2000.0)
    squares = np.sum(rows["tension"] ** 2, axis=1)
    assert segment["energy"] == pytest.approx(np.trapezoid(squares, rows["t"]), rel=1e-3)


@pytest.mark.ci("cogiro-1500.0-3.0-place1-0.48")
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("robot", "tension_max", "z0", "place", "longest"),
    [("laval-mssm", 60.0, 2.0, [0.2, 0.1, 2.2], 0.52), ("cogiro", 1500.0, 3.0, [1.0, 0.5, 2.5], 0.48)],
)
def test_platforms_leave_rest(robot, tension_max, z0, place, longest):
    """Six and eight cables; samples of the proved motion agree."""
    keys = {"robot": robot, "z0": z0, "limits": {"tension_max": tension_max}}
    planned = cspr_jax.plan(KEYS | keys | {"pose": [{"rest": True}, *poses(place)]})
    (segment,) = planned.to_dict()["segments"]
    assert segment["verdict"] == "feasible"
    assert segment["lower_bound"] < segment["duration"] < longest
    tensions = planned.rows(rate=2000.0)["tension"]
    assert tensions.min() > -1e-9
    assert tensions.max() < tension_max + 1e-9


@pytest.mark.soak
def test_nothing_is_found():
    """Below 3 m/s no motion stays taut between these poses."""
    planned = cspr_jax.plan(KEYS | {"limits": LIMITS | {"speed_max": 3.0}, "pose": poses(*PLACES[:2])})
    assert not planned.feasible
    assert any("found no motion that keeps all limits" in line for line in planned.warnings)


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ('end_accelerations = "swing"', 'z0 is missing: depth of P0, m, about which end_accelerations = "swing" are'),
        ("end_accelerations = [[0.0, 0.0, 1.0]]", "must be one [x, y, z] for each of the 2 poses"),
        ('objective = "beauty"', 'objective = "beauty"'),
        (
            'objective = "margin"',
            'duration_max is missing: longest duration of a segment, s, which objective = "margin"',
        ),
        ("starts = 0", "starts = 0"),
        ("search_time = -1.0", "search_time = -1.0"),
        ("tension_min = 0.1", "tension_max = (missing): must be a number"),
    ],
)
def test_mistakes(tmp_path, keys, line):
    limits = "" if "tension_min" in keys else "tension_max = 1.6\n"
    text = f'schema = 1\nrobot = "prototype"\nfamily = "free"\n{limits}{keys}\n'
    text += "".join(f"[[pose]]\nposition = {place}\n" for place in PLACES[:2])
    code, _, err = plan(tmp_path, text)
    assert code == 2
    assert err.count("\n") == 1
    assert line in err


def test_keys_of_others():
    with pytest.raises(ConfigError, match="end_accelerations: must be absent unless"):
        cspr_jax.plan(KEYS | {"family": "path", "end_accelerations": "free", "pose": poses(*PLACES[:2])})
    with pytest.raises(ConfigError, match="arcs"):
        cspr_jax.plan(KEYS | {"pose": [*poses(PLACES[0]), *poses(PLACES[1], arcs=3)]})
