"""Anchors for firmware: what firmware computes from the lines is what the robot's drums do."""

import re

import numpy as np
import pytest
from support.commands import cspr

import cspr_jax
from cspr_jax.errors import ConfigError

SPOOLS = np.array([[0.9, 0.0, 0.1], [-0.6, 0.9, 0.0], [-0.3, -0.9, 0.0], [0.5, 0.5, 0.2]])
WINCH = "drum_radius = 0.02\ngear_ratio = 12.75\ncable_length = 9.0\nlayer_turns = 200.0\n"
HOME = np.array([0.1, -0.1, 1.4])


def _file(folder, head="", winch="[winch]\n" + WINCH, spools=SPOOLS):
    path = folder / "r.toml"
    path.write_text(f'name = "r"\nmass = 0.5\ncable_diameter = 0.001\nbase_points = {spools.tolist()}\n{head}\n{winch}')
    return path


def _parameters(lines, code):
    words = [word for line in lines if line.startswith(code) for word in line.split()[1:]]
    return {word[0]: np.array(re.split(":", word[1:]), float) for word in words}


def _motor_turns(lines, point):
    """Turns of the motors from home to a point, mm, as RepRapFirmware's Hangprinter computes them."""
    place, drum = _parameters(lines, "M669"), _parameters(lines, "M666")
    found = []
    for k in range(int(place["N"][0])):
        anchor = place["ABCDIJLO"[k]]
        line = np.linalg.norm(point - anchor) - np.linalg.norm(anchor)
        k2 = -drum["U"][k] * drum["O"][k] * drum["Q"][0]
        gear = drum["U"][k] * drum["H"][k] / drum["L"][k] / (2.0 * np.pi)
        radius = drum["R"][k]
        found.append(line * gear / radius if k2 == 0.0 else 2.0 * gear / k2 * (np.sqrt(radius**2 + line * k2) - radius))
    return np.array(found)


def _exact_turns(point):
    """The same of the drums with layers, by NumPy."""

    def angle(length):
        left, turned, radius = 9.0 - length, 0.0, 0.02
        while left >= (full := 2.0 * np.pi * radius * 200.0):
            left, turned, radius = left - full, turned + 2.0 * np.pi * 200.0, radius + 0.001
        return turned + left / radius

    lengths = [np.linalg.norm(SPOOLS - place, axis=1) for place in (HOME, point)]
    return 12.75 / (2.0 * np.pi) * np.array([angle(a) - angle(b) for a, b in zip(*lengths, strict=True)])


@pytest.mark.parametrize("turns", ["", "constant"])
def test_hangprinters_turn_their_motors_as_the_robot_does(tmp_path, turns):
    winch = "[winch]\n" + WINCH if not turns else "[winch]\ndrum_radius = 0.02\ngear_ratio = 12.75\n"
    lines = cspr_jax.anchors(_file(tmp_path, winch=winch), firmware="hangprinter", origin=HOME)
    moved = np.array([0.3, 0.2, 1.1])
    # z of the file is down: half a turn about x.
    firmware = _motor_turns(lines, 1000.0 * (moved - HOME) * [1.0, -1.0, -1.0])
    if turns:
        change = np.linalg.norm(SPOOLS - moved, axis=1) - np.linalg.norm(SPOOLS - HOME, axis=1)
        np.testing.assert_allclose(firmware, 12.75 * change / (2.0 * np.pi * 0.02), atol=1e-3)
    else:
        exact = _exact_turns(moved)
        # The steps of the layers are half a diameter off the spiral at most.
        assert np.abs(firmware - exact).max() <= np.abs(exact).max() * 0.0005 / 0.02
    assert any("not held: zero_length" in line for line in lines)


def test_klipper_has_a_section_for_each_winch(tmp_path):
    path = _file(tmp_path, 'z_axis = "up"', "[winch]\ndrum_radius = 0.02\ngear_ratio = 4.0\ndirection = [1, -1, 1, 1]")
    lines = cspr_jax.anchors(path, firmware="klipper", origin=(0.0, 0.0, -1.0))
    assert lines[1:3] == ["[printer]", "kinematics: winch"]
    section = lines[lines.index("[stepper_d]") :][:5]
    turn = f"rotation_distance: {2.0 * np.pi * 20.0 / 4.0:.6f}"
    assert section == ["[stepper_d]", turn, "anchor_x: 500.000", "anchor_y: 500.000", "anchor_z: 1200.000"]
    assert any("motors of cables 2 wind at growing angles" in line for line in lines)


def test_platforms_that_keep_their_orientation_are_points(tmp_path):
    spools = np.vstack([SPOOLS, SPOOLS[:2] + 0.3])
    points = [[0.1, 0.0, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.0, 0.0, 0.1], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]]
    keys = f'platform_points = {points}\ninertia = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nz_axis = "up"'
    lines = cspr_jax.anchors(_file(tmp_path, keys, "", spools), firmware="hangprinter")
    found = _parameters(lines, "M669")
    np.testing.assert_allclose(found["J"], 1000.0 * (spools[5] - points[5]), atol=1e-3)
    assert any("not held: rotation" in line for line in lines)


def test_the_command_prints_and_refuses(tmp_path):
    code, out, err = cspr("anchors", _file(tmp_path), "--for", "hangprinter", "--origin", *HOME)
    assert (code, err) == (0, "") and out.splitlines()[1].startswith("M669 K6 N4 A800.000:-100.000:1300.000 B")
    code, out, err = cspr("anchors", "boralugoda-planar-two", "--for", "klipper")
    assert (code, out) == (2, "") and "must move in space" in err and len(err.splitlines()) == 1
    with pytest.raises(ConfigError, match=r"^robot: .*: winch.cable_length = 1: must be at least"):
        cspr_jax.anchors(_file(tmp_path, winch="[winch]\n" + WINCH.replace("9.0", "1.0")), origin=HOME)
    with pytest.raises(ConfigError, match="ratio of numbers of teeth"):
        cspr_jax.anchors(_file(tmp_path, winch="[winch]\ndrum_radius = 0.1\ngear_ratio = 3.14159265358979"))
