"""Plans on ellipses against plain NumPy at 20,001 instants: limits, joints, turns, and the least numbers of arcs."""

import numpy as np
import pytest
from oracles import ellipses as oracle
from oracles.beziers import cable_states, tensions
from oracles.lines import tension_margin
from support.ellipses import triangle
from support.motions import states_along

import cspr_jax

GRAVITY, MASS, INSTANTS = 9.81, 0.8, 20_001
LEVEL = [[np.sqrt(0.75), -0.5, 0.0], [-np.sqrt(0.75), -0.5, 0.0], [0.0, 1.0, 0.0]]
TILTED = [[1.0, 0.2, 0.1], [-0.6, 1.1, -0.2], [-0.7, -0.9, 0.05]]
LIMITS = {"tension_min": 0.2, "tension_max": 9.0, "cable_speed_max": 2.6, "floor": 2.6}


def made(spools, poses, **keys):
    robot = {"name": "r", "base_points": np.asarray(spools).tolist(), "mass": MASS, "gravity": GRAVITY}
    planar = {"planar": True} if oracle.is_planar(np.asarray(spools)) else {}
    return {"schema": 1, "robot": robot | planar, "family": "ellipse", "pose": poses, **keys}


def at_rest(*position):
    return {"rest": True, "position": list(position)}


def on_ellipse(centre, a, b, frequency="natural", phase=0.0, **keys):
    axes = [list(x) for x in (a, b) if np.any(x)]
    return {"ellipse": {"centre": list(centre), "half_axes": axes, "frequency": frequency, "phase": phase}} | keys


def sampled(motion):
    return list(states_along(motion, np.linspace(0.0, 1.0, INSTANTS))[:3])


def breaches(spools, limits, position, velocity, acceleration):
    """Limits that a motion breaks at its instants, z down."""
    tension = tensions(spools, MASS, GRAVITY, position, acceleration)
    _, rate, _ = cable_states(spools, position, velocity, acceleration)
    broken = {
        "tension_min": tension.min() < limits.get("tension_min", 0.0),
        "tension_max": tension.max() > limits.get("tension_max", np.inf),
        "cable_speed_max": np.abs(rate).max() > limits.get("cable_speed_max", np.inf),
        "floor": position[:, 2].max() > limits.get("floor", np.inf),
        "above": oracle.depths(spools, position).min() < 0.0,
    }
    return {name for name, is_broken in broken.items() if is_broken}


def check_plan(keys):
    """Compare a plan with samples; the plan."""
    spools, limits = np.array(keys["robot"]["base_points"]), {k: keys[k] for k in LIMITS if k in keys}
    found = cspr_jax.plan(keys)
    segments, ends = found.to_dict()["segments"], []
    for i, (motion, segment) in enumerate(zip(found.motions, segments, strict=True)):
        states, step = sampled(motion), segment["duration"] / (INSTANTS - 1)
        position, velocity, acceleration = states
        # Velocities and accelerations are those of the places: a rule of the fourth order, but where the jerk jumps.
        rise = 0.5 * step * (velocity[1:] + velocity[:-1]) - step**2 / 12.0 * np.diff(acceleration, axis=0)
        np.testing.assert_allclose(np.diff(position, axis=0), rise, atol=1e-11)
        change = 0.5 * step * (acceleration[1:] + acceleration[:-1])
        np.testing.assert_allclose(np.diff(velocity, axis=0), change, atol=10.0 * step**2)
        is_broken = breaches(spools, limits, *states)
        assert segment["verdict"] != "undecided" and bool(is_broken) == (not found.answers.feasible[i]), segment
        pose, start = keys["pose"][i + 1], keys["pose"][i]
        if "ellipse" in pose:
            table = pose["ellipse"]
            centre, (a, b) = np.array(table["centre"]), np.array([*table["half_axes"], [0.0] * 3])[:2]
            if table["frequency"] == "natural":
                exact = np.sqrt(GRAVITY / oracle.depths(spools, centre))
                assert segment["frequency"] == pytest.approx(exact, rel=1e-12)
            frequency = segment["frequency"]
            angle = 2.0 * np.pi * pose.get("turns", 0.0)
            count = int(angle / frequency / step)
            angles = table["phase"] + angle - frequency * step * np.arange(count + 1)[::-1]
            for state, exact in zip(states, oracle.states(centre, a, b, frequency, angles), strict=True):
                np.testing.assert_allclose(state[INSTANTS - 1 - count :], exact[0], atol=1e-9)
        for k, here in ((0, start), (-1, pose)):
            if here.get("rest"):
                np.testing.assert_allclose(position[k], here["position"], atol=1e-12)
                assert np.abs(velocity[k]).max() < 1e-10 and np.abs(acceleration[k]).max() < 1e-9
        if ends:
            for before, after in zip(ends, states, strict=True):
                np.testing.assert_allclose(before, after[0], atol=1e-9)
        ends = [x[-1] for x in states]
    return found


def check_fewest_arcs(keys):
    """With fewer arcs each segment of a plan, which is feasible, breaks limits; how many fewer were tried."""
    found, tried = check_plan(keys), 0
    assert found.feasible
    spools, limits = np.array(keys["robot"]["base_points"]), {k: keys[k] for k in LIMITS if k in keys}
    arcs = [segment["arcs"] for segment in found.to_dict()["segments"]]
    for i, number in enumerate(arcs):
        rests = keys["pose"][i].get("rest") or keys["pose"][i + 1].get("rest")
        for fewer in range(1 if rests else 2, number, 1 if rests else 2):
            poses = [pose | {"arcs": n} for pose, n in zip(keys["pose"][1:], arcs, strict=True)]
            poses[i]["arcs"] = fewer
            other = cspr_jax.plan(keys | {"pose": [keys["pose"][0], *poses]})
            assert not other.answers.feasible[i]
            assert breaches(spools, limits, *sampled(other.motions[i]))
            tried += 1
    return tried


SWING = [
    at_rest(0.0, 0.0, 2.0),
    on_ellipse([0.1, 0.0, 2.0], [1.2, 0.0, 0.1], [0.0, 0.9, 0.0], phase=0.7, turns=1.25),
    at_rest(0.0, 0.1, 2.1),
]
CHANGES = [
    on_ellipse([0.0, 0.0, 2.0], [0.5, 0.0, 0.0], [0.0, 0.4, 0.0], phase=1.0),
    on_ellipse([0.1, -0.1, 1.8], [0.3, 0.3, 0.1], [-0.3, 0.5, 0.0], 2.5, turns=0.6),
    on_ellipse([-0.1, 0.0, 2.2], [0.7, 0.0, 0.0], [0.0, 0.0, 0.0], 2.0, phase=2.0),
]


@pytest.mark.thorough
def test_from_rest_to_an_ellipse_and_back():
    assert check_fewest_arcs(made(LEVEL, SWING)) >= 1


def test_from_ellipse_to_ellipse():
    assert check_plan(made(TILTED, CHANGES)).feasible


def test_limits_are_kept():
    assert check_fewest_arcs(made(TILTED, SWING, **LIMITS)) >= 1


def test_in_a_plane():
    poses = [
        at_rest(0.1, 0.0, 1.5),
        on_ellipse([0.0, 0.0, 1.5], [1.5, 0.0, 0.0], [0.0, 0.0, 0.3], turns=2.0),
        on_ellipse([0.1, 0.0, 1.3], [0.9, 0.0, 0.0], [0.0, 0.0, 0.0]),
        at_rest(0.0, 0.0, 1.3),
    ]
    check_plan(made([[0.8, 0.0, 0.0], [-0.8, 0.0, 0.0]], poses, tension_max=12.0))


@pytest.mark.thorough
@pytest.mark.parametrize("height", [0.0, 0.4])
def test_four_cables(height):
    """Spools in one plane, and in two; tensions within limits exist at all instants, by linear programs."""
    spools = np.array([[1.0, 0.8, 0.0], [-0.9, 1.0, height], [-1.0, -0.9, 0.0], [1.0, -1.0, height]])
    limits = {"tension_min": 0.3, "tension_max": 8.0}
    found = cspr_jax.plan(made(spools, SWING, **limits))
    assert found.feasible
    rotated = np.array([1.0, 1.0, -1.0])  # that oracle's z points up
    for motion, segment in zip(found.motions, found.to_dict()["segments"], strict=True):
        position, _, acceleration = (x[:: INSTANTS // 150] for x in sampled(motion))
        margin = min(
            tension_margin(spools * rotated, x * rotated, a * rotated, mass=MASS, gravity=GRAVITY, **limits)
            for x, a in zip(position, acceleration, strict=True)
        )
        assert 0.0 < segment["margin_bound"] <= margin + 1e-9 and margin == pytest.approx(segment["margin"], rel=0.02)


def random_plan(rng):
    """Random ellipses and rests below random spools, most of them feasible."""
    spools = triangle(rng)
    size, poses, is_rest = np.ptp(spools, axis=0).max(), [], rng.random() < 0.5
    for _ in range(4):
        centre = rng.dirichlet(3.0 * np.ones(3)) @ spools
        centre[2] += size * rng.uniform(0.8, 2.0)
        if is_rest:
            poses.append(at_rest(*centre.tolist()))
        else:
            a, b = (size * rng.uniform(0.05, 0.5) * rng.normal(size=(2, 3)) * [1.0, 1.0, 0.2]).tolist()
            natural = np.sqrt(GRAVITY / oracle.depths(spools, centre))
            frequency = "natural" if rng.random() < 0.3 else float(natural * rng.uniform(0.8, 1.2))
            poses.append(on_ellipse(centre.tolist(), a, b, frequency, float(rng.uniform(-3.0, 6.0))))
            poses[-1] |= {"turns": float(rng.uniform(0.0, 2.0))} if len(poses) > 1 else {}
        is_rest = not is_rest and rng.random() < 0.6
    mean = MASS * GRAVITY / 3.0
    limits = {"tension_max": 4.0 * mean, "tension_min": 0.02 * mean, "cable_speed_max": 3.0 * size}
    return made(spools, poses, max_arcs=12, **(limits if rng.random() < 0.5 else {}))


@pytest.mark.soak
def test_random_plans():
    rng = np.random.default_rng(0)
    feasible = [check_plan(random_plan(rng)).answers.feasible for _ in range(12)]
    assert 5 < np.concatenate(feasible).sum() < 36
