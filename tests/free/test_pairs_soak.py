"""Free motions of random pairs of poses beside closed forms: one wherever these have one, never slower, and proved."""

import numpy as np
import pytest

import cspr_jax
from cspr_jax.config.robot import resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.numerics.linear.frames import frame_of

pytestmark = pytest.mark.soak

# Pairs of each robot for which closed forms are asked; free motions are where one of these is proved.
PAIRS = {
    "prototype": 150,
    "transition-prototype": 150,
    "laval-large": 150,
    "boralugoda-triangle": 150,
    "boralugoda-rectangle": 150,
    "cdpyr-3t": 150,
    "boralugoda-planar-two": 150,
    "transition-planar": 150,
    "laval-mssm": 30,
    "cogiro": 30,
}
FAMILIES = {
    "2T": ("transition", "quintic", "s-curve"),
    "3T": ("hypocycloid-standard", "quintic", "s-curve"),
    "3R3T": ("hypocycloid",),
}
SAMPLES = 20_000
# By how much of a duration searches miss that of the best motion.
MISSED = 1e-3


def asked(name, seed):
    """A plan to a place, from rest in P0 or from another place, within random limits."""
    rng = np.random.default_rng(seed)
    file = resolve_robot(name, "a plan", None)
    frame, base = frame_of(file.base_points, file.z_axis), np.asarray(file.base_points)
    radius = float(np.linalg.norm((base - base.mean(0))[:, :2], axis=1).mean())
    z0, wide = radius * rng.uniform(1.5, 4.0), 0.4 if file.is_platform else 2.0
    poses = []
    for _ in range(2):
        far, angle = radius * rng.uniform(0.0, wide), rng.uniform(0.0, 2.0 * np.pi)
        level = [far * np.cos(angle), 0.0 if file.is_planar else far * np.sin(angle)]
        poses.append({"position": frame.outward(np.array([*level, z0 * rng.uniform(0.6, 1.4)])).tolist()})
    if rng.uniform() < 0.5:
        poses[0] = {"rest": True}
    limits = {"tension_max": float(file.mass * 9.81 * rng.uniform(0.8, 4.0))}
    if rng.uniform() < 0.5:
        limits["cable_speed_max"] = float(np.sqrt(9.81 * z0) * rng.uniform(0.5, 2.0))
    return file.own_pattern, {"schema": 1, "robot": name, "z0": z0, "limits": limits, "pose": poses}


def closed_forms(pattern, keys):
    """Durations of proved motions of other families, s."""
    durations = {}
    for family in FAMILIES[pattern]:
        try:
            planned = cspr_jax.plan(keys | {"family": family})
        except ConfigError:
            continue  # the family joins other poses
        if planned.feasible:
            durations[family] = float(planned.answers.duration.sum())
    return durations


@pytest.mark.parametrize("name", PAIRS)
def test_pairs(name, capsys):
    asks, slower, ratios = 0, [], []
    for seed in range(PAIRS[name]):
        pattern, keys = asked(name, seed)
        durations = closed_forms(pattern, keys)
        if not durations:
            continue
        planned = cspr_jax.plan(keys | {"family": "free"})
        asks += 1
        least, (segment,) = min(durations.values()), planned.to_dict()["segments"]
        ratios.append(segment["duration"] / least)
        if not planned.feasible or ratios[-1] > 1.0 + MISSED:
            slower.append((seed, segment["verdict"], segment["duration"], durations))
            continue
        rows = planned.rows(rate=SAMPLES / segment["duration"])
        assert rows["tension"].min() >= -1e-9, seed
        assert rows["tension"].max() <= keys["limits"]["tension_max"] * (1.0 + 1e-9), seed
        if "cable_speed_max" in keys["limits"]:
            assert np.abs(rows["rate"]).max() <= keys["limits"]["cable_speed_max"] * (1.0 + 1e-9), seed
    with capsys.disabled():
        print(f"\n{name}: {asks} pairs, free over closed forms {np.quantile(ratios, [0.0, 0.5, 1.0])}")
        print(*slower, sep="\n")
    assert not slower
