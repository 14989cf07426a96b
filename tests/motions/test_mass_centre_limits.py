"""Limits of the speed and the acceleration of the mass centre, in all families; the margin that tensions keep."""

import numpy as np
import pytest
from support.commands import plan

import cspr_jax
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.motion.cause import Cause
from cspr_jax.motion.given_limits import limits_over

# Up by a quintic law within a second: largest speed 1.875 times the way, largest acceleration 10 / sqrt(3) times.
WAY, SPEED, ACCELERATION = 0.1, 1.875, 10.0 / np.sqrt(3.0)
TIMES = np.linspace(0.0, 1.0, 201)
LAW = TIMES**3 * (10.0 - 15.0 * TIMES + 6.0 * TIMES**2)
RATE = 30.0 * TIMES**2 * (1.0 - TIMES) ** 2
BEND = 60.0 * TIMES * (1.0 - TIMES) * (1.0 - 2.0 * TIMES)
DIRECTION = np.array([0.3, 0.2, -np.sqrt(1.0 - 0.13)])
MOTION = {
    "times": TIMES,
    "positions": [0.0, 0.0, 1.4] + WAY * LAW[:, None] * DIRECTION,
    "velocities": WAY * RATE[:, None] * DIRECTION,
    "accelerations": WAY * BEND[:, None] * DIRECTION,
}


def checked(robot="prototype", **limits):
    return cspr_jax.check(robot, **MOTION, limits=limits)


@pytest.mark.parametrize(
    ("name", "largest", "flag"),
    [("speed_max", SPEED, "too_fast"), ("acceleration_max", ACCELERATION, "over_acceleration")],
)
def test_a_motion_is_proved_up_to_its_largest_value(name, largest, flag):
    value = WAY * largest
    above, below = checked(**{name: value * 1.0001}), checked(**{name: value * 0.9999})
    assert above.verdict == "feasible" and below.verdict == flag
    demand = above.to_dict()["demands"][name]
    assert demand["value"] == pytest.approx(value, rel=1e-4) and value <= demand["bound"] <= value * 1.0001
    cause = below.to_dict()["cause"][0]
    assert cause["criterion"] == flag and cause["needed"] == pytest.approx(value, rel=1e-4) and cause["cable"] is None
    text = Cause(flag, t=0.5, needed=0.2, allowed=0.1, unit=cause["unit"]).text.replace("²", "^2")
    assert text == f"the mass centre needs 0.2 {cause['unit']} at t = 0.50 s, 0.1 allowed"
    # It fails exactly where the law exceeds the limit.
    rates = {"speed_max": RATE, "acceleration_max": np.abs(BEND)}[name] * WAY
    times = TIMES[rates > value * 0.9999]
    start, end = below.failing[0][0], below.failing[-1][1]
    assert start == pytest.approx(times[0], abs=0.01) and end == pytest.approx(times[-1], abs=0.01)


@pytest.mark.thorough
def test_platforms_too():
    """The mass centre of a platform that turns, and not another point of it."""
    quaternions = np.stack([np.cos(0.2 * LAW), 0.0 * LAW, 0.0 * LAW, np.sin(0.2 * LAW)], axis=1)
    motion = {"times": TIMES, "positions": [0.0, 0.0, 1.5] + WAY * LAW[:, None] * DIRECTION, "quaternions": quaternions}
    for fraction, verdict in ((1.001, "feasible"), (0.999, "too_fast")):
        assert cspr_jax.check("cogiro", **motion, limits={"speed_max": fraction * WAY * SPEED}).verdict == verdict


def test_tensions_keep_a_margin():
    bare = checked(tension_min=0.05, tension_max=2.0)
    for margin in (0.1, 0.2):
        kept = checked(tension_min=0.05, tension_max=2.0, tension_margin=margin)
        same = checked(tension_min=0.05 + margin, tension_max=2.0 - margin)
        assert kept.margin == pytest.approx(bare.margin - margin, abs=1e-3) == pytest.approx(same.margin, abs=1e-3)
    alone = checked(tension_margin=0.1)
    assert alone.margin == pytest.approx(checked(tension_min=0.1).margin, abs=1e-3)
    with pytest.raises(ConfigError, match=r"tension_margin = 1\.0: must be less than half of the range"):
        cspr_jax.check("prototype", **MOTION, limits={"tension_min": 0.05, "tension_max": 2.0, "tension_margin": 1.0})


POSES = "[[pose]]\nrest = true\n[[pose]]\nposition = [0.5, 0, 1.4]\n"
REST = {"position": [0.0, 0.0, 1.4], "rest": True}
LINE = {"robot": "prototype", "pose": [REST, {"position": [0.1, 0.05, 1.5], "rest": True}]}
SWING = {"z0": 1.4, "pose": [{"rest": True}, {"position": [0.3, 0.2, 1.5]}]}
CIRCLE = {"centre": [0.0, 0.0, 1.4], "radius": 0.2, "frequency": 2.5}
# By family: a feasible plan of one segment whose time no limit stretches, or None; and one whose time it does.
FIXED = {
    "hypocycloid-standard": {"robot": "prototype", **SWING},
    "transition": {"robot": "prototype", **SWING, "pose": [{"rest": True}, {"position": [0.4, 0.2, 1.5]}]},
    "hypocycloid": {"robot": "laval-mssm", **SWING, "pose": [{"rest": True}, {"position": [0.3, 0.2, 1.4]}]},
    "ellipse": {"robot": "prototype", "ellipse": CIRCLE, "turns": 1.0, "pose": [{}, {}]},
}
FASTEST = {
    "s-curve": LINE,
    "quintic": LINE,
    "cubic": LINE,
    "bezier": {"robot": "prototype", "pose": [{"position": [0.0, 0.0, 1.4]}, {"position": [0.1, 0.05, 1.5]}]},
}
RATES = {"speed_max": "velocity", "acceleration_max": "acceleration"}
QUICK = ("hypocycloid-standard", "s-curve", "bezier")


def families(table):
    return [name if name in QUICK else pytest.param(name, marks=pytest.mark.thorough) for name in table]


def largest(planned):
    """Largest speed and acceleration of the mass centre, at many rows; and that the JSON has them."""
    segment, rows = planned.to_dict()["segments"][0], planned.rows()
    values = {name: float(np.linalg.norm(rows[rate], axis=1).max()) for name, rate in RATES.items()}
    for name, value in values.items():
        # Rows miss the peaks of the S-model.
        assert value <= segment[name] * (1.0 + 1e-9) and segment[name] == pytest.approx(value, rel=0.01)
    return {name: segment[name] for name in RATES}


@pytest.mark.ci("ellipse")
@pytest.mark.thorough
@pytest.mark.parametrize("family", families(FIXED))
def test_motions_of_their_own_time_are_checked(family):
    keys = {"schema": 1, "family": family, "samples": 2001, **FIXED[family]}
    bare = cspr_jax.plan(keys)
    assert bare.feasible
    arcs = int(bare.answers.tried_arcs[0])
    keys |= {"pose": [keys["pose"][0], keys["pose"][1] | ({"arcs": arcs} if arcs else {})]}
    for (name, value), flag in zip(largest(bare).items(), ("too_fast", "over_acceleration"), strict=True):
        assert cspr_jax.plan(keys | {name: 1.0001 * value}).feasible
        (segment,) = cspr_jax.plan(keys | {name: 0.999 * value}).to_dict()["segments"]
        assert segment["verdict"].removeprefix("no_arcs+") == flag
        cause = segment["cause"][0]
        assert cause["criterion"] == flag and cause["needed"] == pytest.approx(value, rel=1e-6)


@pytest.mark.quick("bezier")
@pytest.mark.parametrize("family", families(FASTEST))
def test_motions_in_the_least_time_keep_them(family):
    keys = {"schema": 1, "family": family, "samples": 2001, **FASTEST[family]}
    bare = cspr_jax.plan(keys)
    for name, value in largest(bare).items():
        slower = cspr_jax.plan(keys | {name: 0.5 * value})
        assert slower.feasible and slower.answers.duration[0] > 1.02 * bare.answers.duration[0]
        # It is as fast as it may be.
        reached = largest(slower)[name]
        assert reached == pytest.approx(0.5 * value, rel=1e-4) and reached <= 0.5 * value * (1.0 + 1e-9)


def test_poses_at_rest_refuse_them():
    robot = cspr_jax.load_robot("prototype")
    with pytest.raises(InputError, match=r"acceleration_max = 1\.0: must be absent where no motion is checked"):
        limits_over(robot, cspr_jax.Limits(acceleration_max=1.0))


@pytest.mark.parametrize("value", ["0", "-1.0", "nan", "[1.0, 1.0]"])
def test_values_that_are_none(tmp_path, value):
    code, _, err = plan(tmp_path, f'schema = 1\nrobot = "prototype"\nspeed_max = {value}\n{POSES}')
    assert code == 2 and "speed_max = " in err and err.count("\n") == 1
