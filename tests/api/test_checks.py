"""Checks of motions from Python: one motion by every way in, causes and intervals, slower motions."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import BSpline, CubicSpline
from scipy.spatial.transform import Rotation

import cspr_jax
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.robots.model.point_mass import guided_robot
from cspr_jax.schema.verdicts import Verdict

TIMES = np.linspace(0.0, 6.0, 7)
PLACES = np.array([0.0, 0.0, 1.0]) + 0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, (7, 3))
FAST = {"cable_speed_max": 0.09}


def test_a_motion_by_every_way_in(tmp_path):
    """Arrays, a file, a plan, a robot by its name and as an object: one answer."""
    expected = cspr_jax.check("prototype", TIMES, PLACES, limits=FAST)
    assert expected.verdict == "cable_too_fast" and not expected.feasible and len(expected.failing)
    # Each criterion is narrowed for itself, not the worst of them alone.
    assert 0.0 <= expected.margin - expected.margin_bound <= 0.005 * expected.margin
    robot = cspr_jax.load_robot("prototype")
    path = tmp_path / "own.csv"
    np.savetxt(path, np.column_stack([TIMES, PLACES]), fmt="%.17g", delimiter=",", header="t,x,y,z", comments="")
    others = [
        cspr_jax.check(robot, TIMES, PLACES, limits=cspr_jax.Limits(cable_speed_max=0.09)),
        cspr_jax.check("prototype", path, limits=FAST),
        cspr_jax.check("prototype", str(path), limits=FAST, interpolation="cubic", ends="rest"),
    ]
    for other in others:
        assert {**other.to_dict(), "robot": ""} == {**expected.to_dict(), "robot": ""}
    many = cspr_jax.check_many("prototype", TIMES, PLACES[None], limits=FAST)
    assert many.verdict[0] == Verdict.CABLE_TOO_FAST and many.margin[0] == expected.margin
    np.testing.assert_array_equal(many.failing[0], expected.failing)
    assert [cause.to_dict() for cause in many.causes[0]] == expected.cause
    keys = {"schema": 1, "robot": "prototype", "family": "spline", "motion": str(path), **FAST}
    (segment,) = cspr_jax.plan(keys).to_dict()["segments"]
    assert segment["failing"] == expected.failing.tolist() and segment["cause"] == expected.cause


def test_intervals_of_failure_are_those_of_the_curve():
    """Speeds of cables of the curve by SciPy, at dense instants and at the ends of the intervals."""
    check = cspr_jax.check("prototype", TIMES, PLACES, limits=FAST)
    curve, spools = (
        CubicSpline(TIMES, PLACES, bc_type="clamped"),
        np.asarray(cspr_jax.load_robot("prototype").base_points),
    )

    def speed(t):
        away = curve(t)[:, None] - spools
        return np.abs(np.sum(away * curve(t, 1)[:, None], axis=2) / np.linalg.norm(away, axis=2)).max(1)

    times = np.linspace(0.0, 6.0, 20001)
    inside = np.logical_or.reduce([(start <= times) & (times <= end) for start, end in check.failing])
    np.testing.assert_array_equal(inside, speed(times) > 0.09)
    for edge in check.failing.ravel():
        assert edge in (0.0, 6.0) or np.ptp(np.sign(speed(np.array([edge - 1e-6, edge + 1e-6])) - 0.09)) == 2.0
    (cause,) = check.cause
    assert cause["needed"] == pytest.approx(speed(times).max(), rel=5e-3)
    assert abs(cause["t"] - times[speed(times).argmax()]) < 0.02
    assert check.demands["cable_speed_max"]["bound"] >= speed(times).max()


@pytest.mark.parametrize("floor", [1.03, 1.0])
def test_intervals_below_the_floor_are_those_of_the_curve(floor):
    """To a millionth of a second, as of other criteria."""
    check, curve = (
        cspr_jax.check("prototype", TIMES, PLACES, limits={"floor": floor}),
        CubicSpline(TIMES, PLACES[:, 2], bc_type="clamped"),
    )
    assert check.verdict == "below_floor"
    edges = check.failing.ravel()
    roots = curve.solve(floor, extrapolate=False)
    np.testing.assert_allclose(edges[edges < 6.0], roots, rtol=0.0, atol=1e-6)


@pytest.mark.thorough
def test_intervals_of_corners_below_the_floor():
    rng, box = np.random.default_rng(5), np.array([[-0.3, -0.3, -0.3], [0.3, 0.2, 0.3]])
    places, turns = [0.0, 0.0, 3.0] + 0.3 * rng.uniform(-1.0, 1.0, (7, 3)), 0.2 * rng.uniform(-1.0, 1.0, (7, 3))
    units = np.concatenate([np.ones((7, 1)), turns], axis=1)
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    check = cspr_jax.check("cogiro", TIMES, places, units, limits={"floor": 2.5, "platform_box": box.tolist()})
    curve = CubicSpline(TIMES, np.concatenate([places, units], axis=1), bc_type="clamped")
    corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3) - cspr_jax.load_robot("cogiro").centre_of_mass

    def height(t):
        values = curve(t)
        return values[2] + (corners @ Rotation.from_quat(np.roll(values[3:], -1)).as_matrix()[2]).min() - 2.5

    edges = [edge for edge in check.failing.ravel() if 0.0 < edge < 6.0]
    assert len(edges) == 2
    for edge in edges:
        assert height(edge - 1e-6) * height(edge + 1e-6) < 0.0


def test_slower():
    """At the least stretching the largest speed is the allowed one."""
    check = cspr_jax.check("prototype", TIMES, PLACES, limits=FAST)
    slower = check.slower()
    assert slower.is_static and slower.check.feasible
    assert slower.factor == pytest.approx(check.demands["cable_speed_max"]["value"] / 0.09, rel=2e-3)
    assert slower.check.duration == pytest.approx(6.0 * slower.factor)
    again = slower.check.slower()
    assert again.factor == 1.0 and again.check.duration == slower.check.duration
    assert not cspr_jax.check("prototype", TIMES * slower.factor * 0.9999, PLACES, limits=FAST).feasible
    beyond = cspr_jax.check("prototype", TIMES, PLACES, limits={"cable_length_max": 0.9}).slower()
    assert np.isnan(beyond.factor) and beyond.check is None and not beyond.is_static


def test_a_guided_weight_on_two_cables():
    """At rest the upper cable carries 10 N more than the lower one: 5.5 and 15.5 N are as far as can be from limits."""
    robot = guided_robot([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]], mass=1.0, gravity=10.0)
    answer = cspr_jax.check(
        robot, [0.0, 1.0], [[0.0, 0.0, 0.9], [0.0, 0.0, 0.9]], limits={"tension_min": 1.0, "tension_max": 20.0}
    )
    assert answer.feasible
    assert answer.margin == pytest.approx(4.5, abs=1e-9)


def test_functions_are_sampled():
    """A function of jax is refuted, or undecided; a margin is that of its samples."""

    def swing(t):
        return jnp.stack([0.1 * jnp.cos(3.0 * t), 0.1 * jnp.sin(3.0 * t), 1.0 + 0.0 * t])

    check = cspr_jax.check("prototype", swing, duration=3.0)
    assert check.verdict == "undecided" and check.margin > 0.0 and not np.isfinite(check.margin_bound)
    times = np.linspace(0.0, 3.0, 3001)
    places = np.stack([0.1 * np.cos(3.0 * times), 0.1 * np.sin(3.0 * times), np.ones_like(times)], axis=1)
    velocities = 0.3 * np.stack([-np.sin(3 * times), np.cos(3 * times), 0 * times], axis=1)
    accelerations = -9.0 * (places - [0.0, 0.0, 1.0])
    exact = cspr_jax.check("prototype", times, places, velocities=velocities, accelerations=accelerations)
    assert exact.feasible and check.margin == pytest.approx(exact.margin, rel=0.02)
    faster = cspr_jax.check("prototype", lambda t: swing(8.0 * t), duration=0.3)
    assert faster.verdict == "slack_cable" and faster.failing.tolist() == [[0.0, 0.3]]


def test_motions_of_this_package():
    robot = cspr_jax.load_robot("prototype")
    motion = cspr_jax.spline(robot, TIMES, PLACES)
    assert cspr_jax.check(robot, motion).margin == cspr_jax.check(robot, TIMES, PLACES).margin
    np.testing.assert_allclose(motion.state(0.5).position, CubicSpline(TIMES, PLACES, bc_type="clamped")(3.0))


@pytest.mark.parametrize("kind", ["function", "motion", "curve"])
def test_keys_of_samples_are_not_ignored(kind):
    """What says how samples become a curve is refused where there are none."""
    robot = cspr_jax.load_robot("prototype")
    more = {"duration": 1.0} if kind == "function" else {}
    make = {
        "function": lambda: lambda t: jnp.array([0.0, 0.0, 1.0]),
        "motion": lambda: cspr_jax.spline(robot, TIMES, PLACES),
        "curve": lambda: CubicSpline(TIMES, PLACES),
    }
    source = make[kind]()
    for key, value in {"interpolation": "quintic", "ends": "natural", "smooth": 1e-3}.items():
        with pytest.raises(ConfigError, match=f"{key} = .*: must be absent for a motion without samples"):
            cspr_jax.check(robot, source, **more, **{key: value})
    if kind != "curve":
        with pytest.raises(ConfigError, match='point = "origin": must be "mass-centre", whose positions'):
            cspr_jax.check(robot, source, **more, point="origin")


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["laval-mssm", "kntu-planar", "cogiro"])
def test_platforms_keep_their_own_axes(name):
    """Orientations count in the axes of the platform in its file, whatever the reference orientation is."""
    robot = cspr_jax.load_robot(name)
    depth = np.asarray(robot.base_points)[:, 2].mean() + (1.5 if robot.z_axis == "down" else -2.5)
    centre = np.asarray(robot.base_points).mean(0) * [1.0, 1.0, 0.0] + [0.0, 0.0, depth]
    places = centre + 0.05 * np.random.default_rng(2).uniform(-1, 1, (4, 3)) * (
        [1, 0, 1] if name == "kntu-planar" else 1
    )
    quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))
    one = cspr_jax.check(name, [0.0, 2.0, 4.0, 6.0], places)
    same = cspr_jax.check(robot, [0.0, 2.0, 4.0, 6.0], places, quaternions)
    assert one.verdict == same.verdict and one.margin == pytest.approx(same.margin)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"times": TIMES[::-1]}, "times"),
        ({"positions": PLACES[:-1]}, "positions"),
        ({"positions": PLACES * np.nan}, "positions"),
        ({"quaternions": np.tile([1.0, 0.0, 0.0, 0.0], (7, 1))}, "quaternions"),
        ({"positions": None}, "positions"),
        ({"interpolation": "linear"}, "interpolation"),
        ({"interpolation": "hermite"}, "velocities"),
        ({"ends": "free"}, "ends"),
        ({"ends": "periodic"}, "ends"),
        ({"smooth": -1.0}, "smooth"),
        ({"limits": {"cable_speed": 1.0}}, "cable_speed"),
        ({"limits": {"robot": "cogiro"}}, "robot"),
        ({"times": "missing.csv", "positions": None}, "missing.csv"),
    ],
)
def test_one_line_for_what_is_no_motion(arguments, words):
    with pytest.raises((InputError, ConfigError)) as error:
        cspr_jax.check("prototype", **({"times": TIMES, "positions": PLACES} | arguments))
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.thorough
def test_positions_of_the_origin_of_a_platform():
    """A rotation about the origin moves the mass centre on a circle: the same motion by both points."""
    centre = np.array([-0.034, -0.013, 0.264])
    times = np.linspace(0.0, 4.0, 401)
    angles = 0.1 * (1.0 - np.cos(np.pi * times / 2.0))
    zero = 0.0 * times
    quaternions = np.stack([np.cos(angles / 2.0), zero, np.sin(angles / 2.0), zero], axis=1)
    rotated = np.stack(
        [
            np.cos(angles) * centre[0] + np.sin(angles) * centre[2],
            centre[1] + zero,
            np.cos(angles) * centre[2] - np.sin(angles) * centre[0],
        ],
        axis=1,
    )
    origin = np.tile([0.5, 0.0, 2.0], (401, 1))
    limits = {"tension_min": 100.0, "tension_max": 500.0}
    by_origin = cspr_jax.check("cogiro", times, origin, quaternions, point="origin", limits=limits)
    by_centre = cspr_jax.check("cogiro", times, origin + rotated, quaternions, limits=limits)
    other = cspr_jax.check("cogiro", times, origin, quaternions, limits=limits)
    assert by_origin.margin == pytest.approx(by_centre.margin, rel=1e-3)
    assert other.margin != pytest.approx(by_centre.margin, rel=1e-2) and "mass centre" in other.plan.warnings[0]
    rows = by_origin.plan.rows()
    np.testing.assert_allclose(rows["mass_centre"][0], origin[0] + centre, atol=1e-9)


@pytest.mark.parametrize("fraction", [-1e-7, 1e-7])
def test_a_motion_on_its_limit_says_so(fraction):
    """A plumb swing that falls as fast as it can, by a ten-millionth slower or faster: its rows tell no more.

    Its acceleration changes least where it is largest, so that pieces between rows hardly miss that.
    """
    rate, times = 4.0, np.linspace(0.0, 4.0, 101)
    size = 9.81 * (1.0 + fraction) / rate**2

    def check(times):
        phase = rate * times
        heights = np.stack([1.5 - size * np.cos(phase), rate * size * np.sin(phase), rate**2 * size * np.cos(phase)])
        columns = np.zeros((3, len(times), 3))
        columns[:, :, 2] = heights
        return cspr_jax.check("prototype", times, columns[0], velocities=columns[1], accelerations=columns[2])

    coarse, fine = check(times), check(np.linspace(0.0, 4.0, 3201))
    assert fine.feasible == (fraction < 0.0)
    (row,) = coarse.to_dict()["on_limit"]
    assert row["criterion"] == "slack_cable" and abs(row["needed"]) < 1e-7 < row["tolerance"] < 1e-5
    assert any(line.startswith("on its limit") for line in coarse.lines())
    assert fine.to_dict()["on_limit"] == [] and not any(line.startswith("on its limit") for line in fine.lines())


def test_what_is_given_beside_a_source_of_its_own_is_refused():
    """One line each: samples beside a function, a motion or a file, and numbers of motions that do not fit."""
    motion = cspr_jax.spline(cspr_jax.load_robot("prototype"), TIMES, PLACES)
    samples = dict.fromkeys(("positions", "velocities", "accelerations"), PLACES)
    samples["quaternions"] = np.tile([1.0, 0, 0, 0], (7, 1))
    for source in (lambda t: PLACES[0], motion, "own.csv", CubicSpline(TIMES, PLACES)):
        for name, rows in samples.items():
            with pytest.raises(InputError, match=f"^{name}: given beside .*must be absent"):
                cspr_jax.check("prototype", source, **{name: rows})
    for source in (motion, "own.csv", CubicSpline(TIMES, PLACES), BSpline([0, 0, 6, 6], PLACES[:2], 1)):
        with pytest.raises(InputError, match=r"duration = 2\.0: must be absent"):
            cspr_jax.check("prototype", source, duration=2.0)
    with pytest.raises(InputError, match="positions: missing"):
        cspr_jax.check("prototype", TIMES)
    with pytest.raises(ConfigError, match=r"times\[1\] = 5.0: must be at least times\[0\] = 6.0: times must increase"):
        cspr_jax.check("prototype", TIMES[::-1], PLACES)


def test_shapes_of_many_motions_fit():
    times, three = np.tile([0.0, 1.0, 2.0], (3, 1)), np.tile(PLACES[:3], (3, 1, 1))
    shapes = {
        r"times: shape \(3, 3\): must have shape \(3,\) or \(2, 3\)": (times, three[:2]),
        r"times: shape \(2, 3\): .*\(3, 3\)": (times[:2], three),
        r"times: shape \(3, 1\): ": (times[:, :1], three),
        r"times: shape \(3, 3\): .* at 2 times each": (times, three[:, :2]),
        r"motion 1, times\[2\] = 1.0: must be at least times\[1\] = 2.0": (
            np.array([*times[:1], [0, 2, 1]]),
            three[:2],
        ),
        r"times = \[.*1e\+300.*must be .*at most 1e\+12": (1e300 * times, three),
    }
    for words, (instants, positions) in shapes.items():
        with pytest.raises(InputError, match=words):
            cspr_jax.check_many("prototype", instants, positions)
    for name in ("velocities", "accelerations"):
        with pytest.raises(InputError, match=rf"{name}: shape \(2, 3, 3\): must have shape \(3, 3, 3\)"):
            cspr_jax.check_many("prototype", times, three, **{"velocities": three, name: three[:2]})
