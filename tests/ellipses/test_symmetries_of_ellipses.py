"""What must leave margins and frequencies of ellipses as they are, the natural frequency, and large amplitudes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import ellipses as oracle
from scipy.spatial.transform import Rotation
from support.ellipses import ellipses, flat_spools, triangle

import cspr_jax

GRAVITY, COUNT = 9.81, 32
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=10)


class Case:
    """Random spools with ellipses on them, whose answers each change must leave."""

    def __init__(self, seed, cables=3):
        self.rng = np.random.default_rng(seed)
        self.spools = flat_spools(self.rng, cables)
        self.centre, self.a, self.b, self.frequency = ellipses(self.rng, self.spools, GRAVITY, COUNT)
        self.answers = answers(self.spools, self.centre, self.a, self.b, self.frequency)

    def same(self, spools, centre, a, b, *, frequency=None, quicker=1.0, **robot):
        found = answers(spools, centre, a, b, self.frequency * quicker, **robot)
        np.testing.assert_allclose(found[0], self.answers[0], rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(np.isnan(found[1]), np.isnan(self.answers[1]))
        # Squares: an end at 0 has a square root that rounding shifts far.
        np.testing.assert_allclose(found[1] ** 2, (quicker * self.answers[1]) ** 2, rtol=1e-8, atol=1e-8)


def answers(spools, centre, a, b, frequency, *, mass=1.0, gravity=GRAVITY, z_axis="down"):
    robot = cspr_jax.point_mass(spools, mass=mass, gravity=gravity, z_axis=z_axis)
    ends = [x[0] if len(x) else [np.nan, np.nan] for x in cspr_jax.ellipse_frequencies(robot, centre, a, b)]
    return cspr_jax.ellipse_margins(robot, centre, a, b, frequency), np.array(ends)


@few
@given(seeds, st.floats(-np.pi, np.pi))
def test_turned_about_the_vertical_and_mirrored(seed, angle):
    case = Case(seed)
    turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
    mirror = np.diag([-1.0, 1.0, 1.0])
    for change in (turn, mirror, turn @ mirror):
        case.same(*(x @ change.T for x in (case.spools, case.centre, case.a, case.b)))


@few
@given(seeds, st.floats(0.1, 10.0), st.floats(0.3, 3.0), st.floats(0.01, 1000.0))
def test_lengths_times_and_masses_scale(seed, longer, quicker, mass):
    case = Case(seed)
    scaled = [longer * x for x in (case.spools, case.centre, case.a, case.b)]
    case.same(*scaled, quicker=quicker, gravity=GRAVITY * longer * quicker**2, mass=mass)


@few
@given(seeds, st.floats(-np.pi, np.pi))
def test_backwards_and_from_another_angle_of_the_same_ellipse(seed, angle):
    case = Case(seed)
    case.same(case.spools, case.centre, case.a, -case.b)
    cosine, sine = np.cos(angle), np.sin(angle)
    case.same(case.spools, case.centre, case.a * cosine + case.b * sine, case.b * cosine - case.a * sine)


@few
@given(seeds, st.permutations(range(4)))
def test_axes_of_files_places_and_orders_of_cables(seed, order):
    case = Case(seed, 4)
    shift = case.rng.normal(size=3) * 5.0
    case.same((case.spools + shift)[list(order)], case.centre + shift, case.a, case.b)
    upward = np.diag([1.0, -1.0, -1.0])  # a turn by half about x
    case.same(*(x @ upward for x in (case.spools, case.centre, case.a, case.b)), z_axis="up")
    # A spool among the others adds nothing but a shift of their centroid: signs stay.
    inner = case.spools.T @ case.rng.dirichlet(np.ones(4))
    found = answers(np.vstack([case.spools, inner]), case.centre, case.a, case.b, case.frequency)
    np.testing.assert_array_equal(found[0] > 0.0, case.answers[0] > 0.0)
    np.testing.assert_allclose(found[1] ** 2, case.answers[1] ** 2, rtol=1e-8, atol=1e-8)


@few
@given(seeds, st.floats(-2.0, 4.0))
def test_every_amplitude_is_feasible_at_the_natural_frequency(seed, decades):
    rng = np.random.default_rng(seed)
    spools = triangle(rng)
    centre = rng.dirichlet(np.ones(3), COUNT) @ spools
    centre[:, 2] += rng.uniform(0.1, 5.0, COUNT)
    depth = oracle.depths(spools, centre)
    axes = rng.normal(size=(2, COUNT, 3)) * 10.0**decades
    axes[..., 2] -= axes @ oracle.normal(spools)
    robot = cspr_jax.point_mass(spools, mass=1.0, gravity=GRAVITY)
    natural = np.sqrt(GRAVITY / depth)
    found = cspr_jax.ellipse_margins(robot, centre, *axes, natural)
    # All the time that of the rest at the centre, but for the rounding of the frequency.
    still = oracle.shares(spools, GRAVITY, centre, np.zeros_like(centre)).min(1)
    np.testing.assert_allclose(
        found, still, atol=1e-13 * 10.0 ** max(decades, 0.0) * np.linalg.norm(axes[0], axis=1).max()
    )
    for ends, middle in zip(cspr_jax.ellipse_frequencies(robot, centre, *axes), natural, strict=True):
        assert ends[0, 0] < middle < ends[0, 1]
    # In any other plane, too, as long as the ellipse stays below the spools.
    axes[..., 2] += 0.6 * depth * rng.uniform(-1.0, 1.0, (2, COUNT))
    found = cspr_jax.ellipse_margins(robot, centre, *axes, natural)
    assert (found > 0.0).all()


def test_large_ellipses_leave_the_natural_frequency_alone():
    """The interval shrinks about it as one over the size, and the margin at any other frequency grows as the size."""
    rng = np.random.default_rng(4)
    spools = triangle(rng)
    centre, a, b, _ = (x[:1] for x in ellipses(rng, spools, GRAVITY, 8, above=False))
    depth = oracle.depths(spools, centre)[0]
    robot = cspr_jax.point_mass(spools, mass=1.0, gravity=GRAVITY)
    sizes = 10.0 ** np.arange(1.0, 6.0)[:, None]
    places = np.repeat(centre, len(sizes), axis=0)
    ends = np.stack([x[0] for x in cspr_jax.ellipse_frequencies(robot, places, sizes * a, sizes * b)])
    e = 1.0 - ends**2 * depth / GRAVITY
    assert (e[:, 0] > 0.0).all() and (e[:, 1] < 0.0).all()
    np.testing.assert_allclose(sizes * e, np.tile(sizes[-1] * e[-1], (len(sizes), 1)), rtol=1e-4)
    margins = cspr_jax.ellipse_margins(robot, places, sizes * a, sizes * b, 1.3 * np.sqrt(GRAVITY / depth))
    still = oracle.shares(spools, GRAVITY, centre, np.zeros((1, 3))).max()
    np.testing.assert_allclose(margins / sizes[:, 0], margins[-1] / sizes[-1, 0], atol=2.0 * still / sizes[0, 0])
