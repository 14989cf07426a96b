"""G-code against moves worked out by hand; what is not read is refused with its line."""

import itertools
import math

import numpy as np
import pytest

from cspr_jax.config.gcode.reading import read_program
from cspr_jax.errors import ConfigError
from cspr_jax.families.paths.geometry.corners import position_paths_of
from cspr_jax.families.paths.geometry.elements import elements_of

PROGRAM = """%
N10 G21 G90 (millimetres; absolute) ; and more
G0 X0 Y0 Z100
G1X100F600 (spaces are free)
g2 x200 y0 i50 j0
G3 X200 Y100 R50
X200 Y200 R-50

G91 G1 X-10
G90 G20 G17
G1 X1 Y1 F10
G2 I1 Z3
G0 Z2
F1
M30
what follows is not read
"""
INCH = 0.0254
INF = math.inf
MOVES = [
    (4, [0.0, 0.0, 0.1], [0.1, 0.0, 0.1], None, 0.0, 0.01),
    (5, [0.1, 0.0, 0.1], [0.2, 0.0, 0.1], [0.15, 0.0], -math.pi, 0.01),
    (6, [0.2, 0.0, 0.1], [0.2, 0.1, 0.1], [0.2, 0.05], math.pi, 0.01),
    (7, [0.2, 0.1, 0.1], [0.2, 0.2, 0.1], [0.2, 0.15], math.pi, 0.01),
    (9, [0.2, 0.2, 0.1], [0.19, 0.2, 0.1], None, 0.0, 0.01),
    (11, [0.19, 0.2, 0.1], [INCH, INCH, 0.1], None, 0.0, 10.0 * INCH / 60.0),
    (12, [INCH, INCH, 0.1], [INCH, INCH, 3.0 * INCH], [2.0 * INCH, INCH], -2.0 * math.pi, 10.0 * INCH / 60.0),
    (13, [INCH, INCH, 3.0 * INCH], [INCH, INCH, 2.0 * INCH], None, 0.0, INF),
]


def moves(folder, text, start=None):
    path = folder / "a.nc"
    path.write_text(text, "utf-8")
    return read_program(path, start).moves


def notes(folder, text):
    path = folder / "a.nc"
    path.write_text(text, "utf-8")
    return read_program(path).notes


def test_a_program_by_hand(tmp_path):
    read = moves(tmp_path, PROGRAM)
    assert [move.line for move in read] == [row[0] for row in MOVES]
    for move, (_, start, end, centre, angle, speed) in zip(read, MOVES, strict=True):
        np.testing.assert_allclose([*move.start, *move.end], [*start, *end], atol=1e-15)
        assert (move.centre is None) == (centre is None)
        np.testing.assert_allclose(move.centre or [0.0], centre or [0.0], atol=1e-15)
        assert (move.angle, move.speed) == pytest.approx((angle, speed))
    # Lines, arcs and a helix one behind another, each from the end of the one before.
    elements = elements_of(read)
    for before, after in itertools.pairwise(elements):
        np.testing.assert_allclose(before.end, after.start, atol=1e-12)
    assert sum(element.length for element in elements) == pytest.approx(
        0.1 + 3.0 * 0.05 * math.pi + 0.01 + math.hypot(0.19 - INCH, 0.2 - INCH)
        + math.hypot(2.0 * math.pi * INCH, 3.0 * INCH - 0.1) + INCH
    )  # fmt: skip


@pytest.mark.parametrize(
    ("word", "radius", "centre", "turn"),
    [
        # From (0, 0) to (100, 0), 100 mm apart, on circles of 62.5 mm: the centre is 37.5 mm beside the chord.
        ("G3", 62.5, 37.5, 2.0 * math.asin(0.8)),
        ("G2", 62.5, -37.5, -2.0 * math.asin(0.8)),
        ("G3", -62.5, -37.5, 2.0 * math.pi - 2.0 * math.asin(0.8)),
        ("G2", -62.5, 37.5, 2.0 * math.asin(0.8) - 2.0 * math.pi),
    ],
)
def test_radii_and_centres_say_the_same(tmp_path, word, radius, centre, turn):
    for form in (f"R{radius}", f"I50 J{centre}"):
        (move,) = moves(tmp_path, f"G0 X0 Y0 Z0\n{word} X100 Y0 {form}")
        np.testing.assert_allclose(move.centre, [0.05, 0.001 * centre], atol=1e-15)
        assert move.angle == pytest.approx(turn, abs=1e-12)


def test_modes_and_the_start(tmp_path):
    assert moves(tmp_path, "G91 G1 X10 Z5", [1.0, 2.0, 3.0])[0].end == [1.01, 2.0, 3.005]
    first, second = moves(tmp_path, "G1 F60 X1 \n G0 X2 \n", [0.0, 0.0, 0.0])
    assert (first.speed, second.speed, second.end) == (0.001, INF, [0.002, 0.0, 0.0])
    (again,) = moves(tmp_path, "G1 X0 Y0 Z0 X0\nG1 X5\nG1 X5".replace(" X0\nG", "\nG", 1))
    assert again.line == 2 and again.speed == INF


def test_rounded_arcs_meet_their_ends(tmp_path):
    """Three decimals miss the circle: the arc still begins and ends where it should, without a stop behind a line."""
    text = "G0 X0 Y0 Z0\nG1 X10 Y10\nG3 X12.929 Y17.071 I-7.071 J7.071"
    line, arc = elements_of(moves(tmp_path, text))
    np.testing.assert_allclose(arc.end, [0.012929, 0.017071, 0.0], atol=1e-15)
    with pytest.raises(ConfigError, match="line 3: radius"):
        moves(tmp_path, text.replace("I-7.071", "I-7.171"))
    assert line.length == pytest.approx(0.01 * math.sqrt(2.0))


def test_a_tangent_arc_of_rounded_numbers_runs_on(tmp_path):
    along = np.array([12.345, 6.789])
    along /= np.linalg.norm(along)
    centre = 7.8 * np.array([-along[1], along[0]])
    (x, y), (i, j) = [12.345, 6.789] + centre + 7.8 * along, centre
    text = f"G0 X0 Y0 Z0\nG1 X12.345 Y6.789\nG3 X{x:.3f} Y{y:.3f} I{i:.3f} J{j:.3f}"
    assert len(position_paths_of(elements_of(moves(tmp_path, text)))) == 1
    assert len(position_paths_of(elements_of(moves(tmp_path, text.replace("Y0 Z0", "Y0.05 Z0"))))) == 2


@pytest.mark.parametrize(("unit", "decimals"), [("G21", 0), ("G21", 1), ("G21", 2), ("G20", 3), ("G20", 2)])
def test_arcs_of_any_decimals(tmp_path, unit, decimals):
    """Arcs of a program that rounds all its numbers: none is refused, and all are within a few units of theirs."""
    rng, scale = np.random.default_rng(7), 0.0254 if unit == "G20" else 0.001
    lines, arcs = [f"{unit} G90", f"G0 X{0.1**decimals:.{decimals}f} Y0 Z0"], []
    for _ in range(200):
        centre, radius = rng.uniform(-300.0, 300.0, 2), rng.uniform(20.0, 200.0)
        first = rng.uniform(-math.pi, math.pi)
        angle = rng.uniform(0.05, 6.2)
        start, end = (centre + radius * np.array([math.cos(a), math.sin(a)]) for a in (first, first + angle))
        (i, j), (x, y), (x0, y0) = centre - start, end, start
        lines += [f"G1 X{x0:.{decimals}f} Y{y0:.{decimals}f}"]
        lines += [f"G3 X{x:.{decimals}f} Y{y:.{decimals}f} I{i:.{decimals}f} J{j:.{decimals}f}"]
        arcs.append((start * scale, end * scale, radius * scale, angle))
    read = [move for move in moves(tmp_path, "\n".join(lines)) if move.centre is not None]
    assert len(read) == len(arcs)
    near = 5.0 * scale * 0.1**decimals
    for move, (start, end, radius, angle) in zip(read, arcs, strict=True):
        np.testing.assert_allclose([*move.start[:2], *move.end[:2]], [*start, *end], atol=near)
        assert math.dist(move.start[:2], move.centre) == pytest.approx(math.dist(move.end[:2], move.centre), rel=1e-9)
        assert move.angle == pytest.approx(angle, abs=20.0 * near / radius)


def test_a_thousandth_of_the_radius_is_rounding(tmp_path):
    text = "G0 X0.000 Y0.000 Z0.000\nG2 X1000.{}000 Y0.000 I500.000 J0.000"
    assert len(moves(tmp_path, text.format(4))) == 1
    with pytest.raises(ConfigError, match=r"must be above 0 and differ by at most 0\.0005 m"):
        moves(tmp_path, text.format(6))
    # The end of an arc that all but closes is rounded, and not its centre, which would be far away.
    (arc,) = moves(tmp_path, "G0 X0.00 Y0.00 Z0.00\nG3 X0.01 Y0.00 I50.00 J0.00")
    assert arc.centre == [0.05, 0.0] and abs(arc.angle) == pytest.approx(2.0 * math.pi)


def test_planes_are_those_of_turned_axes(tmp_path):
    """What G17 does to x, y and z, G18 does to z, x and y, and G19 to y, z and x."""
    text = "{} G0 {}0 {}0 {}10\nG3 {}100 {}20 {}50 {}50 {}10 F600\nG2 {}0 R80"
    plane = ("G17", *"XYZ", *"XYZ", *"IJ", "X")
    rotated = {
        "G18": (("G18", *"ZXY", *"ZXY", *"KI", "Z"), [1, 2, 0]),
        "G19": (("G19", *"YZX", *"YZX", *"JK", "Y"), [2, 0, 1]),
    }
    usual = elements_of(moves(tmp_path, text.format(*plane)))
    for words, order in rotated.values():
        others = elements_of(moves(tmp_path, text.format(*words)))
        for one, other in zip(usual, others, strict=True):
            middle = 0.5 * one.length
            assert other.length == pytest.approx(one.length, rel=1e-12)
            np.testing.assert_allclose(
                other.nodes(0.0, middle).position[-1], one.nodes(0.0, middle).position[-1][order], atol=1e-12
            )


@pytest.mark.parametrize(
    "text",
    [
        "G90.1\nG2 X100 I50 J0 F60",
        "N3 G02 X100. I+50.000 F60.0 ; a comment\nM30",
        "G92 X0 Y0\nG2 X100 I50 F60",
        "G92 X7 Y3 E0\nG2 X107 Y3 I50 F60",
        "G92 X7 Y3\nG90.1 G2 X107 Y3 I57 J3 F60",
        "G92 X7\nG92.1\nG2 X100 I50 F60",
        "G54 G64 P0.01 G40 G49 G80\nM3 S1000 F60 G2 X100 I50",
        "M201 X500 Y500 Z100 E5000\nM117 what (is shown\nM84 X Y E\nN7 G2 X100 I50 F60*71\n$H\nT1 D2",
        "M220 S50\nG2 X100 I50 F120",
        "G2 X100 I50 F60 E3.5\nG28 X0 Y0",
        "G91 G91.1\nG2 X100 I50 F60\n%\nno more",
    ],
)
def test_words_as_controllers_take_them(tmp_path, text):
    (arc,) = moves(tmp_path, f"%\nO0001 (name)\nG28\nG0 Z0\nG0 X0 Y0\n{text}")
    assert (arc.start, arc.end) == ([0.0, 0.0, 0.0], [pytest.approx(0.1), 0.0, 0.0])
    assert (arc.centre, arc.angle, arc.speed) == ([pytest.approx(0.05), 0.0], pytest.approx(-math.pi), 0.001)


SLICED = """; generated by a slicer (of any kind)
M140 S60
M104 S210
M82 ; extruder
G21
G28 ; home
G1 Z5 F3000
G92 E0
G1 X10 Y20 Z0.3 F1500
G1 X20 E1.5
G4 P500
M106 S255
G1 Y30 E3
G28 X0
"""


def test_what_is_skipped_is_counted(tmp_path):
    first, second = moves(tmp_path, SLICED)
    assert (first.start, first.ends_at_rest, first.feed) == ([0.01, 0.02, pytest.approx(0.0003)], True, "F1500")
    assert second.end == [0.02, 0.03, pytest.approx(0.0003)]
    # The motion stops for a pause although the corner could be blended.
    assert len(position_paths_of(elements_of([first, second]), "blend", 0.001)) == 2
    assert len(position_paths_of(elements_of([first._replace(ends_at_rest=False), second]), "blend", 0.001)) == 1
    skipped, *others = notes(tmp_path, SLICED)
    assert "9 words that change no path are skipped" in skipped
    for words in ("E (3 times)", "G28 (2 times)", "M140", "M104", "M82", "M106"):
        assert words in skipped
    assert others == [
        "a.nc: line 11: the motion stops for a pause, and does not wait there",
        "a.nc: the path begins in line 9, where X, Y and Z are known",
        "a.nc: the path ends before line 14, G28, whose place is not in the file",
    ]
    assert notes(tmp_path, PROGRAM) == []


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G0 X0 Y0 Z0\nG5 X1", "line 2: G5: must be written as G1, G2 and G3"),
        ("G81 X1", "line 1: G81: must be written as the G0 and G1"),
        ("G41 D1", "line 1: G41: must be left out"),
        ("G10 L20 P1 X0", "line 1: G10: must be left out"),
        ("G95", "line 1: G95: must be G94"),
        ("G77", "line 1: G77: must be one of G0 G1 G2 G3"),
        ("G" + "9" * 310 + " X1", "line 1: G999999999999999999999999...: must be one of G0"),
        ("M98 P1", "line 1: M98: must be left out: write out the moves"),
        ("G0 X0 Y0 Z0 A90", "line 1: A90: must be left out"),
        ("G54\nG0 X0 Y0 Z0\nG55", "line 3: G55: must be one system of coordinates"),
        ("G0 X0 Y0 Z0\nG1 X5\nG28\nG1 X7", "line 4: X7: must be absent behind line 3, G28"),
        ("G0 X0 Y0 Z0\nG1 X5\nG53 G0 Z0\nG1 X7", "line 4: X7: must be absent behind line 3, G53"),
        ("/G1 X1", 'line 1: "/G1 X1": must be kept or left out'),
        ("\n\nG1 X", 'line 3: "X": must be words that are read'),
        ("G1 X#1", 'line 1: "X#1": must be words that are read'),
        ("o100 call", "line 1: O100: must be one of G0"),
        ("(open G1 X1", 'line 1: "(open G1 X1": must be words that are read'),
        ("G0 X1 X2 Y0 Z0", "line 1: X2: must stand once in a line"),
        ("G0 G1 X1", "line 1: G1: must be one of its kind"),
        ("X1 Y1 Z1", "line 1: X: must stand behind G0, G1, G2 or G3"),
        ("G0 X1 Y1\nG1 X2", "no move: Z: must be given, absolute: the path begins where X, Y and Z are known"),
        ("G91 G0 X1 Y1 Z1", "no move: X and Y and Z: must be given, absolute"),
        ("G2 X1 Y1 Z1 I1", "line 1: G2: must follow a place"),
        ("G0 X0 Y0 Z0 I1", "line 1: I: must be absent unless G2 or G3 is on"),
        ("G0 X0 Y0 Z0\nG2 X1", "line 2: G2: must have I or J, from the start to the centre, or R"),
        ("G0 X0 Y0 Z0\nG18 G2 X1", "line 2: G2: must have K or I, from the start to the centre, or R"),
        ("G0 X0 Y0 Z0\nG18 G2 X1 J1", "line 2: J: must be K or I in this plane"),
        ("G0 X0 Y0 Z0\nG90.1 G2 X1 I1", "line 2: J: must be given where G90.1 makes centres absolute"),
        ("G0 X0 Y0 Z0\nG2 X1 I1 P2", "line 2: P2: must be absent of arcs"),
        ("G0 X0 Y0 Z0\nG2 X1 R1 I1", "line 2: G2: must have I or J, from the start to the centre, or R"),
        ("G0 X0 Y0 Z0\nG2 R1", "line 2: R: must be I or J where an arc ends above or at its start"),
        ("G0 X0 Y0 Z0\nG2 X100 R40", "line 2: R: must be at least half of the distance, 0.05 m"),
        ("G0 X0 Y0 Z0\nG2 X100 I40", "line 2: radius 0.04 m at the start, 0.06 m at the end: must be above 0"),
        ("G0 X0 Y0 Z0\nG2 X100 I0", "line 2: radius 0 m at the start"),
        ("G0 X0 Y0 Z0\nG1 X1 F0", "line 2: F0: must be a speed from 1e-09 to 1e+09 m/s"),
        ("G0 X0 Y0 Z0\nG1 X1 F" + "1" * 400, "line 2: F111111111111111111111111...: must be a speed"),
        ("G0 X0 Y0 Z0\nM220 S0", "line 2: M220 S0: must be above 0"),
        # An exponent would be read as an extruder's axis.
        ("G0 X0 Y0 Z0\nG1 X1e9", 'line 2: "X1e9": must be numbers without an exponent'),
        ("G0 X0 Y0 Z0\nG1 X1E-05 Y2", 'line 2: "X1E-05 Y2": must be numbers without an exponent'),
        ("G0 X0 Y0 Z0\nG1 X1" + "0" * 12, "line 2: X1000000000000: must be at most 1e+06 m"),
        ("G0 X0 Y0 Z0\nM2\nG1 X1", "no move: must have two places at least"),
        ("G0 X0 Y0 Z0", "no move: must have two places at least"),
        ("", "no move: X and Y and Z: must be given"),
    ],
)
def test_what_is_not_read(tmp_path, text, line):
    with pytest.raises(ConfigError) as caught:
        moves(tmp_path, text)
    assert f"a.nc: {line}" in str(caught.value) and "\n" not in str(caught.value)
