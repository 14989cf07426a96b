"""Sections against geometry written down independently: points, directions, curvatures, tolerances, lengths, turns."""

import itertools

import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicSpline
from scipy.spatial.transform import Rotation
from support.motions import states_along

from cspr_jax.errors import InputError
from cspr_jax.families.paths.geometry.corners import ROUNDED, position_paths_of
from cspr_jax.families.paths.geometry.elements import Arc, Straight, arc_of
from cspr_jax.families.paths.geometry.section import section_of
from cspr_jax.families.paths.geometry.through_points import through_points

POINTS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.8, 1.2], [1.6, 1.4, 1.0], [0.2, 1.9, 0.7]])
UP = np.array([0.0, 0.0, 1.0])


def curve_of(section, name="position"):
    """Positions, or quaternions, over s."""
    return BPoly(np.moveaxis(np.asarray(getattr(section.curve, name)), 1, 0), np.asarray(section.curve.knots))


def jumps(section, order, name="position"):
    """Largest jumps of a derivative at each inner knot, from the pieces themselves."""
    curve, knots = curve_of(section, name), np.asarray(section.curve.knots)
    sides = [BPoly(curve.c[:, i : i + 1], knots[i : i + 2]) for i in range(len(knots) - 1)]
    pairs = itertools.pairwise(sides)
    return np.array([np.abs(a(x, order) - b(x, order)).max() for (a, b), x in zip(pairs, knots[1:-1], strict=True)])


def one(tracks):
    (track,) = tracks
    return section_of(track)


def half_turn(start, end, speed=np.inf):
    """Half of a circle to the left, from a point to another one."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    return Arc(0.5 * (start + end), start, UP, np.pi, speed=speed)


@pytest.mark.parametrize("angle", [2.0 * np.pi, -1.3, 7.5, 1e-3])
def test_an_arc_is_exact_to_a_ten_billionth(angle):
    normal, centre = np.array([1.0, -2.0, 2.0]) / 3.0, np.array([0.4, 3.0, -1.0])
    outward = np.cross(normal, [0.0, 1.0, 0.0])
    start = centre + 2.5 * outward / np.linalg.norm(outward)
    section = one(position_paths_of([arc_of(centre, start, 7.0 * normal, angle)]))
    s = np.linspace(0.0, 2.5 * abs(angle), 20_001)
    places = curve_of(section)(s)
    exact = centre + Rotation.from_rotvec(normal[None] * (np.sign(angle) * s / 2.5)[:, None]).apply(start - centre)
    assert np.linalg.norm(places - exact, axis=1).max() < 1e-10 * 2.5
    assert section.curve.knots[-1] == pytest.approx(2.5 * abs(angle), rel=1e-14)
    np.testing.assert_allclose(np.linalg.norm(curve_of(section)(s, 1), axis=1), 1.0, atol=1e-8)


def test_a_helix():
    section = one(position_paths_of([Arc(np.zeros(3), np.array([2.0, 0.0, 0.0]), UP, 4.0, rise=3.0)]))
    length = np.hypot(8.0, 3.0)
    s = np.linspace(0.0, length, 5001)
    angle = 4.0 * s / length
    exact = np.stack([2.0 * np.cos(angle), 2.0 * np.sin(angle), 3.0 * s / length], axis=1)
    assert np.linalg.norm(curve_of(section)(s) - exact, axis=1).max() < 2e-10
    assert section.knots[-1] == pytest.approx(length, rel=1e-14)


def test_an_arc_off_its_plane_is_refused():
    for centre in ([0.0, 0.0, 0.1], [1.0, 0.0, 0.0]):
        with pytest.raises(InputError, match=r"centre = .*: must be in a plane with the start"):
            arc_of(np.array(centre), np.array([1.0, 0.0, 0.0]), UP, 1.0)


def test_straight_lines_stop_at_corners_alone():
    points = np.insert(POINTS, 1, 0.3 * POINTS[0] + 0.7 * POINTS[1], axis=0)
    tracks = through_points("polyline", points)
    assert [len(track.knots) for track in tracks] == [3, 2, 2, 2]
    assert [len(track.knots) for track in through_points("line", points)] == [2] * 5
    meet = [curve_of(section_of(track))(track.knots) for track in tracks]
    np.testing.assert_array_equal(np.concatenate([meet[0], *(places[1:] for places in meet[1:])]), points)
    lengths = [float(section_of(track).curve.knots[-1]) for track in tracks]
    exact = np.linalg.norm(np.diff(POINTS, axis=0), axis=1)
    np.testing.assert_allclose(lengths, exact, rtol=1e-15)


@pytest.mark.parametrize("tolerance", [0.001, 0.03, 10.0])
def test_blends_keep_their_tolerance_and_half_of_the_segments(tolerance):
    (track,) = through_points("polyline", POINTS, corner="blend", tolerance=tolerance)
    section = section_of(track)
    places = curve_of(section)(np.linspace(0.0, section.knots[-1], 200_001))
    np.testing.assert_array_equal(places[[0, -1]], POINTS[[0, -1]])
    for i in range(1, 4):
        distance = np.linalg.norm(places - POINTS[i], axis=1).min()
        middle = np.linalg.norm(curve_of(section)(section.knots[i]) - POINTS[i])
        assert middle <= tolerance and middle * (1.0 - 1e-12) <= distance <= middle * 1.001
        # The tolerance is used, unless a segment is too short.
        legs = [np.linalg.norm(POINTS[i + k] - POINTS[i]) for k in (-1, 1)]
        knots = section.curve.knots
        length = float(section.knots[i] - knots[knots < section.knots[i] - 1e-9][-1])
        assert length <= 0.5 * min(legs)
        assert middle == pytest.approx(tolerance, rel=1e-9) or length == pytest.approx(0.49 * min(legs))
    for order in range(3):
        assert jumps(section, order).max() < 1e-9 / (min(tolerance, 0.1) ** order)
    # Halfway along each segment the path is on it.
    for a, b in itertools.pairwise(POINTS):
        assert np.linalg.norm(places - 0.5 * (a + b), axis=1).min() < 1e-4


def test_lines_and_arcs_that_meet_run_on():
    """A slot: round ends without a corner; the curvature jumps there, the direction does not."""
    corners = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 1.0, 1.0], [0.0, 1.0, 1.0]]
    a, b, c, d = (np.array(x) for x in corners)
    section = one(position_paths_of([Straight(a, b, speed=0.5), half_turn(b, c), Straight(c, d), half_turn(d, a, 0.2)]))
    assert section.curve.knots[-1] == pytest.approx(4.0 + np.pi, rel=1e-14)
    assert jumps(section, 0).max() == 0.0 and jumps(section, 1).max() < 1e-12
    assert sorted(jumps(section, 2))[-3:] == pytest.approx([2.0] * 3)
    np.testing.assert_allclose(curve_of(section)(section.knots), [a, b, c, d, a], atol=1e-15)
    starts = np.asarray(section.curve.knots)[:-1]
    expected = np.where(starts < 2.0, 0.5, np.where(starts < 4.0 + 0.5 * np.pi - 1e-9, np.inf, 0.2))
    np.testing.assert_array_equal(section.speed, expected)


def test_corners_of_lines_and_arcs():
    start, corner = np.array([-1.0, 0.0, 0.0]), np.zeros(3)
    arc = Arc(np.array([1.0, 0.0, 0.0]), corner, UP, -np.pi, speed=0.5)  # a corner of a right angle
    lines = [Straight(start, corner, speed=1.0), arc]
    assert len(position_paths_of(lines)) == 2
    (track,) = position_paths_of(lines, "blend", 0.05)
    section = section_of(track)
    assert np.linalg.norm(curve_of(section)(np.linspace(0.0, 2.0, 20_001)), axis=1).min() <= 0.05
    assert max(jumps(section, order).max() for order in range(3)) < 1e-6
    # The blend keeps the smaller of both speeds.
    knots = np.asarray(section.curve.knots)
    assert section.speed[(knots[:-1] < track.knots[1] + 1e-9) & (knots[1:] > 0.5)].tolist() == [1.0, 0.5, 0.5]


def test_rounded_numbers_make_no_stop():
    """A direction that rounding changes by 2e-4 rad is blended within a micrometre."""
    end = np.array([2.0, 2e-4, 0.0])
    section = one(position_paths_of([Straight(np.zeros(3), UP[[2, 0, 1]]), Straight(UP[[2, 0, 1]], end)]))
    assert max(jumps(section, order).max() for order in range(3)) < 1e-7
    places = curve_of(section)(np.linspace(0.9, 1.1, 20_001))
    assert 0.5 * ROUNDED < np.linalg.norm(places - UP[[2, 0, 1]], axis=1).min() <= ROUNDED


def test_a_path_that_turns_back_stops_there():
    back = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.01, 0.0]])
    assert len(through_points("polyline", back, corner="blend", tolerance=0.1)) == 2


@pytest.mark.parametrize(("kind", "smooth"), [("cubic", 3), ("quintic", 5)])
@pytest.mark.parametrize("closed", [False, True])
def test_splines(kind, smooth, closed):
    points = np.concatenate([POINTS, POINTS[:1]]) if closed else POINTS
    section = one(through_points(kind, points, closed=closed))
    chords = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    np.testing.assert_allclose(section.knots, chords, rtol=1e-15)
    np.testing.assert_allclose(curve_of(section)(chords), points, atol=1e-14)
    for order in range(smooth):
        assert jumps(section, order).max() < 1e-8
    ends = np.array([0.0, chords[-1]])
    if closed:
        for order in range(smooth):
            first, last = curve_of(section)(ends, order)
            np.testing.assert_allclose(last, first, atol=1e-8)
    elif kind == "cubic":
        fine = np.linspace(*ends, 1001)
        exact = CubicSpline(chords, points, bc_type="natural")
        np.testing.assert_allclose(curve_of(section)(fine), exact(fine), atol=1e-13)
    else:
        assert np.abs(curve_of(section)(ends, 3)).max() < 1e-8 and np.abs(curve_of(section)(ends, 4)).max() < 1e-7


def test_what_makes_no_path():
    cases = (
        (POINTS[:1], "points: 1 of them: must be two or more"),
        (POINTS[[0, 1, 1, 2]], r"points = \[1.0, 0.0, 1.0\]: must be another place than the point before it"),
    )
    for points, words in cases:
        with pytest.raises(InputError, match=words):
            through_points("cubic", points)
    cusp = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    with pytest.raises(InputError, match=r"behind points\[0\]|behind points\[1\]"):
        through_points("cubic", cusp)


def unit(*rotation_vector):
    return np.roll(Rotation.from_rotvec(rotation_vector).as_quat(), 1)


@pytest.mark.parametrize("angle", [1e-3, 1.0, 3.0])
def test_two_orientations_turn_at_a_constant_rate(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    first = Rotation.from_rotvec([0.2, 0.5, -0.3])
    last = Rotation.from_rotvec(angle * axis) * first
    units = np.roll([first.as_quat(), -last.as_quat()], 1, axis=1)  # the other sign is the same orientation
    (track,) = through_points("line", POINTS[:2])
    section = section_of(track, units)
    shares = np.linspace(0.0, 1.0, 101)
    states = states_along(section.curve, shares)
    expected = (Rotation.from_rotvec(angle * shares[:, None] * axis) * first).as_matrix()
    np.testing.assert_allclose(states.rotation, expected, atol=1e-6)
    np.testing.assert_allclose(states.angular_velocity, np.tile(angle * axis, (101, 1)), rtol=1e-5)
    np.testing.assert_allclose(states.position[30], 0.7 * POINTS[0] + 0.3 * POINTS[1], atol=1e-15)


def test_more_orientations_are_a_smooth_curve_through_them():
    units = np.array([unit(0.0, 0.0, 0.0), unit(0.3, 0.0, 0.0), -unit(0.3, 0.4, 0.0), unit(0, 0.6, 0), unit(0, 0, 1.0)])
    for kind in ("polyline", "cubic"):
        (track,) = through_points(kind, POINTS, corner="blend", tolerance=0.05)
        section = section_of(track, units)
        values = curve_of(section, "quaternion")(section.knots)
        np.testing.assert_allclose(np.abs(np.sum(values * units, axis=1)), 1.0, atol=1e-14)
        assert max(jumps(section, order, "quaternion").max() for order in range(3)) < 1e-7
        ends = curve_of(section, "quaternion")(section.knots[[0, -1]], 2)
        assert np.abs(ends).max() < 1e-9
    same = section_of(track, np.tile(units[1], (5, 1)))
    np.testing.assert_allclose(
        same.curve.quaternion, np.broadcast_to(units[1], same.curve.quaternion.shape), atol=1e-15
    )


@pytest.mark.thorough
def test_turning_on_the_spot_is_a_path_of_a_platform():
    units = np.array([unit(0.0, 0.0, 0.0), unit(0.0, 0.0, 0.5)])
    places = np.zeros((2, 3))
    (track,) = through_points("line", places, units)
    section = section_of(track, units)
    assert section.curve.knots[-1] == pytest.approx(0.5)
    np.testing.assert_allclose(section.curve.state(0.5).angular_velocity, [0.0, 0.0, 1.0], atol=1e-6)
    with pytest.raises(InputError, match=r"points = .*: must be another place"):
        through_points("line", places, units[[0, 0]])
