"""Least durations along straight lines: faces, laws, optimum, bound and proofs, against an oracle of its own."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import lines as oracle

import cspr_jax
from cspr_jax.families.lines.faces import Sides, line_faces, sides
from cspr_jax.families.lines.motion import fixed_law, s_curve
from cspr_jax.families.lines.proof import smallest_slacks
from cspr_jax.families.lines.s_model import least_of_law, least_s_curve, least_time, thesis_s_curve
from cspr_jax.families.lines.slacks import line_slacks
from cspr_jax.families.lines.timed_lines import motions_of, timed_lines
from cspr_jax.motion.amplitudes import derivatives, named
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.point_mass import in_one_plane
from cspr_jax.robots.statics.kernel_axes import prepared
from cspr_jax.schema.verdicts import Verdict

GRAVITY = 9.81
T, P = 4.37688606, 2.23955703  # by brute force, of section 4


def box(rng):
    """A rectangle of random size, and two places below it."""
    x, y, z = rng.uniform([2, 2, 3], [60, 60, 40])
    base = np.array([[0, 0, z], [x, 0, z], [x, y, z], [0, y, z]])
    places = rng.uniform([0.03 * x, 0.03 * y, 0.0], [0.97 * x, 0.97 * y, 0.9 * z], (2, 3))
    return base, *places


@jax.jit
def solved(robot, start, end, largest):
    bounds = sides(line_faces(robot, start, end, in_plane=True), largest / jnp.linalg.norm(end - start))
    return bounds, least_s_curve(bounds), thesis_s_curve(bounds), least_time(bounds)


optimum_of, thesis_of = jax.jit(least_s_curve), jax.jit(thesis_s_curve)
of_law, slacks_of = jax.jit(least_of_law), jax.jit(line_slacks)
law_of, derivatives_of = jax.jit(s_curve), jax.jit(partial(derivatives, order=2))


def of(base, start, end, largest=np.inf):
    robot, frame = prepared(cspr_jax.point_mass(base, mass=10.0, z_axis="up"))
    given = (robot, frame.inward(start), frame.inward(end), np.asarray(float(largest)))
    return jax.tree.map(np.asarray, solved(*given))


def functions(bounds):
    """Smallest and largest s'' of the path coordinate."""

    def upper(s):
        s = np.asarray(s, float)
        return np.min(bounds.up[:, None] + bounds.up_change[:, None] * s.ravel(), axis=0).reshape(s.shape)

    def lower(s):
        s = np.asarray(s, float)
        return -np.min(bounds.down[:, None] + bounds.down_change[:, None] * (1.0 - s.ravel()), axis=0).reshape(s.shape)

    return lower, upper


def test_faces_are_those_of_linear_programs():
    rng, s = np.random.default_rng(2), np.linspace(0.0, 1.0, 4)
    for _ in range(6):
        base, start, end = box(rng)
        bounds = of(base, start, end, 30.0)[0]
        wanted = oracle.path_limits(base, start, end, s, mass=10.0, gravity=GRAVITY, max_acceleration=30.0)
        for own, other in zip(functions(bounds), wanted, strict=True):
            assert own(s) == pytest.approx(other, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_faces_of_planar_robots(count):
    rng, s = np.random.default_rng(count), np.linspace(0.0, 1.0, 4)
    base = np.c_[[0.0, 8.0, *rng.uniform(1, 7, count - 2)], np.zeros(count), np.full(count, 6.0)]
    robot, frame = prepared(cspr_jax.point_mass(base, mass=10.0, z_axis="up", planar=True))
    for _ in range(4):
        start, end = (np.array([x, 0.0, z]) for x, z in rng.uniform([0.5, 0.0], [7.5, 5.5], (2, 2)))
        bounds = jax.tree.map(np.asarray, solved(robot, frame.inward(start), frame.inward(end), np.asarray(30.0))[0])
        wanted = oracle.path_limits(
            base[:, [0, 2]],
            start[[0, 2]],
            end[[0, 2]],
            s,
            mass=10.0,
            gravity=GRAVITY,
            planar=True,
            max_acceleration=30.0,
        )
        for own, other in zip(functions(bounds), wanted, strict=True):
            assert own(s) == pytest.approx(other, rel=1e-7, abs=1e-9)


def test_laws():
    tau = np.linspace(0.0, 1.0, 301)
    for ratio in (0.1, 0.4, 0.5, 0.83):
        law = law_of(np.asarray(ratio))
        own = tuple(map(np.asarray, derivatives_of(law, tau)))
        wanted = oracle.s_curve(tau * 3.0, ratio * 3.0, 3.0)
        for i, (one, other) in enumerate(zip(own, wanted, strict=True)):
            assert np.asarray(one) / 3.0**i == pytest.approx(other, abs=2e-14 / min(ratio, 1 - ratio) ** 2)
        assert np.abs(own[2]).max() <= law.largest[2] and np.max(own[1]) <= law.largest[1]
    for name, function in (("quintic", oracle.quintic), ("cubic", oracle.cubic)):
        own = derivatives_of(fixed_law(name), tau)
        for i, (one, other) in enumerate(zip(own, function(tau * 3.0, 3.0), strict=True)):
            assert np.asarray(one) / 3.0**i == pytest.approx(other, abs=1e-14)


def test_the_case_of_the_text():
    bounds, optimum, thesis, bound = of(oracle.BASE, oracle.START, oracle.END, oracle.MAX_ACCELERATION)
    for least in (optimum, thesis):
        assert least.duration == pytest.approx(T, abs=1e-8)
        assert least.duration * least.ratio == pytest.approx(P, abs=1e-8)
    assert bound == pytest.approx(3.10085856, abs=1e-8)
    # (22) to (25): -0.755, -1.887; -0.276, 0.867; -0.350, 0.438; -0.432, -0.031.
    finite = np.isfinite(bounds.up)
    lines = sorted(zip(bounds.up_change[finite].round(3), bounds.up[finite].round(3), strict=True))
    assert lines == [(-0.350, 0.438), (-0.276, 0.867), (0.0, 0.602)]


def check_optimum(count, seed):
    """Optimum, bound and the rule of the text against brute force, for random boxes."""
    rng, same = np.random.default_rng(seed), 0
    for i in range(count):
        base, start, end = box(rng)
        largest = rng.uniform(1.0, 40.0) if i % 2 else 200.0
        bounds, optimum, thesis, bound = of(base, start, end, largest)
        lower, upper = functions(bounds)
        wanted, _ = oracle.least_duration_of_s_curve(lower, upper)
        assert optimum.duration == pytest.approx(wanted, rel=1e-6), i
        assert optimum.duration <= wanted * (1.0 + 1e-9)
        assert bound == pytest.approx(oracle.least_time(lower, upper, cells=20_000), rel=1e-6)
        assert bound < optimum.duration
        same += abs(thesis.duration / optimum.duration - 1.0) < 1e-9
    return same


def test_the_optimum_is_that_of_a_dense_search():
    assert check_optimum(2, 1) == 2


@pytest.mark.soak
def test_the_optimum_is_that_of_a_dense_search_all():
    print(check_optimum(2000, 2), "of 2000 boxes have the optimum by the rule of the text")


def test_the_way_back_is_the_same_backwards():
    """A motion run backwards has the same accelerations at the same places; sizes and mirrors change what they must."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        base, start, end = box(rng)
        _, there, _, bound = of(base, start, end, 20.0)
        _, back, _, same = of(base, end, start, 20.0)
        assert back.duration == pytest.approx(there.duration, rel=1e-11)
        assert back.ratio == pytest.approx(1.0 - there.ratio, rel=1e-9) and same == pytest.approx(bound, rel=1e-10)
        _, bigger, _, longer = of(4.0 * base, 4.0 * start, 4.0 * end, 20.0)
        assert bigger.duration == pytest.approx(2.0 * there.duration, rel=1e-11)
        assert longer == pytest.approx(2.0 * bound, rel=1e-10)
        mirror = np.array([-1.0, 1.0, 1.0])
        _, other, _, _ = of(base * mirror, start * mirror, end * mirror, 20.0)
        assert other.duration == pytest.approx(there.duration, rel=1e-11) and other.ratio == pytest.approx(there.ratio)


def test_a_rising_bound_is_touched_before_its_corner():
    """Away from an edge the bound rises, and the curve may touch it before Q3: the rule of the text passes it."""
    flat = {"down": np.array([9.0]), "down_change": np.array([0.0])}
    one = jnp.asarray([[0.5, 30.0]]), jnp.asarray([[0.02, 30.0]])
    found = 0
    for start, slope in (np.asarray(x)[0] for x in one):
        bounds = sides_of(np.array([start]), np.array([slope]), **flat)
        lower, upper = functions(bounds)
        optimum, thesis = optimum_of(bounds), thesis_of(bounds)
        wanted, _ = oracle.least_duration_of_s_curve(lower, upper)
        assert float(optimum.duration) == pytest.approx(wanted, rel=1e-6)
        found += float(thesis.duration) < wanted * (1.0 - 1e-3)
    assert found == 2


def sides_of(up, up_change, down, down_change):
    everywhere = np.zeros_like(up), np.ones_like(up)
    return Sides(*(np.asarray(x, float) for x in (up, up_change, down, down_change, *everywhere)))


@pytest.mark.parametrize("name", ["quintic", "cubic"])
def test_other_laws(name):
    rng, tau = np.random.default_rng(5), np.linspace(0.0, 1.0, 20_001)
    s, _, second_derivative = (np.asarray(x) for x in derivatives_of(fixed_law(name), jnp.asarray(tau)))
    for _ in range(4):
        bounds, _, _, bound = of(*box(rng), 25.0)
        least = of_law(fixed_law(name), bounds)
        lower, upper = functions(bounds)
        with np.errstate(divide="ignore"):
            gain = min(
                np.min((upper(s) / second_derivative)[second_derivative > 0.0]),
                np.min((lower(s) / second_derivative)[second_derivative < 0.0]),
            )
        assert float(least.duration) == pytest.approx(gain**-0.5, rel=1e-6) and least.duration > bound


def problem_of(robot):
    own, frame = prepared(robot)
    return Problem(own, NO_LIMITS, named("quintic")), frame


def one_of_many(tree):
    return jax.tree.map(lambda x: np.asarray(x)[None], tree)


@pytest.mark.parametrize("law", ["s-curve", *(pytest.param(x, marks=pytest.mark.soak) for x in ("quintic", "cubic"))])
def test_verdicts_are_proved(law):
    """Margins are those of dense samples of another form, of slower motions and of faster ones, which are refuted."""
    rng = np.random.default_rng(8)
    base, start, end = box(rng)
    robot = cspr_jax.point_mass(base, mass=10.0, z_axis="up")
    problem, frame = problem_of(robot)
    ends = frame.inward(start)[None], frame.inward(end)[None]
    answers = timed_lines(problem, *ends, law=law, max_acceleration=1e3)
    (motion,) = motions_of(answers, *ends, law=law)
    assert answers.feasible.all() and 0.0 < answers.margin_bound[0] <= answers.margin[0] < 1e-5
    line, time_law = (one_of_many(x) for x in (slacks_of(problem, *(x[0] for x in ends)), motion.law))
    for factor, wanted in ((1.3, 1.0), (0.97, -1.0)):
        duration = float(motion.time) * factor
        proved = smallest_slacks(line, time_law, np.array([duration]), GRAVITY)
        margin, bound = proved.attained.item(), proved.bound.item()
        assert np.sign(bound) == np.sign(margin)
        slower = jax.vmap(type(motion)(motion.start, motion.direction, motion.law, duration).state)
        states = slower(np.concatenate([np.linspace(0.0, 1.0, 4001), motion.breaks()]))
        places, accelerations = frame.outward(np.asarray(states.position)), frame.rotated(states.acceleration)
        sampled = cspr_jax.available_accelerations(robot, places).margin(np.asarray(accelerations)).min()
        assert margin <= sampled + 1e-9 and margin == pytest.approx(sampled, rel=1e-3)
        assert np.sign(sampled) == wanted


def test_spools_in_one_plane():
    assert in_one_plane(cspr_jax.load_robot("boralugoda-rectangle"))
    assert in_one_plane(cspr_jax.load_robot("prototype"))
    assert in_one_plane(cspr_jax.load_robot("boralugoda-planar-three"))
    deviation = cspr_jax.point_mass([[0, 0, 3], [4, 0, 3], [4, 4, 3.1], [0, 4, 3]], mass=1.0, z_axis="up")
    assert not in_one_plane(deviation)


def test_verdict_flags_of_answers():
    problem, frame = problem_of(cspr_jax.load_robot("boralugoda-rectangle"))
    ends = frame.inward(np.array([[1.0, 20.0, 7.0]] * 2)), frame.inward(np.array([[1.0, 20.0, 12.0], [9.0, 9.0, 9.0]]))
    answers = timed_lines(problem, *ends)
    assert answers.verdict.tolist() == [Verdict.NOT_FINITE.value, 0]


@pytest.mark.parametrize("limits", [{"tension_max": jnp.full(4, 80.0)}, {"acceleration_max": jnp.asarray(5.0)}])
def test_limits_bound_the_acceleration_where_taut_cables_do_not(limits):
    """A vertical line, along which taut cables alone bound no acceleration upwards."""
    problem, frame = problem_of(cspr_jax.load_robot("boralugoda-rectangle"))
    problem = problem._replace(limits=Limits(**limits))
    ends = frame.inward(np.array([[1.0, 20.0, 7.0]])), frame.inward(np.array([[1.0, 20.0, 12.0]]))
    alone, bounded = (timed_lines(problem, *ends, max_acceleration=largest) for largest in (np.inf, 1e3))
    assert alone.feasible.all() and alone.duration == pytest.approx(bounded.duration, rel=1e-6)
    assert 0.0 < alone.least_duration <= alone.duration
