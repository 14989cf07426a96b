"""Motions of users from whatever file: this program's own are read back as the motion that they were."""

import numpy as np
import pytest
from plans.test_planning import SHORT
from support.commands import plan
from support.motions import states_along

import cspr_jax
from cspr_jax.curves.reading import spline_of
from cspr_jax.errors import ConfigError
from cspr_jax.store.reading.motion_samples import motion_windows, read_motion

from .test_motion_table import PLATFORM


@pytest.fixture(
    scope="module", params=[SHORT, pytest.param(PLATFORM, marks=pytest.mark.thorough)], ids=["point", "platform"]
)
def folder(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    for ending in ("csv", "h5"):
        assert plan(folder, request.param, "-o", str(folder / f"motion.{ending}"))[0] == 0
    return folder


def test_motions_of_this_program(folder):
    """CSV and HDF5 are the same motion, through every row with its rates, and accelerations of both legs that meet."""
    table, file = (read_motion(folder / f"motion.{ending}") for ending in ("csv", "h5"))
    rows = cspr_jax.open_result(folder / "motion.h5")
    assert table.notes == () and table.interpolation == file.interpolation == "hermite"
    assert (table.z_axis, file.z_axis) == (None, rows.attributes["z_axis"])
    for name in ("times", "positions", "velocities", "accelerations"):
        np.testing.assert_array_equal(getattr(table, name), getattr(file, name))
    for source in (table, file):
        spline = spline_of(source)
        times = rows.axes["t"]
        after = np.append(np.diff(times) > 0.0, True)  # of two rows of one time, the motion goes on with the later
        found = states_along(spline, times[after] / times[-1])
        pairs = {"position": found.position, "velocity": found.velocity, "acceleration": found.acceleration}
        if source.quaternions is not None:
            pairs |= {"omega": found.angular_velocity, "omega_dot": found.angular_acceleration}
        for name, values in pairs.items():
            expected = rows.data[name][after]
            np.testing.assert_allclose(values, expected, atol=1e-6 * np.abs(expected).max())


def test_windows_of_this_program(folder):
    """Legs that meet at a window's end go on in the next."""
    whole = read_motion(folder / "motion.csv")
    (window,) = motion_windows(folder / "motion.h5")
    np.testing.assert_array_equal(window.table.times, whole.times)
    parts = list(motion_windows(folder / "motion.csv", n_rows=101))
    cores = [part.table.times[part.first : part.last + 1] for part in parts]
    np.testing.assert_array_equal(np.concatenate([cores[0], *(core[1:] for core in cores[1:])]), whole.times)


def test_axes_and_units_of_a_table(folder):
    """Tables are in the axes of the robot; comments of earlier versions, below the names, say axes and units."""
    head, *rows = (folder / "motion.csv").read_text().splitlines()
    table, rotated = read_motion(folder / "motion.csv"), [1.0, -1.0, -1.0]
    np.testing.assert_array_equal(table.in_axes("up").positions, table.in_axes("down").positions)
    (folder / "sheet.csv").write_text("\n".join([head, "# z: up,,", "# units: mm rad s,,,", *rows]))
    sheet = read_motion(folder / "sheet.csv")
    assert sheet.z_axis == "up"
    np.testing.assert_allclose(sheet.accelerations, 1e-3 * table.accelerations)
    np.testing.assert_allclose(sheet.in_axes("down").positions, 1e-3 * table.positions * rotated)


@pytest.mark.parametrize("name", ["positions", "velocities"])
def test_legs_that_do_not_meet(folder, name):
    lines = (folder / "motion.csv").read_text().splitlines()
    column = lines[0].split(",").index({"positions": "position_x", "velocities": "velocity_x"}[name])
    times = [line.split(",")[0] for line in lines]
    row = next((k for k in range(1, len(times)) if times[k] == times[k - 1]), None)
    if row is None:
        pytest.skip("one leg")
    cells = lines[row].split(",")
    cells[column] = repr(float(cells[column]) + 0.1)
    lines[row] = ",".join(cells)
    (folder / "torn.csv").write_text("\n".join(lines))
    with pytest.raises(ConfigError, match=f"line {row + 1}: {name} jump by 0.1 at one time"):
        read_motion(folder / "torn.csv")


def test_faults(folder, tmp_path):
    with pytest.raises(ConfigError, match="must be absent: only files of CASPR"):
        read_motion(folder / "motion.csv", "one")
    whole = (folder / "motion.h5").read_bytes()
    for content in (b"not HDF5", b"", whole[: len(whole) // 2]):
        (tmp_path / "other.h5").write_bytes(content)
        with pytest.raises(ConfigError, match=r"^\S*/other\.h5: cannot be read as a result"):
            read_motion(tmp_path / "other.h5")
    for name in ("folder.h5", "folder.csv", "folder.xml"):
        (tmp_path / name).mkdir()
        with pytest.raises(ConfigError, match="is not a file"):
            read_motion(tmp_path / name)
    (tmp_path / "a_trajectories.xml").write_text("<x/>")
    with pytest.raises(ConfigError, match="must be <trajectories>"):
        read_motion(tmp_path / "a_trajectories.xml")
    with pytest.raises(ConfigError, match="must be a table of samples here"):
        next(motion_windows(tmp_path / "a_trajectories.xml"))
