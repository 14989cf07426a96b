"""Stops of platforms, parallel pairs and among obstacles by an oracle apart: poses, gaps, tensions of many samples."""

import dataclasses
import itertools
import tomllib
from pathlib import Path

import numpy as np
import pytest
from oracles import any_motion
from oracles.sampled_motion import State
from scipy.spatial.transform import Rotation

import cspr_jax
from cspr_jax.motion.motion import states_at
from cspr_jax.numerics.elementary import double_precision

# Limits that are touched may be missed by this fraction of the weight, and rounding leaves this much of continuity.
TOUCHED, SAME = 1e-5, 1e-6
SAMPLES = 600
CATALOGUE = Path(cspr_jax.__file__).parent / "catalogue"


@dataclasses.dataclass(frozen=True)
class Case:
    """A robot, keys of its plan, depth or height, size of the motion, m, and cables that break."""

    robot: object
    height: float
    size: float
    keys: dict
    broken: tuple = ()
    share: float = 1.0  # of margins of pairs of cables, in each of them
    instants: int = 10

    @property
    def is_platform(self):
        return not isinstance(self.robot, dict)


CORNERS = [[1.1, 0.9, 0.0], [-1.0, 1.0, 0.1], [-0.9, -1.0, 0.0], [1.0, -1.1, 0.05]]
MASS = {"name": "m", "mass": 1.0, "base_points": CORNERS, "tension_min": 0.2, "tension_max": 20.0}
SPHERE = {"kind": "sphere", "centre": [0.6, -0.05, 1.0], "radius": 0.2}
CASES = {
    "six cables": Case("laval-mssm", 1.4, 0.6, {"tension_min": 0.1, "tension_max": 10.0}),
    "eight cables": Case("cogiro", 1.5, 2.0, {}, instants=4),
    "eight cables without one": Case("cogiro", 1.5, 2.0, {}, (0,), instants=4),
    "pairs": Case("launch-robot", -0.6, 0.1, {"tension_min": 0.2, "tension_max": 10.0}, share=0.5),
    "obstacle": Case(MASS, 1.2, 0.7, {"obstacle": [SPHERE]}),
    "obstacle without a cable": Case(MASS, 1.2, 0.7, {"obstacle": [SPHERE]}, (1,)),
}


def plan_of(case, seed):
    """A feasible plan of a spline through random poses, ever slower, and its first orientation."""
    rng, count, turns = np.random.default_rng(seed), 3, case.is_platform and case.robot != "launch-robot"
    for attempt in range(32):
        if attempt % 8 == 0:
            places = rng.uniform(-0.5, 0.5, (count, 3)) * case.size * (1.0, 1.0, 0.4) + [0.0, 0.0, case.height]
            quaternions = Rotation.from_rotvec(0.15 * turns * rng.normal(size=(count, 3))).as_quat(scalar_first=True)
            times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 0.8, count - 1))])
        if turns:  # orientations of a plan would count from another one than that of the file
            limits = {"limits": case.keys}
            plan = cspr_jax.check(case.robot, times, places, quaternions, interpolation="quintic", **limits).plan
        else:
            pose = [{"position": p, "time": t} for p, t in zip(places.tolist(), times.tolist(), strict=True)]
            spec = {"schema": 1, "family": "spline", "interpolation": "quintic", "robot": case.robot, "pose": pose}
            plan = cspr_jax.plan(spec | case.keys)
        if plan.feasible:
            return plan, quaternions[0]
        times = 1.2 * times
    raise AssertionError(f"no plan is feasible: {plan.causes}")


def oracle_robot(case):
    """The robot of a case as in its file, without its broken cables, and the limits of its tensions."""
    spec = tomllib.loads((CATALOGUE / f"{case.robot}.toml").read_text()) if case.is_platform else dict(case.robot)
    spec |= {key: value for key, value in case.keys.items() if key.startswith("tension")}
    left = [i for i in range(len(spec["base_points"])) if i not in case.broken]
    for name in ("base_points", "platform_points"):
        spec[name] = np.array(spec[name], float)[left] if name in spec else None
    usual = {"z_axis": "down", "gravity": 9.81, "pulley_radius": None, "centre_of_mass": np.zeros(3)}
    usual |= {"pattern": "3R3T" if case.is_platform else "3T"}
    return usual | spec, [np.full(len(left), float(spec[name])) for name in ("tension_min", "tension_max")]


def states_of(motion, taus):
    """States of a motion in the oracle's form."""
    with double_precision():
        state = states_at(motion, taus)
    still = np.zeros_like(np.asarray(state.position))
    turns = np.tile(np.eye(3), (len(taus), 1, 1)) if state.rotation is None else np.asarray(state.rotation)
    moving = [np.asarray(part) for part in state[:3]]
    spins = [
        still if part is None else np.asarray(part) for part in (state.angular_velocity, state.angular_acceleration)
    ]
    return State(*moving, turns, *spins)


def state_of_plan(plan, time):
    starts = np.concatenate([[0.0], np.cumsum(plan.answers.duration)])
    i = min(int(np.searchsorted(starts, time, side="right")) - 1, len(plan.motions) - 1)
    return states_of(plan.motions[i], np.array([(time - starts[i]) / plan.answers.duration[i]]))


def check_stop(case, plan, quaternion, stop):
    """All that a stop promises; the smallest distance of the tensions from their limits, N."""
    states, duration = states_of(stop.motion, np.linspace(0.0, 1.0, SAMPLES)), float(stop.motion.duration())
    start, rests = state_of_plan(plan, stop.time), stop.kind == "rest"
    robot, bounds = oracle_robot(case)
    names = ["position", "velocity", "omega", "acceleration", "alpha"][: 3 if case.broken or rests else 5]
    for name in names:
        mine, theirs = getattr(states, name)[0], getattr(start, name)[0]
        np.testing.assert_allclose(mine, theirs, atol=SAME * 10.0 ** names.index(name), err_msg=f"{stop.kind} {name}")
    # Orientations of the file's platform: that of the first pose turns with the plan, then with the stop.
    first = Rotation.from_quat(quaternion, scalar_first=True)
    planned = Rotation.from_matrix(start.rotation[0] @ states_of(plan.motions[0], np.zeros(1)).rotation[0].T) * first
    turns = Rotation.from_matrix(states.rotation @ states.rotation[0].T) * planned
    if case.is_platform and stop.quaternion is not None:
        # Orientations of rows and of stops count from the same one.
        end, row = (
            Rotation.from_quat(q, scalar_first=True) for q in (stop.quaternion, plan.rows(rate=1.0)["quaternion"][0])
        )
        assert (end * (turns[-1] * first.inv() * row).inv()).magnitude() < 1e-8
    # Velocities and accelerations are the derivatives of the poses.
    if not rests:
        step = duration / (SAMPLES - 1)
        pairs = list(itertools.pairwise((states.position, states.velocity, states.acceleration)))
        pairs += [(states.omega, states.alpha)]
        for lower, upper in pairs:
            middle = (lower[2:] - lower[:-2]) / (2.0 * step)
            np.testing.assert_allclose(middle, upper[1:-1], atol=0.02 * max(1.0, np.abs(upper).max()))
        spin = (turns[2:] * turns[:-2].inv()).as_rotvec() / (2.0 * step)
        np.testing.assert_allclose(spin, states.omega[1:-1], atol=0.01 * max(1.0, np.abs(states.omega).max()))
    for name, close in (("velocity", 1e-6), ("omega", 1e-6), ("acceleration", 1e-5), ("alpha", 1e-4)):
        np.testing.assert_allclose(getattr(states, name)[-1], 0.0, atol=close)
    np.testing.assert_allclose(states.position[-1], stop.position, atol=1e-9)
    of_file = dataclasses.replace(states, rotation=turns.as_matrix())
    cables = any_motion.cables(robot, of_file)
    margin = any_motion.Centring(*bounds).largest(*any_motion.balance(robot, of_file, cables)).min()
    weight = robot["mass"] * robot["gravity"]
    assert margin > -TOUCHED * weight and margin > case.share * stop.margin - 1e-6 * weight
    for obstacle in case.keys.get("obstacle", ()):
        assert _gap(cables, np.array(obstacle["centre"])) > obstacle["radius"] - SAME
    return margin


def _gap(cables, point):
    """Smallest distance of a point from the cables, m."""
    along = cables.attachments - cables.leaving
    fraction = np.sum((point - cables.leaving) * along, axis=2) / np.sum(along**2, axis=2)
    nearest = cables.leaving + np.clip(fraction, 0.0, 1.0)[..., None] * along
    return np.linalg.norm(nearest - point, axis=2).min()


def check_stops(name, seed, instants):
    """Check the stops of a plan; their kinds, and the smallest margin."""
    case = CASES[name]
    plan, quaternion = plan_of(case, seed)
    times = np.sort(np.random.default_rng(seed).uniform(0.0, float(plan.answers.duration.sum()), instants))
    found = cspr_jax.stops(plan, times=times, without=list(case.broken) or None)
    margins = [check_stop(case, plan, quaternion, stop) for stop in found.stops if stop.is_found]
    kinds = [stop.kind or "none" for stop in found.stops]
    return {kind: kinds.count(kind) for kind in sorted(set(kinds))}, margins


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["obstacle"])
def test_stops_keep_what_they_promise(name):
    kinds, margins = check_stops(name, 0, 3)
    assert len(margins) == 3, kinds


@pytest.mark.soak
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_stops_of_random_plans(name, seed, capsys):
    kinds, margins = check_stops(name, seed, CASES[name].instants)
    with capsys.disabled():
        print(f"\n{name} {seed}: {kinds}, smallest margin {min(margins, default=np.nan):.3g} N")
    assert margins
