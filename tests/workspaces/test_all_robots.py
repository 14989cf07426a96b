"""Workspaces of all robots within an uncertainty, beside robots that are drawn from it, or sought in it."""

import dataclasses
import itertools

import numpy as np
import pytest
from oracles import clearance as oracle_clearance
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation
from support import cable_robots
from support.workspaces import made

from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.contacts.clearance import scene
from cspr_jax.robots.model.limits import Limits, Uncertainty
from cspr_jax.robots.model.shapes import Sphere
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.workspaces.all_robots import AllRobots, mass_searches
from cspr_jax.workspaces.cells.speeds import cable_speeds
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.requirements import required_wrenches, requirement
from cspr_jax.workspaces.search import WorkspaceSearch
from cspr_jax.workspaces.static_cells import RestCells
from cspr_jax.workspaces.static_poses import RestPoses

THICK = 0.02  # m, of cables
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


class Uncertain:
    """A drawn robot in one orientation with its uncertainty; z up, positions of the mass centre."""

    def __init__(self, drawn, turn, condition, uncertainty, acceleration=None, longest=None, speeds=None, ball=None):
        self.drawn, self.turn, self.condition, self.acceleration = drawn, turn, condition, acceleration or 0.0
        self.spools, self.centre = float(uncertainty.spool_positions), float(uncertainty.mass_centre)
        self.masses = drawn.mass / uncertainty.mass_factor, drawn.mass * uncertainty.mass_factor
        self.longest, self.speeds, self.ball = longest, speeds, ball
        own, self.frame = centred(made(drawn))
        self.own, self.quaternion = own, np.array([1.0, 0.0, 0.0, 0.0])
        if drawn.pattern not in cable_robots.POINT_MASSES:
            given = Rotation.from_matrix(turn).as_quat(scalar_first=True)
            self.quaternion = self.frame.rotated_quaternions(given[None])[0]
        tensions = Limits(tension_min=drawn.low, tension_max=drawn.high)

        def ask(robot):
            is_feasible = condition == "wrench-feasible"
            loads = required_wrenches(robot, self.frame, acceleration=acceleration) if is_feasible else None
            return requirement(robot, condition, tensions, loads)

        with double_precision():
            searches, single = {}, {}
            if condition is not None:
                of_masses = mass_searches(own, uncertainty, ask, has_weight=True, acceleration=self.acceleration)
                searches, single = {condition: of_masses}, {condition: WorkspaceSearch(own, ask(own))}
            cables = None if speeds is None else cable_speeds(own, speeds[2], speed=speeds[0], angular_speed=speeds[1])
            bounds = Limits(cable_length_max=None if longest is None else np.full(drawn.cables, longest))
            around = None
            if ball is not None:
                obstacle = Sphere(np.asarray(self.frame.inward(ball[0])), ball[1])
                around = scene(own, diameter=np.full(drawn.cables, THICK), obstacles=(obstacle,))
            poses = RestPoses(own, single, around, bounds, cables, of_mass_centre=True)
            self.poses = poses
            self.cells = RestCells(poses, self.quaternion, AllRobots(self.spools, searches))

    def inner(self, places):
        return mass_centres(self.own, np.asarray(self.frame.inward(places)), self.quaternion[None])

    def verdicts(self, places):
        turns = np.tile(self.quaternion, (len(places), 1))
        with double_precision():
            nominal = self.poses(self.inner(places), turns)["verdict"]
            return nominal, self.cells.verdicts(self.inner(places), nominal)

    def sides(self, places, half, depth):
        return self.cells(self.inner(places), half, depth=depth)[0]

    def slack(self, place, moved):
        """Least slack, over its scale, of the robot whose spools, mass centre, mass and load are `moved`."""
        spools, centre, mass, pull = moved
        drawn, base = self.drawn, self.drawn.base + spools
        matrix = oracle.wrench_matrix(base, drawn.platform, place, self.turn, drawn.pattern)
        rays = base - place - drawn.platform @ self.turn.T
        slacks = []
        if self.longest is not None:
            slacks.append(self.longest - np.linalg.norm(rays, axis=1).max())
        if self.ball is not None:
            ends, (i, j) = base - rays, np.triu_indices(drawn.cables, 1)
            slacks.append(oracle_clearance.segments(ends[i], rays[i], ends[j], rays[j]).min() - THICK)
            gaps = oracle_clearance.point_to_segment(np.tile(self.ball[0], (drawn.cables, 1)), ends, rays)
            slacks.append(min(gaps) - self.ball[1] - 0.5 * THICK)
        if self.speeds is not None:
            speed, angular_speed, most = self.speeds
            along, about = (np.linalg.norm(part, axis=0) for part in np.split(matrix, [len(matrix) - 3]))
            slacks.append(most - (speed * along + angular_speed * about).max())
        if self.condition == "wrench-closure":
            slacks.append(oracle.facet_normals(matrix)[1].max(1).min())  # each has entries of both signs
        elif self.condition is not None:
            kept = oracle.rows(drawn.pattern, drawn.platform, self.turn)
            arm = self.turn @ np.asarray(drawn.arm) * (drawn.pattern == "3R") + centre
            load = oracle.weight(kept, mass, arm, np.array([0.0, 0.0, -cable_robots.GRAVITY]) - pull)
            low, high = (0.0, np.inf) if self.condition == "static" else (drawn.low, drawn.high)
            slacks.append(oracle.margin_by_facets(matrix, load, low, high) / (drawn.mass * cable_robots.GRAVITY))
        return min(slacks)

    def moves(self, directions, mass, size=1.0):
        """Displacements of the spools, of the mass centre and of the acceleration, in directions (n_cables + 2, 3)."""
        drawn = self.drawn
        kept = {"2T": [1], "1T": [0, 1], "1R2T": [1]}.get(drawn.pattern, [])
        directions = np.array(directions)
        directions[:, kept] = 0.0
        long = np.linalg.norm(directions, axis=1, keepdims=True)
        directions = size * directions / np.where(long > 0.0, long, 1.0)
        return self.spools * directions[:-2], self.centre * directions[-2], mass, self.acceleration * directions[-1]

    def drawn_moves(self, rng):
        count = self.drawn.cables + 2
        mass = self.masses[rng.integers(2)] if rng.random() < 0.7 else rng.uniform(*self.masses)
        return self.moves(rng.normal(size=(count, 3)), mass, 1.0 if rng.random() < 0.7 else rng.uniform(0.0, 1.0))

    def worst(self, place, rng, rounds=3):
        """Least slack that a descent along differences finds, from the robot as it is and from a drawn one."""
        count, least = self.drawn.cables + 2, np.inf
        for mass, start in itertools.product(self.masses, (0.0, 1.0)):
            directions = start * rng.normal(size=(count, 3))
            for _ in range(rounds):
                moved = self.moves(directions, mass)
                middle, slopes = self.slack(place, moved), np.zeros((count, 3))
                least = min(least, middle)
                if least < 0.0:
                    return least
                for i, k in np.ndindex(count, 3):
                    parts = [np.array(part) for part in (moved[0], moved[1], moved[3])]
                    if i < count - 2:
                        parts[0][i, k] += 1e-6
                    else:
                        parts[i - count + 3][k] += 1e-6
                    slopes[i, k] = self.slack(place, (parts[0], parts[1], mass, parts[2])) - middle
                directions = -np.nan_to_num(slopes, posinf=0.0, neginf=0.0)
        if np.isfinite(least):
            return least
        # No slope leads away from robots whose cables pull against each other as hard as one likes.
        return min(self.slack(place, self.drawn_moves(rng)) for _ in range(200))


def check(asked, rng, count, *, largest=0.15, robots=6, samples=2, depth=1):
    """Cells and points beside robots: how many cells are proved inside, and outside; open points of those inside."""
    drawn = asked.drawn
    beyond = 0.6 if drawn.pattern in ("2R3T", "3R3T") else 2.0  # the workspace
    places = np.array([drawn.middle + beyond * (drawn.pose(rng)[0] - drawn.middle) for _ in range(count)])
    half = largest * rng.uniform(0.0, 1.0, (count, 3)) * (rng.random((count, 3)) < 0.8)
    half[:, drawn.space == 0.0] = 0.0
    sides = asked.sides(places, half, depth)
    nominal, verdict = asked.verdicts(places)
    assert (verdict[nominal != 0] == nominal[nominal != 0]).all()
    assert (verdict[sides == 1] == 0).all() and (verdict[sides == 2] != 0).all()
    for i in np.flatnonzero((sides > 0) | (verdict == 0) | (verdict == Verdict.UNCERTAINTY)):
        steps = CORNERS[rng.permutation(8)[:samples]] if sides[i] else np.zeros((1, 3))
        for step in steps:
            place = places[i] + step * half[i]
            if sides[i] == 1 or (not sides[i] and verdict[i] == 0):
                moves = [asked.drawn_moves(rng) for _ in range(robots)]
                assert min(asked.slack(place, moved) for moved in moves) > -1e-9, (drawn.name, i)
                assert asked.worst(place, rng, rounds=2) > -1e-9, (drawn.name, i)
            else:
                assert asked.worst(place, rng) < 1e-6, (drawn.name, i)
    is_inside = nominal == 0
    counts = (sides == 1).sum(), (sides == 2).sum(), is_inside.sum()
    return *counts, (is_inside & (verdict == Verdict.UNDECIDED)).sum(), (verdict == Verdict.UNCERTAINTY).sum()


def draw(rng, pattern, n, condition, uncertainty, **more):
    suspended = condition != "wrench-closure" and pattern != "1T"
    drawn = cable_robots.any_robot(rng, pattern, n, suspended=suspended, bounds="mixed")
    return Uncertain(drawn, drawn.pose(rng)[1], condition, uncertainty, **more)


FEW, MANY = Uncertainty(0.02, 0.0, 1.1), Uncertainty(0.02, 0.01, 1.1)
CENTRE = Uncertainty(0.0, 0.03, 1.2)
CASES = [
    ("2T", 3, "static", FEW, None),
    ("1R2T", 4, "wrench-feasible", MANY, 0.5),
    ("3T", 4, "wrench-feasible", FEW, 0.5),
    ("3T", 5, "wrench-closure", FEW, None),
    ("1R2T", 4, "wrench-closure", MANY, None),
    ("3R", 4, "wrench-feasible", MANY, None),
    ("2R3T", 6, "wrench-feasible", MANY, None),
    ("3R3T", 6, "static", MANY, None),
    ("3R3T", 7, "wrench-feasible", CENTRE, None),
    ("3R3T", 8, "wrench-feasible", MANY, None),
]
FEW_CASES = [CASES[k] for k in (0, 1, 5)]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("pattern", "n", "condition", "uncertainty", "acceleration"),
    [case if case in FEW_CASES else pytest.param(*case, marks=pytest.mark.soak) for case in CASES],
)
def test_no_robot_is_on_the_other_side(pattern, n, condition, uncertainty, acceleration):
    rng = np.random.default_rng(n)
    acceleration = None if pattern == "3R" else acceleration
    counts = np.zeros(5, int)
    for _ in range(2):
        counts += check(draw(rng, pattern, n, condition, uncertainty, acceleration=acceleration), rng, 12)
    print(pattern, n, condition, *counts)
    assert counts[3] <= 0.5 * counts[2] + 1


def test_the_lightest_and_the_heaviest_robot_decide():
    """Tensions of three cables are proportional to the mass: all robots are inside exactly where these two are."""
    rng, counts = np.random.default_rng(3), np.zeros(2, int)
    for _ in range(4):
        uncertain = draw(rng, "3T", 3, "wrench-feasible", Uncertainty(0.0, 0.0, 2.0))
        drawn = uncertain.drawn
        places = np.array([drawn.pose(rng)[0] for _ in range(60)])
        nominal, verdict = uncertain.verdicts(places)
        ends = [uncertain.moves(np.zeros((5, 3)), mass) for mass in uncertain.masses]
        slack = np.array([min(uncertain.slack(place, end) for end in ends) for place in places])
        expected = np.where(nominal != 0, nominal, np.where(slack > 0.0, 0, Verdict.UNCERTAINTY))
        assert (verdict == expected)[np.abs(slack) > 1e-6].all()
        counts += [(verdict == 0).sum(), (verdict == Verdict.UNCERTAINTY).sum()]
    assert (counts > 10).all(), counts


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["lengths", "speeds", pytest.param("clearances", marks=pytest.mark.soak)])
def test_limits_and_clearances_hold_for_all_robots(kind):
    """Lengths, speeds and clearances alone leave cells open: a platform that closes on eight cables."""
    rng, counts = np.random.default_rng(len(kind)), np.zeros(5, int)
    for _ in range(2):
        drawn = cable_robots.any_robot(rng, "3R3T", 8, suspended=False)
        drawn = dataclasses.replace(drawn, platform=0.15 * drawn.base)  # whose cables lead outward
        place, turn = drawn.pose(rng)
        ends = place + drawn.platform @ turn.T
        longest, at = np.linalg.norm(drawn.base - ends, axis=1).max(), 0.5 * (drawn.base[0] + ends[0])
        more = {
            "lengths": {"longest": 0.97 * longest},
            "speeds": {"speeds": (1.0, 2.0, 1.3)},
            "clearances": {"ball": (at, 0.4)},
        }[kind]
        counts += check(Uncertain(drawn, turn, None, FEW, **more), rng, 12 if kind == "clearances" else 30, largest=0.1)
    print(kind, *counts)
    assert counts[0] > 0 and counts[1] + counts[4] > 0 and counts[3] <= 0.5 * counts[2] + 1


@pytest.mark.soak
@pytest.mark.parametrize(("pattern", "n", "condition", "uncertainty", "acceleration"), CASES)
def test_no_robot_of_many_is_on_the_other_side(pattern, n, condition, uncertainty, acceleration):
    rng = np.random.default_rng(100 + n)
    acceleration = None if pattern == "3R" else acceleration
    for _ in range(20):
        asked = draw(rng, pattern, n, condition, uncertainty, acceleration=acceleration)
        check(asked, rng, 40, robots=20, samples=3, depth=2)
