"""Tables of motions: names, units, separators, windows, and one line for each fault."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cspr_jax.config.motions import text
from cspr_jax.config.motions.table import MotionTable, unit_hints
from cspr_jax.errors import ConfigError, InputError

PLAIN = "t,x,y,z\n0,1,2,3\n1,2,3,4\n"


def table(folder, content, encoding="utf-8"):
    path = folder / "own.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return text.read(path)


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.removeprefix("t,x,y,z\n"),
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", " "),
        PLAIN.replace(",", " , "),
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        "\ufeff" + PLAIN,
        PLAIN.rstrip("\n"),
        "# by me\n\n" + PLAIN.replace("\n1", "\n# half way\n\n1") + "# end\n",
        PLAIN.replace("\n", ",\n"),
        '"t","x","y","z"\n"0","1","2","3"\n1,2,3,4\n',
        "Time [s],X,position_y,z (m)\n0,1,2,3\n1,2,3,4\n",
        "z;t;y;x\n3,0;0,0;2,0;1,0\n4,0;1;3;2e0\n",
        "t_ms,x [mm],y (cm),z_mm\n0,1000,200,3000\n1000,2000,300,4000\n",
        "# units: ms, mm\nt,x,y,z [m]\n0,1000,2000,3\n1000,2000,3000,4\n",
        "t,x,y,z,when,tension_1\n0,1,2,3,noon,7\n1,2,3,4,later,8\n",
    ],
)
def test_one_table_in_many_forms(tmp_path, content):
    found = table(tmp_path, content)
    np.testing.assert_array_equal(found.times, [0.0, 1.0])
    np.testing.assert_allclose(found.positions, [[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]], rtol=1e-15)
    assert found.quaternions is None and found.velocities is None and found.interpolation is None
    assert not found.is_planar
    assert len(found.notes) == ("when" in content or content[0] == "0")


def test_directives_rates_and_planar_robots(tmp_path):
    head = "# interpolation: quintic\n#ends: periodic\n# z_axis: up\n"
    found = table(
        tmp_path, head + "t,x,z,pitch,vx [mm/s],vz [m/s],ax [cm/s^2],az\n0,1,2,0.5,1,2,3,4\n1,1,2,0,1,2,3,4\n"
    )
    assert (found.interpolation, found.ends, found.z_axis) == ("quintic", "periodic", "up") and found.is_planar
    np.testing.assert_array_equal(found.positions, [[1.0, 0.0, 2.0]] * 2)
    np.testing.assert_allclose(found.velocities, [[0.001, 0.0, 2.0]] * 2, rtol=1e-15)
    np.testing.assert_allclose(found.accelerations, [[0.03, 0.0, 4.0]] * 2, rtol=1e-15)
    np.testing.assert_allclose(found.quaternions[0], [np.cos(0.25), 0.0, np.sin(0.25), 0.0], atol=1e-15)
    np.testing.assert_allclose(found.in_axes("down").positions, [[1.0, 0.0, -2.0]] * 2)
    rotated = found.in_axes("down")
    half = Rotation.from_rotvec([np.pi, 0.0, 0.0])
    expected = half * Rotation.from_quat(found.quaternions, scalar_first=True) * half.inv()
    away = expected.inv() * Rotation.from_quat(rotated.quaternions, scalar_first=True)
    assert away.magnitude().max() < 1e-12 and rotated.z_axis == "down"
    assert found.in_axes("up") is found
    with pytest.raises(InputError, match='z_axis = "north": must be "down" or "up"'):
        found.in_axes("north")


def test_units_of_rates(tmp_path):
    """Without a unit of its own, a rate is in the lengths and times that the file names."""
    rows = "0,1,2,3,4,5,6,7\n1,1,2,3,4,5,6,7\n"
    found = table(tmp_path, "# units: mm, ms\nt,x,z,vx,vz,ax [m/s^2],az,other\n" + rows)
    np.testing.assert_allclose(found.velocities[0], [3.0, 0.0, 4.0], rtol=1e-15)
    np.testing.assert_allclose(found.accelerations[0], [5.0, 0.0, 6000.0], rtol=1e-15)
    found = table(tmp_path, "t,x,z,vx [mm/ms],vz [cm/min],ax [m/min2],az [km/s²],other\n" + rows)
    np.testing.assert_allclose(found.velocities[0], [3.0, 0.0, 0.04 / 60.0], rtol=1e-15)
    np.testing.assert_allclose(found.accelerations[0], [5.0 / 3600.0, 0.0, 6000.0], rtol=1e-15)


def test_units_of_angular_rates(tmp_path):
    head = "# units: mm, ms\nt,x,y,z,qw,qx,qy,qz,wx,wy [deg/s],wz [deg/min],wdx,wdy [deg/s^2],wdz [deg/min^2]\n"
    found = table(tmp_path, head + "0,1,2,3,1,0,0,0,4,5,6,7,8,9\n1,1,2,3,1,0,0,0,4,5,6,7,8,9\n")
    degree = np.pi / 180.0
    np.testing.assert_allclose(found.angular_velocities[0], [4000.0, 5.0 * degree, 0.1 * degree], rtol=1e-14)
    np.testing.assert_allclose(found.angular_accelerations[0], [7e6, 8.0 * degree, 0.0025 * degree], rtol=1e-14)


def test_angles(tmp_path):
    """R = Rz(yaw) Ry(pitch) Rx(roll), and Z_phi X_theta Z_(sigma - phi)."""
    turns = {axis: lambda angle, axis=axis: Rotation.from_euler(axis, angle, degrees=True) for axis in "XYZ"}
    head = "# units: deg\nt,x,y,z,roll,pitch,yaw\n"
    found = table(tmp_path, head + "0,1,2,3,10,20,30\n1,1,2,3,-170,80,400\n")
    expected = [turns["Z"](c) * turns["Y"](b) * turns["X"](a) for a, b, c in ((10, 20, 30), (-170, 80, 400))]
    for quaternion, rotation in zip(found.quaternions, expected, strict=True):
        assert (Rotation.from_quat(quaternion, scalar_first=True).inv() * rotation).magnitude() < 1e-12
    assert len(found.notes) == 1 and "are they degrees" in found.notes[0]
    found = table(
        tmp_path, "t,x,y,z,tilt_phi [deg],tilt_theta [deg],tilt_sigma [deg]\n0,1,2,3,40,25,70\n1,1,2,3,0,0,0\n"
    )
    rotation = turns["Z"](40) * turns["X"](25) * turns["Z"](30)
    assert (Rotation.from_quat(found.quaternions[0], scalar_first=True).inv() * rotation).magnitude() < 1e-12


def test_quaternions_are_normalised(tmp_path):
    found = table(tmp_path, "t,x,y,z,qw,qx,qy,qz\n0,1,2,3,1.1,0,0,0\n1,2,3,4,0,0,-0.9,0\n")
    np.testing.assert_array_equal(found.quaternions, [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]])
    assert found.notes == ("quaternions of lengths other than 1 are normalised",)
    (line,) = table(tmp_path, "0,1,2,3,1,0,0,0\n1,2,3,4,0,0,-1,0\n").notes
    assert line.startswith("no line names its columns: taken as t [s], x [m], y [m], z [m], qw, qx, qy, qz (scalar")


FAULTS = [
    ("t,x,y,z\n0,1,2,3\n1,2,3\n2,3,4,5,6\n", "line 3: 3 values: must be 4, as in the header"),
    ("t,x,y,z\n0,1,2\n1,2,3\n", "line 2: 3 values: must be 4"),
    ("t,x,y,z\n# c\n0,1,2,3\n1,2,a,3\n", 'line 4, column 3: y = "a": must be a finite number'),
    ("t,x,y,z\n0,1,2,3\n1,2,NaN,3\n", 'line 3, column 3: y = "NaN": must be a finite number'),
    ("t,x,y,z\n0,1,2,3\n1,-inf,2,3\n", 'line 3, column 2: x = "-inf": must be a finite number'),
    ("t,x,y,z\n0,1,2,3\n1,1e99,2,3\n", 'line 3, column 2: x = "1e99": must be a finite number'),
    ("t,x,y,z\n0,1,2,3\n1,,2,3\n", 'line 3, column 2: x = "": must be a finite number'),
    ("t,x,y,z\n0,1_0,2,3\n1,1,2,3\n", 'line 2, column 2: x = "1_0": must be a finite number'),
    ("nan,1,2,3\n1,1,2,3\n", 'line 1, column 1: t = "nan": must be a finite number'),
    ("t,x,y,z\n0,1,2,3\n\n0,3,4,5\n", "line 4: t = 0.0: times repeat: must be more than 0.0, the time before it"),
    ("t,x,y,z\n0,1,2,3\n1,2,3,4\n0.5,3,4,5\n", "line 4: t = 0.5: rows are out of order: must be more than 1.0"),
    ("t,x,y\n0,1,2\n1,2,3\n", "line 1: no column z: must have x, y, z"),
    ("time,x,z,vx\n0,1,2,3\n", "line 1: no column vz: must have vx, vy, vz"),
    ("x,y,z\n1,2,3\n", "line 1: no column t"),
    ("t,x,y,zz\n0,1,2,3\n", "line 1: no column z"),
    ("t,x,y,z,x\n0,1,2,3,1\n", 'line 1, column 5: "x" stands twice'),
    ("t,x,y,z,qw,qx,qy,qz,roll,pitch,yaw\n", "columns qw and roll: must be one orientation"),
    ("t,x,y,z,ax,ay,az\n", "column ax without vx"),
    ("t,x,y,z,wx,wy,wz\n", "line 1: columns of angular rates: must be beside an orientation"),
    ("t,x,y,z\n0,1,2,3\n1,2,\uff12,3\n", 'line 3, column 3: y = "\uff12": must be a finite number'),
    ("t,x,y,z [inch]\n", 'line 1, column 4: unit of z = "inch": must be "m", "dm"'),
    ("t,x,y,z,vx [m],vy,vz\n", 'unit of vx = "m": must be "m/s", "dm/s"'),
    ("# units: mm, cm\nt,x,y,z\n", 'units = "cm": must be one of a kind, not mm too'),
    ("t x y z\n0 1 2 3\n1 2,5 3 4\n", 'line 3, column 2: x = "2,5": must be a finite number, without a comma'),
    ("# units: furlong\nt,x,y,z\n", 'units = "furlong": must be "m"'),
    ("# interpolation: quintc\nt,x,y,z\n", 'line 1: interpolation = "quintc": did you mean quintic? must be'),
    ("1,2,3,4,5\n1,2,3,4,5\n", "line 1: 5 columns without a header: must be 3, 4, 8"),
    (
        "t,x,y,z,qw,qx,qy,qz\n0,1,2,1,1,0,0,0\n1,2,3,1,0,0,0,0\n",
        "line 3: qw, qx, qy, qz = [0.0, 0.0, 0.0, 0.0]: must be",
    ),
    (
        "t,x,y,z,qw,qx,qy,qz\n0,1,2,1,3,0,0,0\n1,2,3,1,1,0,0,0\n",
        "line 2: qw, qx, qy, qz = [3.0, 0.0, 0.0, 0.0]: must be",
    ),
    ("", "0 rows: must be two or more"),
    ("# nothing\n", "0 rows: must be two or more"),
    ("t,x,y,z\n", "0 rows: must be two or more"),
    ("t,x,y,z\n0,1,2,3\n", "1 rows: must be two or more"),
    (PLAIN.encode("utf-16"), "is UTF-16 text: save it as UTF-8"),
    (b"t,x,y,z \xb5\n", "is not UTF-8 text: byte 0xB5 in line 1"),
    (b"t,x,y,z\n0,0,\0,0\n", "byte 0x00 in line 2: must be a table of text"),
    (b"\x89HDF\r\n\x1a\n", "is not a table of text"),
    (b"7" * 200_000, "line 1 has more than 65536 bytes"),
]


@pytest.mark.parametrize(("content", "line"), FAULTS)
def test_faults(tmp_path, content, line):
    with pytest.raises(ConfigError) as caught:
        table(tmp_path, content)
    assert line in str(caught.value) and "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "own.csv"))


@pytest.mark.parametrize(("content", "line"), FAULTS)
def test_faults_in_later_blocks(tmp_path, monkeypatch, content, line):
    """The line is counted from the start of the file, whatever is read at a time."""
    monkeypatch.setattr(text, "BLOCK", 4)
    test_faults(tmp_path, content, line)


def test_missing_files(tmp_path):
    for path, line in ((tmp_path / "gone.csv", "cannot be read"), (tmp_path, "is not a file")):
        with pytest.raises(ConfigError, match=line):
            text.read(path)


def test_unknown_columns_are_told(tmp_path):
    found = table(tmp_path, "t,x,y,z,rol\n0,1,2,3,1\n1,2,3,4,1\n")
    assert 'column "rol" is not read: did you mean roll? known: t, x' in found.notes[0]


finite = st.floats(-1e6, 1e6, allow_nan=False)


@settings(deadline=None, max_examples=60)
@given(
    rows=st.lists(st.lists(finite, min_size=3, max_size=3), min_size=2, max_size=40),
    steps=st.floats(1e-6, 10.0),
    separator=st.sampled_from([",", ";", "\t", " "]),
    ending=st.sampled_from(["\n", "\r\n"]),
    block=st.integers(3, 200),
)
def test_round_trip(tmp_path_factory, rows, steps, separator, ending, block):
    """Every number comes back as it was, whatever is read at a time."""
    values = np.column_stack([np.arange(len(rows)) * steps, rows])
    lines = [separator.join(map(repr, row)) for row in values.tolist()]
    if separator in ";\t":
        lines = [line.replace(".", ",") for line in lines]
    path = tmp_path_factory.getbasetemp() / "round.csv"
    path.write_bytes(ending.join([separator.join("txyz"), *lines]).encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text, "BLOCK", block)
        found = text.read(path)
    np.testing.assert_array_equal(found.times, values[:, 0])
    np.testing.assert_array_equal(found.positions, values[:, 1:])


@pytest.mark.parametrize("count", [2, 301, 401, 402, 403, 602, 999])
def test_windows_tile_the_table(tmp_path, monkeypatch, count):
    monkeypatch.setattr(text, "BLOCK", 1000)
    values = np.column_stack([np.arange(count) * 0.1, np.random.default_rng(4).normal(size=(count, 3))])
    path = tmp_path / "long.csv"
    path.write_text("t,x,y,z\n" + "".join(",".join(map(repr, row)) + "\n" for row in values.tolist()))
    parts = list(text.windows(path, 200))
    cores = [part.table.times[part.first : part.last + 1] for part in parts]
    assert [part.is_last for part in parts] == [False] * (len(parts) - 1) + [True]
    assert all(before[-1] == after[0] for before, after in itertools.pairwise(cores))
    np.testing.assert_array_equal(np.concatenate([cores[0], *(core[1:] for core in cores[1:])]), values[:, 0])
    for part in parts:
        assert part.first in (0, text.OVERLAP) and part.last < len(part.table.times)
        if not part.is_last:
            assert len(part.table.times) - 1 - part.last == text.OVERLAP and part.last - part.first == 200
    monkeypatch.setattr(text, "MAX_ROWS", 300)
    if count > 402:
        with pytest.raises(ConfigError, match="more than 300 rows"):
            text.read(path)


def test_units_that_do_not_fit_the_robot():
    spools = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    times, places = np.arange(100) * 0.01, np.full((100, 3), 1.5)
    assert unit_hints(MotionTable(times, places), spools) == []
    (line,) = unit_hints(MotionTable(times, places * 1000.0), spools)
    assert "are they millimetres" in line
    (line,) = unit_hints(MotionTable(np.arange(100) * 10.0, places), spools)
    assert "are they milliseconds" in line
