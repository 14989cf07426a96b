"""Plans of transitions: there, swings, and back, beside formulas of chapter 1 written again in NumPy."""

import h5py
import numpy as np
import pytest
from support.commands import plan, planned

G, MASS, Z0 = 9.81, 0.129, 1.6
SPOOLS = 0.693 * np.array([[np.sqrt(0.75), -0.5, 0.0], [-np.sqrt(0.75), -0.5, 0.0], [0.0, 1.0, 0.0]])
PAIR = np.array([[0.693, 0.0, 0.0], [-0.693, 0.0, 0.0]])
TARGETS = {"transition-prototype": [1.2, -0.9, 2.1], "transition-planar": [1.4, 0.0, 1.1]}
POLYNOMIALS = {"A1": (0, 0, 0, 4, -3), "A2": (0, 0, 0, 10, -15, 6), "A3": (0, 0, 0, 6, -7, 2)}
PLAN = """schema = 1
robot = "{robot}"
family = "transition"
amplitude = {amplitude}
{depth}
samples = 301
[[pose]]
rest = true
[[pose]]
position = {target}
[[pose]]
position = {target}
arcs = 4
[[pose]]
rest = true
"""


def text(robot="transition-prototype", amplitude='"A1"', depth=f"z0 = {Z0}", target=None):
    return PLAN.format(robot=robot, amplitude=amplitude, depth=depth, target=target or TARGETS[robot])


def forward(name, target, n, tau):
    """Duration, position, velocity, acceleration of (1.20), (1.21), (1.89) with (1.29)."""
    curve = np.polynomial.Polynomial(POLYNOMIALS[name]) if name else np.polynomial.Polynomial([1.0])
    omega, center = 2.0 * np.pi * n, np.array([0.0, 0.0, Z0])
    time = np.sqrt((omega**2 - curve.deriv(2)(1.0)) * Z0 / G)
    a, a1, a2 = (np.asarray(curve.deriv(k)(tau) if k else curve(tau))[:, None] for k in range(3))
    cosine, sine = np.cos(omega * tau)[:, None], np.sin(omega * tau)[:, None]
    u = np.asarray(target) - center
    return (
        time,
        center + u * a * cosine,
        u * (a1 * cosine - omega * a * sine) / time,
        u * (a2 * cosine - 2.0 * omega * a1 * sine - omega**2 * a * cosine) / time**2,
    )


def balance(base, p, acceleration):
    """Tensions by a general solver."""
    rays, axes = base[None] - p[:, None], [0, 2] if len(base) == 2 else [0, 1, 2]
    pulled = MASS * (acceleration - np.array([0.0, 0.0, G]))[:, axes]
    units = (rays / np.linalg.norm(rays, axis=2, keepdims=True))[:, :, axes]
    return np.linalg.solve(units.transpose(0, 2, 1), pulled[..., None])[..., 0]


SOME = {("transition-planar", "A1")}


@pytest.mark.parametrize(
    ("robot", "name"),
    [
        pytest.param(robot, name, marks=() if (robot, name) in SOME else pytest.mark.soak)
        for robot in TARGETS
        for name in POLYNOMIALS
    ],
)
def test_there_swings_and_back(tmp_path, robot, name):
    """Every row of the motion is the printed motion; acceleration and tensions go on without a jump."""
    code, _, err = plan(tmp_path, text(robot, f'"{name}"'), "-o", tmp_path / "motion.h5")
    found = planned(tmp_path, text(robot, f'"{name}"'))
    assert (code, err) == (0, "")
    there, swings, back = found["segments"]
    assert [s["verdict"] for s in found["segments"]] == ["feasible"] * 3 and swings["oscillations"] == 2
    assert there["oscillations"] == back["oscillations"] <= there["envelope_oscillations"]
    assert there["least_oscillations"] <= there["envelope_oscillations"] < there["least_oscillations"] + 1.0
    v = (TARGETS[robot][2] - Z0) / Z0
    assert all(s["inclination"] == pytest.approx(v, abs=1e-12) for s in found["segments"])
    with h5py.File(tmp_path / "motion.h5") as file:
        motion = {key: file[key][()] for key in ("t", "position", "velocity", "acceleration", "tension", "rate")}
        assert file.attrs["mass"] == MASS and file["cable"].shape == (len(PAIR if "planar" in robot else SPOOLS),)
    tau, base = np.linspace(0.0, 1.0, 301), PAIR if "planar" in robot else SPOOLS
    clock = 0.0
    for i, (segment, curve) in enumerate(zip(found["segments"], (name, None, name), strict=True)):
        rows = slice(301 * i, 301 * (i + 1))
        time, p, velocity, acceleration = forward(curve, TARGETS[robot], segment["oscillations"], tau)
        if i == 2:  # (1.56) to (1.58)
            p, velocity, acceleration = p[::-1], -velocity[::-1], acceleration[::-1]
        assert segment["duration"] == pytest.approx(time, rel=1e-12)
        np.testing.assert_allclose(motion["t"][rows], clock + tau * time, atol=1e-9)
        np.testing.assert_allclose(motion["position"][rows], p, atol=1e-11)
        np.testing.assert_allclose(motion["velocity"][rows], velocity, atol=1e-10)
        np.testing.assert_allclose(motion["acceleration"][rows], acceleration, atol=1e-9)
        np.testing.assert_allclose(motion["tension"][rows], balance(base, p, acceleration), atol=1e-9)
        rays = p[:, None] - base[None]
        rates = (rays * velocity[:, None]).sum(2) / np.linalg.norm(rays, axis=2)
        np.testing.assert_allclose(motion["rate"][rows], rates, atol=1e-9)
        fine = forward(curve, TARGETS[robot], segment["oscillations"], np.linspace(0.0, 1.0, 20_001))
        lowest = balance(base, fine[1], fine[3]).min()
        assert 0.0 < segment["tension_min"] == pytest.approx(lowest, abs=1e-5)
        clock += time
    for end in (300, 601):
        np.testing.assert_allclose(motion["acceleration"][end], motion["acceleration"][end + 1], atol=1e-9)
        np.testing.assert_allclose(motion["tension"][end], motion["tension"][end + 1], atol=1e-9)


@pytest.mark.thorough
def test_a_swing_alone_is_not_tried_with_fewer(tmp_path):
    """Without `arcs` a swing is one oscillation; a fixed number stays, and too small a one is refuted."""
    free = planned(tmp_path, text().replace("arcs = 4\n", ""))
    assert free["segments"][1]["oscillations"] == 1 and free["segments"][1]["least_oscillations"] == 0.0
    target = f"position = {TARGETS['transition-prototype']}\n"
    few = planned(tmp_path, text().replace(target, f"{target}arcs = 2\n", 1).replace("arcs = 4\n", "", 1), code=1)
    assert few["segments"][0]["oscillations"] is None and few["segments"][0]["tried_arcs"] == 2
    assert "slack_cable" in few["segments"][0]["verdict"]


@pytest.mark.thorough
def test_inclinations(tmp_path):
    """z0 follows from (1.31); the best inclination needs no more than any other, and its sign is against w_C."""
    target = [0.0, 1.0, 2.0]
    given = planned(tmp_path, text(depth="inclination = 0.25", target=target))
    assert given["z0"] == pytest.approx(2.0 / 1.25) and given["segments"][0]["inclination"] == pytest.approx(0.25)
    best = planned(tmp_path, text(depth='inclination = "best"', target=target))
    others = [
        planned(tmp_path, text(depth=f"inclination = {v}", target=target))["segments"][0]["least_oscillations"]
        for v in (-0.5, 0.0, 0.3, 0.45, 0.7)
    ]
    assert best["segments"][0]["least_oscillations"] <= min(others)
    assert best["segments"][0]["inclination"] > 0.1  # under spool 3, whose weight is negative


@pytest.mark.soak
def test_the_best_inclination_with_the_best_epsilon(tmp_path):
    target = [0.0, 1.0, 2.0]
    best = planned(tmp_path, text(depth='inclination = "best"', target=target))
    effective = text(depth='inclination = "best"', amplitude='{ name = "effective", epsilon = "best" }', target=target)
    found = planned(tmp_path, effective)
    assert found["amplitude"] != best["amplitude"] and found["total_duration"] <= best["total_duration"]


@pytest.mark.quick("conservative")
@pytest.mark.parametrize("how", ["mean", "conservative", "fastest"])
def test_depths_that_are_chosen(tmp_path, how):
    found = planned(tmp_path, text(depth=f'z0 = {{ choose = "{how}" }}'))
    if how == "mean":
        assert found["z0"] == pytest.approx(TARGETS["transition-prototype"][2])
    if how == "fastest":
        assert found["total_duration"] <= planned(tmp_path, text())["total_duration"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("z0 = 1.6", ""), "z0 is missing: depth of P0"),
        (("z0 = 1.6", "z0 = 1.6\ninclination = 0.1"), "z0, inclination: must be one of them"),
        (("z0 = 1.6", "inclination = 1.0"), "inclination = 1.0"),
        (("z0 = 1.6", 'inclination = "good"'), 'inclination = "good"'),
        (("arcs = 4", "arcs = 3"), "pose[2].arcs = 3: must be even"),
        (("[1.2, -0.9, 2.1]\narcs", "[1.2, -0.9, 2.2]\narcs"), "pose[2].position"),
        (("position = [1.2, -0.9, 2.1]\narcs = 4", "rest = true\n[[pose]]\nrest = true"), "pose[3].rest = true"),
        (('"A1"', '"ideal"'), "must meet (1.27) and (1.28)"),
        (("transition-prototype", "transition-planar"), "must have y = 0"),
        (('"transition"', '"hypocycloid-standard"'), "(2.49)"),
        (("rest = true", "rest = true\nposition = [0, 0, 1.5]"), "must be P0"),
    ],
)
def test_mistakes(tmp_path, change, words):
    assert change[0] in text()
    code, out, err = plan(tmp_path, text().replace(*change, 1), "-o", tmp_path / "motion.csv")
    assert (code, out) == (2, "") and words in err and len(err.splitlines()) == 1
    assert not (tmp_path / "motion.csv").exists()


def test_two_targets_and_an_inclination(tmp_path):
    more = "\n[[pose]]\nposition = [-1.0, 0.2, {z}]\n"
    assert planned(tmp_path, text(depth="inclination = 0.2") + more.format(z=2.1))["feasible"]
    for depth, z, words in (("inclination = 0.2", 2.2, "different depths"), ('inclination = "best"', 2.1, "a number")):
        code, _, err = plan(tmp_path, text(depth=depth) + more.format(z=z))
        assert code == 2 and words in err


def test_the_table_for_people(tmp_path):
    code, out, _ = plan(tmp_path, text())
    assert code == 0 and "oscillations" in out and "0.3125" in out and "arcs" not in out
