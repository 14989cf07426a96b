"""G-code against moves worked out by hand; what is not read is refused with its line."""

import itertools
import math

import numpy as np
import pytest

from cspr_jax.config.gcode import read_moves
from cspr_jax.errors import ConfigError
from cspr_jax.paths.corners import tracks_of
from cspr_jax.paths.shapes import elements_of

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
    return read_moves(path, start)


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
    assert len(tracks_of(elements_of(moves(tmp_path, text)))) == 1
    assert len(tracks_of(elements_of(moves(tmp_path, text.replace("Y0 Z0", "Y0.05 Z0"))))) == 2


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G0 X0 Y0 Z0\nG4 P1", "line 2: G4: must be one of G0 G1 G2 G3 G17 G20 G21 G90 G91"),
        ("G18", "line 1: G18: must be one of"),
        ("G90.1", "line 1: G90.1: must be one of"),
        ("G0 X0 Y0 Z0\nM3 S100", "line 2: M3: must be one of"),
        ("G0 X0 Y0 Z0\nT1", "line 2: T1: must be one of"),
        ("G0 X0 Y0 Z0 A90", "line 1: A90: must be one of"),
        ("\n\nG1 X", 'line 3: "X": must be words that are read'),
        ("G1 X#1", 'line 1: "X#1": must be words that are read'),
        ("(open G1 X1", 'line 1: "(open G1 X1": must be words that are read'),
        ("G0 X1 X2 Y0 Z0", "line 1: X2: must stand once in a line"),
        ("G0 G1 X1", "line 1: G1: must be one of its kind"),
        ("X1 Y1 Z1", "line 1: X: must stand behind G0, G1, G2 or G3"),
        ("G0 X1 Y1", "line 1: Z: must have X, Y and Z, absolute, in the first move"),
        ("G91 G0 X1 Y1 Z1", "line 1: G91: must have X, Y and Z, absolute, in the first move"),
        ("G2 X1 Y1 Z1 I1", "line 1: G2: must follow a place"),
        ("G0 X0 Y0 Z0 I1", "line 1: I: must be absent unless G2 or G3 is on"),
        ("G0 X0 Y0 Z0\nG2 X1", "line 2: G2: must have I or J, from the start to the centre, or R"),
        ("G0 X0 Y0 Z0\nG2 X1 R1 I1", "line 2: G2: must have I or J, from the start to the centre, or R"),
        ("G0 X0 Y0 Z0\nG2 R1", "line 2: R: must be I or J where an arc ends above or at its start"),
        ("G0 X0 Y0 Z0\nG2 X100 R40", "line 2: R: must be at least half of the distance, 0.05 m"),
        ("G0 X0 Y0 Z0\nG2 X100 I40", "line 2: radius 0.04 m at the start, 0.06 m at the end: must be above 0"),
        ("G0 X0 Y0 Z0\nG2 X100 I0", "line 2: radius 0 m at the start"),
        ("G0 X0 Y0 Z0\nG1 X1 F0", "line 2: F0: must be above 0"),
        ("G0 X0 Y0 Z0\nG1 X1e9", "line 2: E9: must be one of"),
        ("G0 X0 Y0 Z0\nG1 X1" + "0" * 12, "line 2: X1e+12: must be at most 1e+06 m"),
        ("G0 X0 Y0 Z0\nM2\nG1 X1", "no move: must have two places at least"),
        ("", "no move: must have two places at least"),
    ],
)
def test_what_is_not_read(tmp_path, text, line):
    with pytest.raises(ConfigError) as caught:
        moves(tmp_path, text)
    assert f"a.nc: {line}" in str(caught.value) and "\n" not in str(caught.value)
