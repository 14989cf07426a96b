"""Whole cells of workspaces, beside dense samples and linear programs."""

import itertools

import numpy as np
import pytest
from oracles import workspaces as oracle
from scipy.spatial.transform import Rotation
from support import cable_robots
from support.workspaces import made

import cspr_jax
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.cables import with_cables
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.workspaces.cells.cell_proofs import CellProofs
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.poses.geometry import mass_centres
from cspr_jax.workspaces.required_wrenches import RequiredWrenches
from cspr_jax.workspaces.requirements import CONDITIONS, required_wrenches, requirement
from cspr_jax.workspaces.search import WorkspaceSearch
from cspr_jax.workspaces.static_cells import RestCells
from cspr_jax.workspaces.static_poses import RestPoses

NONE = np.array([1.0, 0.0, 0.0, 0.0])
CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


class WorkspaceCells:
    """Cells of one condition on the cables: which are proved inside, and which outside."""

    def __init__(self, robot, search):
        searches = {search.requirement.condition: search}
        self.poses = RestPoses(robot, searches, None, Limits(), of_mass_centre=True)

    def __call__(self, places, half, quaternion=NONE, *, depth=1):
        half = np.broadcast_to(half, places.shape)
        sides, _ = RestCells(self.poses, quaternion)(places, half, depth=depth)
        return sides == 1, sides == 2


class Asked:
    """A question to a drawn robot in one orientation, and to cells of it."""

    def __init__(self, drawn, turn, condition, wrenches=None):
        self.drawn, self.turn, self.robot = drawn, turn, made(drawn)
        self.own, self.frame = centred(self.robot)
        limits = Limits(tension_min=drawn.low, tension_max=drawn.high)
        self.question = requirement(
            self.own, condition, limits, None if wrenches is None else RequiredWrenches(wrenches)
        )
        self.quaternion = NONE
        if drawn.pattern not in cable_robots.POINT_MASSES:
            given = Rotation.from_matrix(turn).as_quat(scalar_first=True)
            self.quaternion = self.frame.rotated_quaternions(given[None])[0]
        with double_precision():
            self.search = WorkspaceSearch(self.own, self.question)
        self.cells = WorkspaceCells(self.own, self.search)

    def inner(self, places):
        """Of origins, what the search takes."""
        return mass_centres(self.own, np.asarray(self.frame.inward(places)), self.quaternion[None])

    def at(self, inner):
        with double_precision():
            return self.search(inner, np.tile(self.quaternion, (len(inner), 1)))

    @property
    def proofs(self):
        return CellProofs(self.search, self.quaternion)

    def margins(self, inner, half):
        with double_precision():
            return self.proofs.lower_margins(inner, half)


def check(asked, rng, count, *, largest=0.3, samples=8, programs=1, depth=0):
    """Cells beside samples of them: how many are proved, and how many have samples of one verdict."""
    drawn = asked.drawn
    places = np.array([drawn.pose(rng)[0] for _ in range(count)])
    half = largest * rng.uniform(0.0, 1.0, (count, 3)) * (rng.random((count, 3)) < 0.8)
    half[:, drawn.space == 0.0] = 0.0
    inner = asked.inner(places)
    answers = asked.at(inner)
    inside, outside = asked.cells(inner, half, asked.quaternion, depth=depth)
    assert not (inside & outside).any()
    assert (inside <= (answers.verdict == 0)).all() and (outside <= (answers.verdict != 0)).all()
    spots = np.concatenate([np.tile(CORNERS, (count, 1, 1)), rng.uniform(-1.0, 1.0, (count, samples, 3))], axis=1)
    spots = inner[:, None] + spots * half[:, None]
    seen = asked.at(spots.reshape(-1, 3))
    verdict, margin = seen.verdict.reshape(count, -1), seen.margin.reshape(count, -1)
    assert (verdict[inside] == 0).all(), drawn.name
    assert (verdict[outside] != 0).all(), drawn.name
    chosen = np.flatnonzero(answers.verdict == 0)
    if len(chosen) and asked.question.condition != "wrench-closure":
        bound = asked.margins(inner[chosen], half[chosen])
        with np.errstate(invalid="ignore"):
            assert (bound <= margin[chosen].min(1) + 1e-9 * drawn.mass * 10.0).all(), drawn.name
        # Of no size: all but what tensions at the centre give up.
        alone = (
            ~half[chosen].any(1) & np.isfinite(answers.margin[chosen]) & (answers.margin[chosen] > 1e-6 * drawn.mass)
        )
        assert (bound >= 0.97 * answers.margin[chosen])[alone].all(), drawn.name
    for i in rng.permutation(np.flatnonzero(inside | outside))[:programs]:
        place = asked.frame.outward(spots[i, rng.integers(spots.shape[1])][None])[0]
        assert held(asked, place) == inside[i], drawn.name
    whole = (verdict == 0).all(1) & (answers.verdict == 0) | (verdict == Verdict.WRENCH_INFEASIBLE).all(1)
    return (inside | outside).sum(), whole.sum()


def held(asked, place):
    """By linear programs, whether a pose belongs; the mass centre at `place`, z up."""
    drawn = asked.drawn
    matrix = oracle.wrench_matrix(drawn.base, drawn.platform, place, asked.turn, drawn.pattern)
    if asked.question.condition == "wrench-closure":
        return oracle.is_closed(matrix)
    kept = oracle.rows(drawn.pattern, drawn.platform, asked.turn)
    weight = oracle.weight(kept, drawn.mass, asked.turn @ np.asarray(drawn.arm) if drawn.pattern == "3R" else (0, 0, 0))
    low, high = (0.0, np.inf) if asked.question.condition == "static" else (drawn.low, drawn.high)
    return oracle.tension_margin(matrix, weight, low, high) > 0.0


@pytest.mark.quick("2T-3", "3R-4", "3R3T-6")
@pytest.mark.parametrize(("pattern", "n"), [("2T", 3), ("1R2T", 4), ("2R3T", 6), ("3R", 4), ("3R3T", 6)])
def test_cells_and_poses_have_one_wrench_matrix(pattern, n):
    rng = np.random.default_rng(n)
    drawn = cable_robots.any_robot(rng, pattern, n)
    asked = Asked(drawn, drawn.pose(rng)[1], "wrench-closure")
    places = asked.inner(np.array([drawn.pose(rng)[0] for _ in range(5)]))
    with double_precision():
        turns = np.tile(asked.quaternion, (5, 1))
        wanted = np.asarray(geometry.wrench_matrices(asked.own, places, turns)) / asked.search.unit[:, None]
        np.testing.assert_allclose(asked.proofs.matrices(places), wanted, atol=1e-13)


QUICK = [("2T", 3, "static"), ("3T", 4, "wrench-feasible"), ("1R2T", 4, "wrench-closure"), ("3R", 4, "wrench-feasible")]
COUNTS = {"1T": (1, 2, 3), "2T": (3, 5), "3T": (3, 4, 6), "1R2T": (3, 4, 5), "3R": (3, 4, 5)}
COUNTS |= {"2R3T": (5, 6, 7), "3R3T": (6, 7, 8, 9)}
EVERY = [(pattern, n, condition) for pattern, counts in COUNTS.items() for n in counts for condition in CONDITIONS]


@pytest.mark.parametrize(
    ("pattern", "n", "condition"),
    [pytest.param(*one, marks=() if one in QUICK else pytest.mark.soak) for one in EVERY],
)
def test_no_proved_cell_has_a_sample_against_it(pattern, n, condition):
    rng, found = np.random.default_rng(n), []
    for bounds in ("mixed", "equal"):
        suspended = condition != "wrench-closure" and pattern != "1T" and bounds == "equal"
        drawn = cable_robots.any_robot(rng, pattern, n, suspended=suspended, bounds=bounds)
        asked = Asked(drawn, drawn.pose(rng)[1], condition)
        found.append(check(asked, rng, 60))
    proved, whole = np.sum(found, axis=0)
    assert proved >= 0.3 * whole


def given(robot, condition, limits=None, wrenches=None):
    """Search, cells and frame of a robot of the package."""
    own, frame = centred(robot)
    required = None if wrenches is None else RequiredWrenches(wrenches)
    asked = requirement(own, condition, robot.limits if limits is None else limits, required)
    with double_precision():
        search = WorkspaceSearch(own, asked)
    return search, WorkspaceCells(own, search), own, frame


def answered(search, places, quaternion=NONE):
    with double_precision():
        return search(places, np.tile(quaternion, (len(places), 1)))


@pytest.fixture(scope="module")
def prism():
    """A point mass below a rectangle of spools, 4 m by 2 m, at z = 0, z down: what it is asked is its weight."""
    spools = [[-2.0, -1.0, 0.0], [2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    return given(cspr_jax.point_mass(spools, mass=2.0), "static")[:2]


def test_the_prism_below_the_spools(prism):
    """Cells inside of it and outside of it are proved, those that its faces cut never."""
    _, cells = prism
    rng = np.random.default_rng(1)
    places = np.array([3.0, 2.0, 0.0]) * rng.uniform(-1.0, 1.0, (400, 3)) + np.array([0.0, 0.0, 2.0])
    half = rng.uniform(0.02, 0.3, (400, 3))
    inside, outside = cells(places, half, depth=1)
    gap = np.abs(places[:, :2]) - np.array([2.0, 1.0])
    is_in, is_out = (gap + half[:, :2] < 0.0).all(1), (gap - half[:, :2] > 0.0).any(1)
    assert (inside <= is_in).all() and (outside <= is_out).all()
    assert inside.sum() > 0.93 * is_in.sum() > 50 and outside.sum() > 0.93 * is_out.sum() > 50
    # A cell that a face touches with its side only is no better than one that it cuts.
    touching = np.array([[1.5, 0.0, 2.0], [2.5, 0.0, 2.0]])
    assert not np.any(cells(touching, np.array([0.5, 0.1, 0.1]), depth=2))


def test_halving_decides_more_and_nothing_else(prism):
    _, cells = prism
    rng = np.random.default_rng(2)
    places = np.array([3.0, 2.0, 0.5]) * rng.uniform(-1.0, 1.0, (150, 3)) + np.array([0.0, 0.0, 1.5])
    found = [np.array(cells(places, np.full(3, 0.5), depth=depth)) for depth in (0, 1, 2)]
    gap = np.abs(places[:, :2]) - np.array([2.0, 1.0])
    whole = np.array([(gap + 0.5 < 0.0).all(1), (gap - 0.5 > 0.0).any(1)])
    for less, more in itertools.pairwise(found):
        assert (less <= more).all()
    assert found[0].sum() < found[1].sum() <= found[2].sum() and (found[2] <= whole).all()


def test_a_cell_of_no_size_is_its_centre(prism):
    search, cells = prism
    rng = np.random.default_rng(3)
    places = np.array([3.0, 2.0, 1.0]) * rng.uniform(-1.0, 1.0, (300, 3)) + np.array([0.0, 0.0, 2.0])
    answers = answered(search, places)
    inside, outside = cells(places, np.zeros(3))
    clear = np.abs(answers.margin) > 1e-6
    assert (inside == (answers.verdict == 0))[clear].all() and (outside == (answers.verdict != 0))[clear].all()
    edge = np.array([[2.0, 0.3, 1.0]])
    assert not np.any(cells(edge, np.zeros(3)))


def test_a_set_of_wrenches_needs_every_one():
    """Of a point mass that has to bear each of three forces, beside each of them alone."""
    spools = np.array([[-2.0, -1.0, 2.0], [2.0, -1.0, 2.0], [2.0, 1.0, 2.0], [-2.0, 1.0, 2.0]])
    robot = cspr_jax.point_mass(spools, mass=1.0, z_axis="up")
    limits = Limits(tension_min=1.0, tension_max=60.0)
    loads = np.array([[0.0, 0.0, -20.0], [8.0, 0.0, -20.0], [0.0, -6.0, -20.0]])
    rng = np.random.default_rng(4)
    places = rng.uniform([-2.0, -1.2, 0.5], [2.0, 1.2, 3.0], (150, 3))
    half = rng.uniform(0.0, 0.1, (150, 3))

    def cells_of(wrenches):
        _, cells, _, _ = given(robot, "wrench-feasible", limits, wrenches)
        return cells(places, half, depth=0)

    inside, outside = cells_of(loads)
    each = [cells_of(load[None]) for load in loads]
    alone = np.all([one[0] for one in each], axis=0)
    assert (inside <= alone).all() and inside.sum() > 0.8 * alone.sum() > 10
    beyond = np.any([one[1] for one in each], axis=0)
    assert (outside <= beyond).all() and outside.sum() > 0.8 * beyond.sum() > 10


def test_a_base_point_or_a_pulley_in_the_cell_proves_nothing(prism):
    _, cells = prism
    place = np.array([[1.9, 0.9, 0.3]])
    assert not np.any(cells(place, np.full(3, 0.5), depth=0))
    spools = [[-2.0, -1.0, 0.0], [2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    search, cells, _, _ = given(with_cables(cspr_jax.point_mass(spools, mass=2.0), pulley_radius=0.3), "static")
    place = np.array([[1.2, 0.5, 0.6]])
    answers = answered(search, place)
    assert answers.verdict[0] == 0 and not np.any(cells(place, np.full(3, 0.5), depth=0))


def agree_with_samples(search, cells, frame, places, half, samples, rng):
    """Proved cells beside samples of them: shares of cells proved inside, outside, and of those not contradicted."""
    inside, outside = cells(places, half)
    steps = np.concatenate(
        [np.tile(CORNERS, (len(places), 1, 1)), rng.uniform(-1.0, 1.0, (len(places), samples, 3))], 1
    )
    spots = (places[:, None] + steps * half[:, None]).reshape(-1, 3)
    seen = answered(search, spots).verdict.reshape(len(places), -1)
    assert (seen[inside] == 0).all() and (seen[outside] != 0).all()
    whole = (seen == 0).all(1) | (seen != 0).all(1)
    return inside.sum(), outside.sum(), whole.sum()


@pytest.mark.parametrize(
    ("radius", "count", "samples"), [(0.05, 60, 8), pytest.param(0.1, 5000, 100, marks=pytest.mark.soak)]
)
def test_cells_of_robots_with_pulleys(radius, count, samples):
    """Of a point mass on four cables: exits move with it, and most cells are proved all the same."""
    spools = [[-2.0, -1.0, 0.0], [2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [-2.0, 1.0, 0.0]]
    robot = with_cables(cspr_jax.point_mass(spools, mass=2.0), pulley_radius=radius)
    search, cells, _, frame = given(robot, "wrench-feasible", Limits(tension_min=1.0, tension_max=30.0))
    rng = np.random.default_rng(6)
    places = np.array([3.0, 2.0, 0.7]) * rng.uniform(-1.0, 1.0, (count, 3)) + np.array([0.0, 0.0, 1.8])
    half = rng.uniform(0.0, 0.12, (count, 3))
    inside, outside, whole = agree_with_samples(search, cells, frame, places, half, samples, rng)
    assert inside > 5 and outside > 5 and inside + outside > 0.7 * whole


def test_a_ball_of_accelerations_is_proved_by_the_box_about_it():
    spools = np.array([[-2.0, -1.0, 2.0], [2.0, -1.0, 2.0], [2.0, 1.0, 2.0], [-2.0, 1.0, 2.0]])
    robot = cspr_jax.point_mass(spools, mass=1.0, z_axis="up")
    limits, rng = Limits(tension_min=1.0, tension_max=60.0), np.random.default_rng(7)
    own, frame = centred(robot)
    required = required_wrenches(own, frame, acceleration=1.0)
    with double_precision():
        asked = requirement(own, "wrench-feasible", limits, required)
        search = WorkspaceSearch(own, asked)
    cells = WorkspaceCells(own, search)
    places = np.asarray(frame.inward(rng.uniform([-2.5, -1.5, 0.0], [2.5, 1.5, 1.5], (60, 3))))
    half = rng.uniform(0.0, 0.1, (60, 3))
    inside, outside, whole = agree_with_samples(search, cells, frame, places, half, 8, rng)
    assert inside > 5 and outside > 5 and inside + outside > 0.6 * whole


def whole_cells(name, condition, size, count, turn=NONE):
    """Shares of random cells proved inside and outside, and of all that samples do not contradict."""
    search, cells, own, frame = given(cspr_jax.load_robot(name), condition)
    rng = np.random.default_rng(0)
    low, high = ([-6.0, -4.0, 0.0], [6.0, 4.0, 4.0]) if name == "cogiro" else ([-4.0, -3.0, 2.0], [4.0, 3.0, 4.0])
    turn = frame.rotated_quaternions(np.asarray(turn)[None])[0]
    places = mass_centres(own, np.asarray(frame.inward(rng.uniform(low, high, (count, 3)))), turn[None])
    answers = answered(search, places, turn)
    inside, outside = cells(places, np.full(3, 0.5 * size), turn)
    spots = places[:, None] + 0.5 * size * np.concatenate([CORNERS, rng.uniform(-1.0, 1.0, (20, 3))])
    seen = answered(search, spots.reshape(-1, 3), turn).verdict.reshape(count, -1)
    assert (seen[inside] == 0).all() and (seen[outside] != 0).all()
    whole = (seen == 0).all(1) & (answers.verdict == 0) | (seen != 0).all(1) & (answers.verdict != 0)
    return inside.mean(), outside.mean(), whole.mean()


@pytest.mark.soak
@pytest.mark.parametrize(("size", "least"), [(0.1, 0.99), (0.05, 0.995)])
def test_cells_of_cogiro(size, least):
    inside, outside, whole = whole_cells("cogiro", "wrench-feasible", size, 20_000)
    print(f"cogiro {size} m: {inside:.4f} inside, {outside:.4f} outside, {whole:.4f} whole by samples")
    assert inside + outside > least * whole


@pytest.mark.soak
@pytest.mark.parametrize(("size", "least"), [(0.1, 0.96), (0.05, 0.98)])
def test_cells_of_ipanema(size, least):
    turn = Rotation.from_euler("XYZ", [30.0, -30.0, 5.0], degrees=True).as_quat(scalar_first=True)
    inside, outside, whole = whole_cells("ipanema-2", "wrench-closure", size, 10_000, turn)
    print(f"ipanema-2 {size} m: {inside:.4f} inside, {outside:.4f} outside, {whole:.4f} whole by samples")
    assert inside + outside > least * whole


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(6))
def test_many_random_stretches(seed):
    """Segments and boxes of any size of robots of many patterns, 100,000 in all."""
    rng, found = np.random.default_rng(100 + seed), []
    robots = [("1T", 2), ("2T", 3), ("3T", 5), ("1R2T", 4), ("2R3T", 6), ("3R3T", 7)]
    pattern, n = robots[seed]
    for condition in CONDITIONS:
        drawn = cable_robots.any_robot(rng, pattern, n, suspended=False, bounds="mixed")
        asked = Asked(drawn, drawn.pose(rng)[1], condition)
        for largest in (0.02, 0.2, 1.0):
            found.append(check(asked, rng, 1900, largest=largest, samples=4, programs=5))
    proved, whole = np.sum(found, axis=0)
    print(f"{pattern} {n}: {proved} proved, {whole} whole by samples, of {1900 * len(found)}")
    assert proved > 0.5 * whole
