"""Smallest number of arcs: against the table in print, an independent search, and every kind of refusal."""

import itertools

import jax
import numpy as np
import pytest
from conftest import TILTED, equilateral
from oracles import point_mass as oracle

from cspr_jax.errors import InputError
from cspr_jax.families.swings.arcs import minimum_arcs
from cspr_jax.families.swings.proof import margins
from cspr_jax.families.swings.proof.margins import smallest_values
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model import point_mass
from cspr_jax.robots.model.limits import Limits
from cspr_jax.schema.limits import LIMITS as ROWS
from cspr_jax.schema.verdicts import Verdict

Z0 = 1.7
BASE = equilateral(0.26)
QUINTIC = named("quintic")
TABLE = [(0.7, 0.7, 3), (-1.1, -1.1, 0.5), (-1.1, -0.9, 1.5), (0.8, 0.5, 1.5), (-0.6, 0.1, 1.9), (0.1, -0.6, 1.8)]
TABLE = np.array([*TABLE, (0.0, -1.1, 1.7)])
NO_LIMITS = Limits()


def answer(starts, ends, limits=NO_LIMITS, base=BASE, z0=Z0, mass=0.198, **options):
    starts, ends = np.atleast_2d(np.asarray(starts, float)), np.atleast_2d(np.asarray(ends, float))
    problem = Problem(point_mass.point_mass_robot(base, mass=mass), limits, QUINTIC)
    return minimum_arcs(problem, starts, ends, np.full(len(starts), z0), **options)


def random_points(seed, n, far=1.1, deep=3.2, high=0.2):
    rng = np.random.default_rng(seed)
    return tuple(rng.uniform([-far, -far, high], [far, far, deep], (n, 3)) for _ in range(2))


def test_table_of_chapter_2():
    """Table 2.1: arcs, durations and (2.55) as printed where they are, as the reference finds them elsewhere."""
    found = answer(TABLE[:-1], TABLE[1:])
    assert found.arcs[:3].tolist() == [5, 2, 5]
    np.testing.assert_allclose(found.duration[:3], [6.54, 2.61, 6.54], atol=0.005)
    np.testing.assert_allclose(found.feasible_at_infinity[:3], [-0.1557, -0.1416, 0.2057], atol=5e-5)
    center = np.array([0.0, 0.0, Z0])
    for i, (start, end) in enumerate(itertools.pairwise(TABLE)):
        assert found.arcs[i] == oracle.smallest_arcs(BASE, start, end, Z0, 9.81, 30)
        assert found.duration[i] == pytest.approx(oracle.motion(start, end, center, 9.81, int(found.arcs[i]), 0.0)[0])
        at_infinity = oracle.feasibility_at_infinity(BASE, start, end, Z0)
        assert found.feasible_at_infinity[i] == pytest.approx(at_infinity, abs=1e-12)
    assert (found.verdict == Verdict.FEASIBLE).all()
    assert np.array_equal(found.tried_arcs, found.arcs)
    assert (found.margin >= found.margin_bound).all()
    assert (found.limit_margin == np.inf).all()


def test_more_arcs_can_lose_margin():
    """The thesis's claim that two more arcs always help where (2.55) holds is false: never bisect over p."""
    start, end = (0.721, -0.917, 1.206), (1.076, -0.822, 0.692)
    found = answer([start] * 3, [end] * 3, arcs=np.array([2, 4, 6]))
    assert (found.feasible_at_infinity > 0).all()
    assert found.arcs.tolist() == [2, 0, 6]
    np.testing.assert_allclose(found.margin, [0.07, -0.04, 0.25], atol=0.006)


def test_targets_below_twice_z0_are_not_refused():
    """(2.59) is necessary only as p grows: here z1 > 2 z0, and one arc will do."""
    found = answer([(-0.026, 0.145, 3.436)], [(0.068, -0.115, 0.525)])
    assert found.arcs.tolist() == [1]
    assert found.feasible_at_infinity[0] < 0


@pytest.mark.parametrize(("base", "deep"), [(BASE, 3.4), (TILTED, 3.6)], ids=["prototype", "tilted"])
def test_against_an_independent_search(base, deep):
    """One p after the other, by dense samples: no smaller number may be missed, none may be too small."""
    starts, ends = random_points(31, 40, far=1.4, deep=deep)
    rest = base.mean(0) + np.array([0.0, 0.0, Z0])
    starts[:8], ends[8:16] = rest, rest
    found = answer(starts, ends, base=base, max_arcs=12)
    wanted = [oracle.smallest_arcs(base, a, b, Z0, 9.81, 12, samples=5001) for a, b in zip(starts, ends, strict=True)]
    assert found.arcs.tolist() == wanted
    assert (found.arcs == 0).any()
    assert len(set(found.arcs[:16][found.arcs[:16] > 0] % 2)) == 2  # odd numbers too, from rest and to rest


@pytest.mark.thorough
def test_without_arcs_the_best_candidate_is_reported():
    """The margin of an infeasible cell tells how far it is from feasible: the largest over all numbers of arcs."""
    starts, ends = random_points(32, 30, far=1.4, deep=4.0, high=-0.2)
    found = answer(starts, ends, max_arcs=4)
    none = np.flatnonzero(found.arcs == 0)
    assert len(none) > 10
    for i in none:
        each = [oracle.margin(BASE, starts[i], ends[i], Z0, 9.81, p, samples=20_001) for p in range(1, 5)]
        assert found.margin[i] == pytest.approx(max(each), abs=1e-6 * (1.0 + abs(max(each))))
        assert each[found.tried_arcs[i] - 1] == pytest.approx(max(each), abs=1e-6)
        assert found.verdict[i] & Verdict.NO_ARCS
        assert found.verdict[i] & (Verdict.SLACK_CABLE | Verdict.ABOVE_SPOOLS)
        assert found.margin_bound[i] <= found.margin[i] < 0
        center = np.array([0.0, 0.0, Z0])
        duration = oracle.motion(starts[i], ends[i], center, 9.81, int(found.tried_arcs[i]), 0.0)[0]
        assert found.duration[i] == pytest.approx(duration)


@pytest.mark.thorough
def test_cables_choose_what_is_shown_without_limits(monkeypatch):
    """Where the cables refuse a cell, limits change nothing of what is shown, and few candidates are refined."""
    ends, wide = random_points(32, 30, far=4.5, deep=3.5, high=1.0)[1], {"base": equilateral(1.7), "z0": 1.2}
    starts = np.tile([0.0, 0.0, 1.2], (len(ends), 1))
    plain = answer(starts, ends, **wide)
    refined = []

    def counted(functions, problem, segments, arcs, table):
        refined.append(len(arcs))
        return smallest_values(functions, problem, segments, arcs, table)

    monkeypatch.setattr(margins, "smallest_values", counted)
    found = answer(starts, ends, limits_of("floor", 4.0), **wide)
    by_cables = np.flatnonzero((plain.arcs == 0) & (found.arcs == 0))
    assert len(by_cables) > 5
    assert np.array_equal(found.tried_arcs[by_cables], plain.tried_arcs[by_cables])
    np.testing.assert_allclose(found.margin[by_cables], plain.margin[by_cables], rtol=0, atol=1e-9)
    assert sum(refined) < 5 * len(starts)  # of 30 numbers of arcs


@pytest.mark.thorough
def test_fixed_and_largest_numbers_of_arcs():
    """A number that is asked for is the only one tried; 0 leaves the choice; nothing beyond max_arcs."""
    found = answer([TABLE[2]] * 4, [TABLE[3]] * 4, arcs=np.array([0, 7, 5, 3]))
    assert found.arcs.tolist() == [5, 7, 5, 0]
    assert found.tried_arcs.tolist() == [5, 7, 5, 3]
    assert found.margin[1] > found.margin[2] > 0 > found.margin[3]  # Fig. 2.8: 7 arcs pull harder than 5
    few = answer(TABLE[:-1], TABLE[1:], max_arcs=1)
    assert few.arcs.tolist() == [0] * 6
    assert few.tried_arcs.tolist() == [1] * 6
    short = answer([(-0.026, 0.145, 3.436)], [(0.068, -0.115, 0.525)], max_arcs=1)
    assert short.arcs.tolist() == [1]
    assert answer(TABLE[:-1], TABLE[1:], max_arcs=5).arcs.tolist() == [5, 2, 5, 5, 5, 0]


def test_rest_and_coincident_points():
    """From rest to rest one arc will do; a point to itself needs two; one arc there is no trajectory."""
    rest = (0.0, 0.0, Z0)
    found = answer([rest, TABLE[0], TABLE[0]], [rest, TABLE[0], TABLE[0]], arcs=np.array([0, 0, 1]))
    assert found.arcs.tolist() == [1, 2, 0]
    assert found.margin[0] == pytest.approx(1.0)
    assert found.margin[1] == pytest.approx(oracle.margin(BASE, TABLE[0], TABLE[0], Z0, 9.81, 2), abs=1e-6)
    assert found.duration[2] == 0.0
    assert found.verdict[2] & Verdict.NO_ARCS


@pytest.mark.thorough
def test_what_stays_undecided_is_flagged():
    """A margin within the tolerance of zero is said to be so, also where more arcs then do."""
    low, high = 0.4, 0.5  # z of the start of Table 2.1's second segment: at 0.45 two arcs have no margin left
    n = 257
    for _ in range(5):
        z = np.linspace(low, high, n)
        starts, ends = np.c_[np.full((n, 2), -1.1), z], np.tile(TABLE[2], (n, 1))
        two = answer(starts, ends, arcs=np.full(n, 2))
        low, high = z[two.verdict & Verdict.NO_ARCS > 0][-1], z[two.arcs == 2][0]
    between = two.verdict == Verdict.UNDECIDED
    assert between.sum() > n // 2
    assert (two.arcs[between] == 0).all()
    assert (np.abs(two.margin[between]) < 2e-9).all()
    free = answer(starts[between], ends[between])
    assert (free.arcs > 2).all()
    assert (free.verdict == Verdict.FEWER_ARCS_UNDECIDED).all()


def test_target_above_the_spools():
    """No number of arcs lifts a mass above the spools; a point that is not a number is not feasible either."""
    found = answer([(0.3, 0.0, 1.2)] * 3, [(0.1, 0.05, -0.02), (0.1, 0.05, 0.4), (np.nan, 0.0, 1.0)])
    assert found.arcs[0] == found.arcs[2] == 0
    assert found.verdict[0] & Verdict.ABOVE_SPOOLS
    assert found.verdict[0] & Verdict.NO_ARCS
    assert not found.verdict[1] & Verdict.ABOVE_SPOOLS
    assert found.verdict[2] & Verdict.NO_ARCS
    assert found.verdict[2] & Verdict.NOT_FINITE


LIMITS = {  # limit, its attained extreme, its flag, and whether it is a lower limit
    "tension_min": ("tension_min", Verdict.SLACK_CABLE, True),
    "tension_max": ("tension_max", Verdict.OVER_TENSION, False),
    "floor": ("z_max", Verdict.BELOW_FLOOR, False),
    "cable_length_max": ("length_max", Verdict.CABLE_TOO_LONG, False),
    "cable_speed_max": ("speed_max", Verdict.CABLE_TOO_FAST, False),
    "cable_acceleration_max": ("cable_acceleration_max", Verdict.CABLE_OVER_ACCELERATION, False),
    "speed_max": ("mass_centre_speed", Verdict.TOO_FAST, False),
    "acceleration_max": ("mass_centre_acceleration", Verdict.OVER_ACCELERATION, False),
}
OF_CABLES = [row.name for row in ROWS if row.per_cable]


def limits_of(key, value):
    """One limit, the others out of reach: given all the same, so that kernels compile once."""
    far = {other: np.full(3, -1e6 if other == "tension_min" else 1e6) for other in LIMITS} | {key: np.full(3, value)}
    return Limits(**{other: v if other in OF_CABLES else v[0] for other, v in far.items()})


@pytest.mark.quick("tension_min")
@pytest.mark.parametrize("key", LIMITS)
def test_each_limit_raises_its_own_flag(key):
    """Just inside the extreme that the motion attains the limit refuses it, just outside it does not."""
    start, end, arcs = TABLE[2], TABLE[3], np.array([5])
    attained, flag, lower = LIMITS[key]
    extreme = oracle.limits(BASE, 0.198, start, end, Z0, 9.81, 5)[attained]
    for factor in (0.999, 1.001):
        found = answer(start, end, limits_of(key, extreme * factor), arcs=arcs)
        met = factor < 1.0 if lower else factor > 1.0
        assert found.arcs.tolist() == [5 if met else 0]
        assert found.verdict[0] == (Verdict.FEASIBLE if met else Verdict.NO_ARCS | flag)
        assert (found.limit_margin[0] > 0) == met
        assert found.margin[0] > 0


def test_a_touched_limit_is_met():
    """A target on the floor is a common wish: rounding must not refuse it."""
    still = answer([(0.0, 0.0, Z0)], [(0.4, 0.3, Z0)], limits_of("floor", Z0))
    assert still.arcs[0] > 0
    assert still.verdict[0] == Verdict.FEASIBLE


def single_precision(count):
    """The sieve may reject only what is refuted: in float32 the answers must be the same."""
    starts, ends = random_points(33, count, far=1.4, deep=3.6)
    one, other = (answer(starts, ends, dtype=dtype) for dtype in ("float64", "float32"))
    assert np.array_equal(one.arcs, other.arcs)
    assert np.array_equal(one.verdict, other.verdict)
    assert (one.arcs == 0).any()


@pytest.mark.thorough
def test_single_precision_sieve_changes_nothing():
    single_precision(150)


@pytest.mark.soak
def test_single_precision_sieve_changes_nothing_all():
    single_precision(20_000)


@pytest.mark.thorough
def test_parts_are_put_together_in_order(monkeypatch):
    """More than a batch, in several rounds of two threads, with numbers of arcs and depths of their own."""
    starts, ends = random_points(34, 500, far=1.2, deep=3.2)
    rng = np.random.default_rng(35)
    arcs, z0 = rng.integers(0, 9, len(starts)), rng.uniform(1.4, 1.8, len(starts))
    pieces = [
        answer(starts[k : k + 100], ends[k : k + 100], z0=z0[k : k + 100], arcs=arcs[k : k + 100])
        for k in range(0, 500, 100)
    ]
    monkeypatch.setattr("cspr_jax.families.swings.arcs.PART", 80)
    whole = answer(starts, ends, z0=z0, arcs=arcs)
    for name, values in whole.arrays().items():
        np.testing.assert_array_equal(values, np.concatenate([getattr(piece, name) for piece in pieces]), err_msg=name)


def test_refusals():
    """Unusable settings are refused by name, before anything is computed."""
    points = TABLE[:1]
    for options, key in (({"max_arcs": 0}, "max_arcs"), ({"z0": 0.0}, "z0"), ({"z0": np.nan}, "z0")):
        with pytest.raises(InputError) as raised:
            answer(points, points, **options)
        assert raised.value.key == key
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(InputError, match="float64"):
            answer(points, points)
    finally:
        jax.config.update("jax_enable_x64", True)
