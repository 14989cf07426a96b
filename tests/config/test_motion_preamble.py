"""What stands above the rows of a table: names and units wherever people write them, and what contradicts the rows."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cspr_jax.config.motions import text
from cspr_jax.config.motions.preamble import LARGEST_COMMENTS, MAX_COLUMNS, Preamble
from cspr_jax.errors import ConfigError

ROWS = "0,1,2,3\n1,2,3,5\n2,4,4,6\n"
BLANKS = ROWS.replace(",", " ")
TUM = "0 1 2 3 0 0 0 1\n1 2 3 4 0 0 0.6 0.8\n"


def read(folder, content, **settings):
    path = folder / "own.csv"
    path.write_bytes(content.encode())
    return text.read(path, **settings)


def same(found, expected):
    np.testing.assert_allclose(found.times - found.times[0], expected.times - expected.times[0], rtol=1e-12)
    np.testing.assert_allclose(found.positions, expected.positions, rtol=1e-12)


@pytest.mark.parametrize(
    "content",
    [
        "# t,y,x,z\n" + ROWS,
        "#t,y,x,z\n" + BLANKS,
        "% t y x z\n" + ROWS,
        "# t;y;x;z\n" + ROWS,
        "# t\ty\tx\tz\n" + BLANKS,
        "# t | y | x | z\n" + BLANKS,
        "## T, Y, X, Z\n" + ROWS,
        "# made on Friday by x\n#\n# t,y,x,z\n# x is east, z is down\n# 4 5 6 7\n\n" + ROWS,
        "# t,x,y,z\n# t,y,x,z\n" + ROWS,
        "# columns: t, y, x, z\n" + ROWS,
        "# fields = t y x z\n" + BLANKS,
        "# ['t', 'y', 'x', 'z']\n" + ROWS,
        "# t s, y m, x m, z m\n" + ROWS,
        "# t (s) y (m) x (m) z (m)\n" + BLANKS,
        "# t [ms], y [mm], x [m], z [m]\n# s, m, m, m\nt,y,x,z\n" + ROWS,
        "# timestamp ty tx tz\n" + BLANKS,
        "# Time [s], pose.position.y, pose.position.x, pose.position.z\n" + ROWS,
        "#,t,y,x,z\n" + "".join(f"{k},{row}\n" for k, row in enumerate(ROWS.splitlines())),
        ",t,y,x,z\n" + "".join(f"{k},{row}\n" for k, row in enumerate(ROWS.splitlines())),
        '"# t,y,x,z",,,\n' + ROWS,
        "t, y, x, z\n" + BLANKS,
        "% t y x z name\n" + "".join(f"{row} here\n" for row in BLANKS.splitlines()),
    ],
)
def test_names_above_the_rows(tmp_path, content):
    found = read(tmp_path, content)
    np.testing.assert_array_equal(found.times, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(found.positions, [[2.0, 1.0, 3.0], [3.0, 2.0, 5.0], [4.0, 4.0, 6.0]])
    assert not [line for line in found.notes if "taken" in line or "hint" in line]


@pytest.mark.parametrize(
    "content",
    [
        "# t [ms], x [mm], y [mm], z [mm]\n" + ROWS,
        "# t, x, y, z\n# ms, mm, mm, mm\n" + ROWS,
        "# t x y z\n# [ms] [mm] [mm] [mm]\n" + BLANKS,
        "# t, x, y, z\n# milliseconds, millimetres, millimeters, mm\n" + ROWS,
        "t,x,y,z\n# ms,mm,mm,mm\n" + ROWS,
        "t,x,y,z\nms,mm,mm,mm\n" + ROWS,
        "t;x;y;z\n[ms];(mm);[mm];[mm]\n" + ROWS.replace(",", ";"),
        "t,x,y,z\n# units: ms, mm\n" + ROWS,
        "# unit: ms mm\n" + ROWS,
        "# t [ms], z [mm], y [mm], x [mm]\nt,x,y,z\n" + ROWS,
        "t/ms,x/mm,y / mm,z in mm\n" + ROWS,
        "Zeit [ms],X [mm],Y [mm],Z [mm]\n" + ROWS,
        "Dauer [ms],Pos. X (mm),Pos. Y (mm),Pos. Z (mm)\n" + ROWS,
        "Dauer [ms],Breite [mm],Tiefe [mm],Hoehe [mm]\n" + ROWS,
        "% t_ms x_mm y_mm z_mm\n" + BLANKS,
    ],
)
def test_units_above_the_rows(tmp_path, content):
    found = read(tmp_path, content)
    np.testing.assert_allclose(found.times, [0.0, 0.001, 0.002], rtol=1e-15)
    np.testing.assert_allclose(found.positions[1], [0.002, 0.003, 0.005], rtol=1e-15)
    assert len(found.notes) == ("Dauer" in content or content.startswith("# unit:"))


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("# t,y,x,height\n" + ROWS, "line 1: a comment speaks of columns t, y, x"),
        ("# 1: t\n# 2: y\n# 3: x\n# 4: z\n" + ROWS, "line 1: a comment speaks of columns t, y, x, z"),
        ("# columns are t, y, x and z\n" + ROWS, "which would be taken as t, x, y, z: must be a line with a name"),
        ("# t y x z\n" + TUM, "a comment speaks of columns t, y, x, z"),
        ("# x y z qx qy qz qw\n" + TUM, "a comment speaks of columns x, y, z, qx, qy, qz, qw"),
        ("# t in ms, positions in mm\n" + ROWS, "line 1: a comment speaks of ms"),
        ("# positions are millimetres\n" + ROWS, "must say units as # units: mm, or behind names, as x [mm]"),
        ("# t tx ty tz qx qy qz\n0 1 2 3 0 0 0\n1 1 2 3 0 0 0\n", "line 1: no column qw"),
        ("a,b,c,d\n" + ROWS, 'found "a", "b", "c", "d", which would have to be called t, x, y, z'),
        ("t [s],L1 [m],L2 [m],L3 [m]\n" + ROWS, "line 1: no column x: must have x, y, z"),
        ("t [ms],x,y,z\ns,m,m,m\n" + ROWS, 'units "ms" and "s": must be one'),
        (",".join("t" * (MAX_COLUMNS + 1)) + "\n", f"line 1: {MAX_COLUMNS + 1} columns: must be at most"),
        (",".join("1" * (MAX_COLUMNS + 1)) + "\n", f"line 1: {MAX_COLUMNS + 1} columns: must be at most"),
        ("# of nothing\n" * (LARGEST_COMMENTS // 11) + ROWS, "letters of comments: must be above fewer"),
    ],
)
def test_what_contradicts_the_rows_is_refused(tmp_path, content, line):
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, content)
    assert line in str(caught.value) and "\n" not in str(caught.value)


def test_how_unnamed_columns_are_taken_is_said(tmp_path):
    note = "no line names its columns: taken as t [s], x [m], y [m], z [m]"
    assert read(tmp_path, ROWS).notes == read(tmp_path, "# measured by john today\n" + ROWS).notes == (note,)
    assert read(tmp_path, "# x and y swapped\n" + ROWS).notes[1] == (
        'line 1: hint: a comment speaks of x, y: "x and y swapped"'
    )
    lines = read(tmp_path, TUM).notes
    assert lines[0] == note + ", qw, qx, qy, qz (scalar first)"
    assert lines[1].startswith("hint: the last column looks like the scalar part of quaternions") and len(lines) == 2
    assert len(read(tmp_path, "0 1 2 3 1 0 0 0\n1 2 3 4 0.8 0 0 0.6\n").notes) == 1
    assert read(tmp_path, "# units: mm\n" + ROWS).notes[0].endswith("t [s], x [mm], y [mm], z [mm]")
    assert "a comment speaks of ms, but columns" in read(tmp_path, "# times in ms\nt,x,y,z\n" + ROWS).notes[0]


def test_points_of_paths(tmp_path):
    points = "1,2,3\n2,3,5\n4,4,6\n"
    found = read(tmp_path, "# y [mm], x [mm], z [mm]\n" + points, has_times=False)
    np.testing.assert_allclose(found.positions[0], [0.002, 0.001, 0.003], rtol=1e-15)
    assert found.notes == ()
    assert read(tmp_path, points, has_times=False).notes == ("no line names its columns: taken as x [m], y [m], z [m]",)
    with pytest.raises(ConfigError, match="a comment speaks of columns z, y, x"):
        read(tmp_path, "# first z, then y, then x\n" + points, has_times=False)


@settings(deadline=None, max_examples=60)
@given(
    order=st.permutations(["t", "x", "y", "z", "qw", "qx", "qy", "qz", "load"]),
    unit=st.sampled_from(["m", "mm", "cm"]),
    time=st.sampled_from(["s", "ms", "us", "min"]),
    style=st.sampled_from(["{} [{}]", "{} ({})", "{}[{}]", "{}_{}"]),
    inside=st.sampled_from([",", ", ", "; ", "\t", " "]),
    between=st.sampled_from([",", ";", " ", "\t"]),
    comments=st.sampled_from(["# ", "#", "% "]),
    below=st.sampled_from(["", "\ncalibrated yesterday", "\n\n2026-11-27 run 4 of 7"]),
    case=st.sampled_from([str, str.upper, str.capitalize]),
)
def test_what_savetxt_writes_is_the_named_table(
    tmp_path_factory, order, unit, time, style, inside, between, comments, below, case
):
    """Any order of columns, in any units, with any separators, is the motion of the plain table with a header."""
    folder, rng = tmp_path_factory.getbasetemp(), np.random.default_rng(1)
    turning = rng.normal(size=(4, 5))
    turning /= np.linalg.norm(turning, axis=0)
    values = dict(zip(["t", "x", "y", "z", "load"], [np.arange(5.0), *rng.normal(size=(4, 5))], strict=True))
    values |= dict(zip(["qw", "qx", "qy", "qz"], turning, strict=True))
    plain = ["t", "x", "y", "z", "qw", "qx", "qy", "qz"]
    np.savetxt(
        folder / "plain.csv", np.stack([values[k] for k in plain], 1), "%.17g", ",", header=",".join(plain), comments=""
    )
    units = {"t": time} | dict.fromkeys("xyz", unit)
    factors = {"s": 1.0, "ms": 1e3, "us": 1e6, "min": 1.0 / 60.0, "m": 1.0, "mm": 1e3, "cm": 1e2}
    heads = [case(style.format(name, units[name]) if name in units else name) for name in order]
    table = np.stack([values[name] * factors[units.get(name, "m")] for name in order], axis=1)
    header = "my own motion\n" + inside.join(heads) + below
    np.savetxt(folder / "saved.csv", table, "%.17g", between, header=header, comments=comments)
    found, expected = text.read(folder / "saved.csv"), text.read(folder / "plain.csv")
    same(found, expected)
    np.testing.assert_allclose(found.quaternions, expected.quaternions, atol=1e-12)
    assert [line.split(" is not read")[0] for line in found.notes] == [f'column "{case("load")}"']


def test_orders_of_four(tmp_path):
    for order in itertools.permutations("txyz"):
        rows = np.array([[0.0, 1.0, 2.0, 3.0], [1.0, 5.0, 7.0, 9.0]])[:, ["txyz".index(name) for name in order]]
        np.savetxt(tmp_path / "own.csv", rows, header=" ".join(order))
        found = text.read(tmp_path / "own.csv")
        np.testing.assert_array_equal(found.positions, [[1.0, 2.0, 3.0], [5.0, 7.0, 9.0]])


def test_scalar_last_by_name(tmp_path):
    found = read(tmp_path, "# timestamp tx ty tz qx qy qz qw\n" + TUM)
    np.testing.assert_allclose(found.quaternions, [[1.0, 0.0, 0.0, 0.0], [0.8, 0.0, 0.0, 0.6]])
    assert found.notes == ()


STAMPS = [1403636579763555584, 1403636579803555585, 1403636579843555589]


@pytest.mark.parametrize(
    ("head", "digits", "notes"),
    [
        ("t", 0, 1),
        ("t [ns]", 0, 0),
        ("t_ns", 0, 0),
        ("timestamp", 0, 1),
        ("#timestamp [ns]", 0, 0),
        ("t", 3, 1),
        ("t", 6, 1),
    ],
)
def test_stamps_of_many_digits_lose_none(tmp_path, head, digits, notes):
    """Times since 1970 are read as integers: floats hold them to some hundred ns at best."""
    stamps = [stamp // 10**digits for stamp in STAMPS]
    found = read(tmp_path, f"{head},x,y,z\n" + "".join(f"{stamp},1,2,3\n" for stamp in stamps))
    expected = [(stamp - stamps[0]) * 10.0 ** (digits - 9) for stamp in stamps]
    np.testing.assert_allclose(found.times - found.times[0], expected, rtol=0.0, atol=1e-15)
    assert len(found.notes) == notes
    with pytest.raises(ConfigError, match=f"t = {stamps[1]}.*: times repeat"):
        read(tmp_path, f"{head},x,y,z\n" + f"{stamps[0]},1,2,3\n" + f"{stamps[1]},1,2,3\n" * 2)


def test_stamps_with_decimals_lose_none(tmp_path):
    rows = "1311875813.740000010 1 2 3\n1311875813.740000017 1 2 3\n"
    found = read(tmp_path, "# timestamp tx ty tz\n" + rows)
    np.testing.assert_allclose(np.diff(found.times), 7e-9, rtol=1e-6)


@pytest.mark.parametrize("step", [1e-9, 1e-7, 1e-5, 1e-4])
@pytest.mark.parametrize("start", [0.0, 1311875813.0])
def test_stamps_that_nearly_repeat_are_told(tmp_path, step, start):
    times = np.sort(np.append(np.arange(20) * 0.05, 0.35 + step))
    rows = "".join(f"{start:.0f}{f'{t:.12f}'[1:]}\n" for t in times)
    content = "t,x,y,z\n" + rows.replace("\n", ",1,2,3\n")
    (line,) = read(tmp_path, content).notes
    assert line.startswith("line 10: hint: t = ") and "nearly repeats" in line
    assert float(line.split("the step is ")[1].split()[0]) == pytest.approx(0.05 / step, rel=0.02)
    assert read(tmp_path, "t,x,y,z\n" + "".join(f"{0.05 * k**1.5},1,2,3\n" for k in range(20))).notes == ()


@pytest.mark.parametrize("mark", [";", ",", "\t"])
def test_what_spreadsheets_add(tmp_path, mark):
    sheet = f"\ufeffsep={mark}\nt,x,y,z\n{ROWS},,,\n,,,\n".replace(",", mark).replace("\n", "\r\n")
    same(read(tmp_path, sheet), read(tmp_path, "t,x,y,z\n" + ROWS))
    padded = "t,x,y,z,,\n" + ROWS.replace("\n", ",,\n") + ",,,,,\n"
    same(read(tmp_path, padded.replace(",", mark)), read(tmp_path, "t,x,y,z\n" + ROWS))
    tails = "t,x,y,z\n" + ROWS.replace("\n", ",\n")
    same(read(tmp_path, tails.replace(",", mark)), read(tmp_path, "t,x,y,z\n" + ROWS))
    with pytest.raises(ConfigError, match="z = "):
        read(tmp_path, "t,x,y,z\n0,1,2,\n1,2,3,\n".replace(",", mark))
    noted = 't,x,y,z,note\n0,1,2,3,"a,b"\n1,2,3,5,7\n2,4,4,6,n/a\n'
    same(read(tmp_path, noted), read(tmp_path, "t,x,y,z\n" + ROWS))


def test_columns_that_are_not_read_are_told_in_a_few_lines(tmp_path):
    heads, zeros = ",".join(f"c{k}" for k in range(900)), ",".join("0" * 900)
    lines = read(tmp_path, f"t,x,y,z,{heads}\n0,1,2,3,{zeros}\n1,2,3,5,{zeros}\n").notes
    assert len(lines) == 6 and lines[-1] == "895 more columns are not read"


def test_comments_and_blank_lines_come_block_by_block(tmp_path, monkeypatch):
    """Each line above the rows is looked at once, however many blocks they fill."""
    taken, takes = [], Preamble.takes
    monkeypatch.setattr(text, "BLOCK", 7)
    monkeypatch.setattr(Preamble, "takes", lambda self, line, row: taken.append(row) or takes(self, line, row))
    above = "# t,y,x,z\n" + "\n" * 500 + "# of an engine\n" * 500
    same(read(tmp_path, above + ROWS), read(tmp_path, "t,y,x,z\n" + ROWS))
    assert len(taken) < 1.5 * above.count("\n")
