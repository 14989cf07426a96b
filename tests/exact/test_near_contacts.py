"""Verdicts on bodies that almost touch, or just do, against exact distances: cables, and cylinders beside cables."""

import itertools
from fractions import Fraction

import flint
import numpy as np
import pytest
from oracles import exact_motions as oracle

import cspr_jax
from exact import cases

SHARES = (1e-6, -1e-6, 1e-9, -1e-9, 1e-12, -1e-12, 1e-15, -1e-15)
SPOOLS = [[1.0, 0.0, 0.0], [-0.5, 0.75, 0.0], [-0.5, -0.75, 0.0]]


def squared_distance(p, p_end, q, q_end):
    """Square of the distance of two segments, exactly."""
    a, b, r = oracle.minus(p_end, p), oracle.minus(q_end, q), oracle.minus(q, p)
    aa, bb, ab = oracle.dot(a, a), oracle.dot(b, b), oracle.dot(a, b)
    ar, br, determinant = oracle.dot(a, r), oracle.dot(b, r), aa * bb - ab * ab
    if determinant:
        s, t = (bb * ar - ab * br) / determinant, (ab * ar - aa * br) / determinant
        if 0 <= s <= 1 and 0 <= t <= 1:
            gap = oracle.plus(r, oracle.times(t, b), oracle.times(-s, a))
            return oracle.dot(gap, gap)
    ends = [(p, q, b), (p_end, q, b), (q, p, a), (q_end, p, a)]
    return min(_from_segment(*each) for each in ends)


def _from_segment(point, start, ray):
    along = oracle.dot(oracle.minus(point, start), ray) / oracle.dot(ray, ray)
    gap = oracle.minus(point, oracle.plus(start, oracle.times(min(max(along, 0), 1), ray)))
    return oracle.dot(gap, gap)


def smallest_distance(pieces, pairs, count=24):
    """Square of the smallest distance of any pair of segments along a motion, whose ends are functions of the state."""

    def function(piece, segments):
        return lambda u: -squared_distance(*segments(oracle.piece_state(piece, u)))

    functions, pieces = zip(*((function(p, s), p) for p, s in itertools.product(pieces, pairs)), strict=True)
    return -oracle.largest_value(functions, [p.width for p in pieces], count, oracle.BRACKET)[2]


def wrong_verdicts(checked, square, flag):
    """What is wrong with verdicts on sums of radii near the square of a distance."""
    distance = float(flint.arb(square).sqrt())
    nearest = [np.nextafter(distance, 0.0), distance, np.nextafter(distance, 1.0)]
    for reach in [*(distance * (1.0 + share) for share in SHARES), *map(float, nearest)]:
        expected = "feasible" if Fraction(reach) ** 2 < Fraction(int(square.p), int(square.q)) else flag
        verdict = checked(reach)
        if verdict != expected:
            yield {"reach": reach, "distance": distance, "verdict": verdict, "expected": expected}


def faults_of_cables(seed):
    """Wrong verdicts on diameters of the cables of a platform near the smallest distance of any two."""
    case, robot, pieces = next(cases.feasible_cases(cases.platform_case, 1000 * seed))

    def segments(i, j):
        def ends(state):
            points = [oracle.plus(state.position, oracle.applied(state.rotation, robot.platform[k])) for k in (i, j)]
            return robot.base[i], points[0], robot.base[j], points[1]

        return ends

    pairs = [segments(i, j) for i, j in itertools.combinations(range(case.n_cables), 2)]
    square = smallest_distance(pieces, pairs, 12)

    def verdict(diameter):
        return cases.Case(cspr_jax.with_cables(case.robot, cable_diameter=diameter), case.samples).checked().verdict

    return list(wrong_verdicts(verdict, square, "cable_cable"))


def faults_of_cylinders(seed):
    """Wrong verdicts on radii of a cylinder beside the cables of a point mass."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform([-0.2, -0.2, 1.0], [0.2, 0.2, 1.5], (5, 3))
    poses = [{"position": x.tolist(), "time": 1.2 * k} for k, x in enumerate(positions)]
    axis = rng.uniform([0.5, -0.4, 0.4], [0.8, -0.2, 1.2]), rng.uniform([0.5, 0.2, 0.4], [0.8, 0.4, 1.2])
    robot = {"name": "three", "base_points": SPOOLS, "mass": 1.0}

    def planned(radius):
        obstacle = {"kind": "cylinder", "start": axis[0].tolist(), "end": axis[1].tolist(), "radius": radius}
        keys = {"schema": 1, "family": "spline", "robot": robot, "obstacle": [obstacle], "interpolation": "quintic"}
        return cspr_jax.plan(keys | {"pose": poses})

    plan = planned(1e-3)
    assert plan.feasible
    exact = oracle.robot_of(plan.problem.robot)
    pieces = [piece for leg in plan.legs for motion in leg.motions for piece in oracle.pieces_of(motion)]
    rod = [oracle.rationals(x) for x in axis]
    pairs = [lambda state, k=k: (exact.base[k], state.position, *rod) for k in range(3)]
    square = smallest_distance(pieces, pairs)

    def verdict(radius):
        words = {segment["verdict"] for segment in planned(radius).to_dict()["segments"]} - {"feasible"}
        return "+".join(sorted(words)) or "feasible"

    return list(wrong_verdicts(verdict, square, "obstacle"))


def test_distances_of_segments():
    """Against a fine grid of points of both."""
    rng, grid = np.random.default_rng(0), np.linspace(0.0, 1.0, 201)
    for _ in range(20):
        ends = rng.normal(size=(4, 3))
        exact = float(squared_distance(*map(oracle.rationals, ends))) ** 0.5
        first, second = (a + grid[:, None] * (b - a) for a, b in (ends[:2], ends[2:]))
        nearest = np.linalg.norm(first[:, None] - second[None], axis=2).min()
        assert exact <= nearest + 1e-12 and nearest < exact + 0.05


@pytest.mark.thorough
def test_cables_of_a_platform():
    assert faults_of_cables(1) == []


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(2, 8))
def test_cables_of_many_platforms(seed):
    assert faults_of_cables(seed) == []


@pytest.mark.thorough
def test_cylinders_beside_cables():
    assert faults_of_cylinders(0) == []


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1, 13))
def test_many_cylinders_beside_cables(seed):
    assert faults_of_cylinders(seed) == []
