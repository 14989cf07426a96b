"""Verdicts on limits extremely near an extreme of motions of all families, against their formulas."""

import dataclasses
import itertools
import time

import numpy as np
import pytest
from oracles import exact_motions as oracle

import cspr_jax
from exact import cases

SHARES = (1e-6, -1e-6, 1e-9, -1e-9, 1e-12, -1e-12, 1e-14, -1e-14)
FEW = (1e-9, -1e-9, 1e-14, -1e-14)
QUANTITIES = [quantity for quantity in oracle.LIMIT_OF if quantity != "depth"]
LOOSE = {name: limit for name, limit in cases.LOOSE.items() if name != "tension_min"} | {"tension_min": 1e-9}


@dataclasses.dataclass(frozen=True)
class PlanCase:
    """A plan of one segment whose motion no limit changes."""

    keys: dict

    def planned(self, **limits):
        """The plan with some limits, all others loose."""
        begin = time.perf_counter()
        plan = cspr_jax.plan(self.keys | {"limits": LOOSE | limits})
        cases.SECONDS.append(time.perf_counter() - begin)
        return plan

    def verdict(self, **limits) -> str:
        """Verdict, of a plan with a given number of arcs without the word that no number of arcs will do."""
        word = self.planned(**limits).to_dict()["segments"][-1]["verdict"]
        return word.removeprefix("no_arcs+").removesuffix("+no_arcs")

    def form(self):
        """Robot and formulas of the last segment; None if the plan is not feasible."""
        plan = self.planned()
        if not plan.feasible:
            return None
        return oracle.robot_of(plan.problem.robot), oracle.formulas_of(plan.legs[-1].motions[-1])


@dataclasses.dataclass(frozen=True)
class MotionCase:
    """A motion object of the package, and its robot."""

    robot: object
    motion: object

    def checked(self, **limits):
        """A check with some limits, all others loose."""
        begin = time.perf_counter()
        check = cspr_jax.check(self.robot, self.motion, limits=LOOSE | limits)
        cases.SECONDS.append(time.perf_counter() - begin)
        return check

    def verdict(self, **limits) -> str:
        """Verdict."""
        return self.checked(**limits).verdict

    def form(self):
        """Robot and formulas; None if the motion is not feasible."""
        check = self.checked()
        if not check.feasible:
            return None
        (motion,) = check.plan.legs[0].motions
        if hasattr(motion, "knots"):
            return oracle.robot_of(check.plan.problem.robot), oracle.pieces_of(motion)
        return oracle.robot_of(check.plan.problem.robot), oracle.formulas_of(motion)


def robot_keys(rng) -> dict:
    """A robot file of three cables, as a plan may hold it."""
    base = 0.3 * cases.ring(rng, 3)
    base -= base.mean(0)
    return {"name": "three", "base_points": base.tolist(), "mass": float(rng.uniform(0.1, 2.0))}


def near(rng, *position: float) -> list[float]:
    """A position near another."""
    return (np.array(position) + rng.uniform(-0.04, 0.04, 3)).tolist()


def hypocycloid(rng):
    poses = [{"position": near(rng, 0.2, 0.1, 1.4)}, {"position": near(rng, -0.1, 0.2, 1.5)}]
    poses[1]["arcs"] = int(rng.integers(4, 8))
    return PlanCase({"schema": 1, "family": "hypocycloid-standard", "robot": robot_keys(rng), "z0": 1.4, "pose": poses})


def transition(rng):
    poses = [{"rest": True}, {"position": near(rng, 0.3, 0.2, 1.5), "arcs": 6}]
    if rng.random() < 0.5:
        poses = [{"position": poses[1]["position"]}, {"rest": True, "arcs": 6}]
    return PlanCase({"schema": 1, "family": "transition", "robot": robot_keys(rng), "z0": 1.4, "pose": poses})


def ellipse_keys(rng, centre, size) -> dict:
    """An ellipse on which no speed is constant."""
    axes = size * (np.eye(3)[:2] * [[1.0], [0.6]] + rng.uniform(-0.2, 0.2, (2, 3)))
    return {"centre": centre, "half_axes": axes.tolist(), "frequency": rng.uniform(2.2, 2.8)}


def turns(rng):
    ellipse = ellipse_keys(rng, near(rng, 0.0, 0.0, 1.4), 0.15)
    keys = {"ellipse": ellipse, "turns": float(rng.uniform(0.3, 1.5)), "pose": [{}, {}]}
    return PlanCase({"schema": 1, "family": "ellipse", "robot": robot_keys(rng)} | keys)


def transfer(rng):
    centre = near(rng, 0.0, 0.0, 1.4)
    ellipse = ellipse_keys(rng, centre, 0.08)
    poses = [{"rest": True, "position": centre}, {"ellipse": ellipse, "turns": 1.0, "arcs": 6}]
    return PlanCase({"schema": 1, "family": "ellipse", "robot": robot_keys(rng), "pose": poses})


def bezier(rng):
    poses = [{"position": near(rng, 0.0, 0.0, 1.4)}, {"position": near(rng, 0.05, 0.0, 1.5)}]
    poses[1]["duration"] = float(rng.uniform(2.0, 4.0))
    return PlanCase({"schema": 1, "family": "bezier", "robot": robot_keys(rng), "pose": poses})


def _robot(rng):
    keys = robot_keys(rng)
    return cspr_jax.point_mass(keys["base_points"], mass=keys["mass"])


def line(rng):
    robot, law = _robot(rng), str(rng.choice(["s-curve", "quintic", "cubic"]))
    ends = near(rng, 0.0, 0.0, 1.3), near(rng, 0.05, 0.0, 1.4)
    return MotionCase(robot, cspr_jax.straight_line(robot, *ends, duration=rng.uniform(1.0, 2.0), law=law))


TURNED = {"poses": (1, 1), "translation": (0, 0), "rotation": (0, 1), "from rest": (0, 1), "to rest": (1, 0)}


def platform_robot_keys(rng):
    """A robot of six cables, of the catalogue or made up, as a plan may hold it."""
    if rng.random() < 0.5:
        return "laval-mssm"
    robot = cases.hexapod(rng)
    base = np.asarray(robot.base_points)
    arrays = {"base_points": base - base.mean(0), "platform_points": robot.platform_points, "inertia": robot.inertia}
    return {name: np.asarray(array).tolist() for name, array in arrays.items()} | {"name": "six", "mass": robot.mass}


def platform_pose(rng, is_turned) -> dict:
    """A pose beside P0, turned or in the reference orientation."""
    turns = is_turned * rng.uniform([-3.0, 0.05, -0.4], [3.0, 0.4, 0.4])
    return {
        "position": (np.array([0.0, 0.0, 1.4]) + rng.uniform(-0.4, 0.4, 3)).tolist(),
        "tilt_torsion": turns.tolist(),
    }


def platform_swing(rng, kind=None):
    """Its number of arcs and angular accelerations at both ends are those that a plan within loose limits finds."""
    kind = kind or str(rng.choice(list(TURNED)))
    poses = [platform_pose(rng, is_turned) for is_turned in TURNED[kind]]
    if kind == "rotation":  # about P0 itself
        poses[0]["position"] = poses[1]["position"] = [0.0, 0.0, 1.4]
    elif "rest" in kind:
        poses[TURNED[kind].index(0)] = {"rest": True}
    amplitude = ["quintic", {"name": "effective-c3", "epsilon": 0.1}][rng.integers(2)]
    keys = {"schema": 1, "family": "hypocycloid", "robot": platform_robot_keys(rng), "z0": 1.4}
    keys |= {"amplitude": amplitude, "max_arcs": 8}
    segment = PlanCase(keys | {"pose": poses}).planned().to_dict()["segments"][-1]
    for pose, beta_hat in zip(poses, segment["beta_hat"], strict=True):
        pose |= {} if "rest" in pose else {"beta_hat": beta_hat}
    return PlanCase(keys | {"pose": [poses[0], poses[1] | {"arcs": segment["tried_arcs"]}]})


def free(rng):
    """The fastest motion between two positions, or from or to rest, that a search finds within limits."""
    robot = robot_keys(rng)
    poses = [{"position": near(rng, 0.1, 0.1, 1.3)}, {"position": near(rng, -0.1, 0.0, 1.5)}]
    if rng.random() < 0.5:
        poses[int(rng.integers(2))] = {"rest": True}
    limits = {"tension_max": 2.0 * 9.81 * robot["mass"], "cable_speed_max": 2.0}
    plan = cspr_jax.plan({"schema": 1, "family": "free", "robot": robot, "z0": 1.4, "pose": poses, "limits": limits})
    return MotionCase(cspr_jax.point_mass(robot["base_points"], mass=robot["mass"]), plan.legs[0].motions[0])


def path(rng):
    keys = robot_keys(rng)
    poses = [{"position": near(rng, 0.0, 0.0, 1.3)}, {"position": near(rng, 0.05, 0.0, 1.4)}]
    limits = {"acceleration_max": 1.0, "speed_max": 1.0}
    plan = cspr_jax.plan({"schema": 1, "family": "path", "robot": keys, "pose": poses, "limits": limits})
    return MotionCase(cspr_jax.point_mass(keys["base_points"], mass=keys["mass"]), plan.legs[0].motions[0])


POINT_MASSES = {f.__name__: f for f in (hypocycloid, transition, turns, transfer, bezier, line, path, free)}
FAMILIES = POINT_MASSES | {"platform_swing": platform_swing}


def feasible_cases(make, first: int):
    """Feasible cases of a family and their exact forms."""
    for seed in itertools.count(first):
        case = make(np.random.default_rng(seed))
        form = case.form()
        if form is not None:
            yield seed, case, form


def extreme_of(form, quantity, cable):
    """Extreme of a spline, or of formulas."""
    robot, pieces = form
    if not isinstance(pieces[0], oracle.Piece):
        return oracle.formula_extreme(robot, pieces, quantity, cable, 200 if robot.platform is None else 100)
    find = oracle.polynomial_extreme if robot.platform is None else oracle.rational_extreme
    return find(robot, pieces, quantity, cable)


def faults(make, first: int, count: int, shares, quantities=2):
    """Verdicts that are wrong, and the number of all, of some motions of a family."""
    wrong, number = [], 0
    for seed, case, form in itertools.islice(feasible_cases(make, first), count):
        rng = np.random.default_rng(seed)
        for quantity in rng.choice(QUANTITIES, quantities, replace=False):
            n_cables = len(form[0].base)
            quantity, cable = str(quantity), int(rng.integers(n_cables))
            extreme = extreme_of(form, quantity, cable)
            if extreme.value(quantity) < 1e-9:  # of a platform that only turns
                continue
            name = oracle.LIMIT_OF[quantity]
            for limit in oracle.near_limits(extreme.square, quantity, shares)[:-2]:
                given = limit
                if quantity in oracle.OF_EACH_CABLE:
                    given = [LOOSE[name]] * n_cables
                    given[cable] = limit
                verdict = case.verdict(**{name: given})
                kept = oracle.keeps(extreme.square, limit, quantity)
                expected = "feasible" if kept else oracle.FLAG_OF[quantity]
                row = {"seed": seed, "quantity": quantity, "cable": cable, "limit": limit, "expected": expected}
                wrong += [row | {"verdict": verdict}] if verdict != expected else []
                number += 1
    return wrong, number


@pytest.mark.thorough
@pytest.mark.parametrize("make", POINT_MASSES.values(), ids=POINT_MASSES)
def test_families(make):
    assert faults(make, 0, 1, FEW)[0] == []


@pytest.mark.soak
@pytest.mark.parametrize("make", FAMILIES.values(), ids=FAMILIES)
def test_many_motions_of_families(make):
    """Ten motions, two quantities, eight limits: 160 checks of each family; of paths the nearest limits are below.

    Of platforms there are fewer motions, and those that only turn about P0 have quantities that are zero.
    """
    shares, count = SHARES[:6] if make is path else SHARES, 6 if make is platform_swing else 10
    wrong, number = faults(make, 100, count, shares)
    assert wrong == []
    assert number == 2 * count * len(shares) or (make is platform_swing and number >= count * len(shares))


@pytest.mark.soak
@pytest.mark.parametrize("kind", TURNED)
def test_swings_of_each_kind(kind):
    wrong, number = faults(lambda rng: platform_swing(rng, kind), 200, 1, SHARES)
    assert wrong == []
    assert number >= (0 if kind == "rotation" else len(SHARES))


@pytest.mark.soak
def test_limits_nearest_to_extremes_of_paths():
    assert faults(path, 100, 10, SHARES[6:]) == ([], 40)


@pytest.mark.thorough
def test_constant_speed_on_a_circle():
    ellipse = {"centre": [0.0, 0.0, 1.4], "radius": 0.1, "frequency": 2.0}
    keys = {"ellipse": ellipse, "turns": 1.0, "pose": [{}, {}], "schema": 1, "family": "ellipse", "robot": "prototype"}
    case = PlanCase(keys)
    robot, formulas = case.form()
    extreme = oracle.formula_extreme(robot, formulas, "speed")
    for limit in oracle.near_limits(extreme.square, "speed", FEW)[:-2]:
        kept = oracle.keeps(extreme.square, limit, "speed")
        assert case.verdict(speed_max=limit) == ("feasible" if kept else "too_fast")
