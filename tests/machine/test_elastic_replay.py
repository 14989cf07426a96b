"""Elastic cables in MuJoCo: natural frequencies of its linearised models, and plans played with set lengths."""

from pathlib import Path

import numpy as np
import pytest
from outputs.test_outputs import cspr, strict_json
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from support.folder import PLAN, ROBOT, folder

import cspr_jax
from cspr_jax.errors import ConfigError
from cspr_jax.outputs.mujoco.elastic_replay import _path
from cspr_jax.outputs.mujoco.mjcf import model_xml, unstretched_of
from cspr_jax.outputs.mujoco.motion import Played, Suspended, coordinates, played, suspended, upward
from cspr_jax.outputs.mujoco.replay import ends_of_steps
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.pulleys import Pulleys

mujoco = pytest.importorskip("mujoco")
__all__ = ["folder"]  # a fixture

ELASTIC = ROBOT + "axial_stiffness = 2e3\n"
# Robot, axial stiffness, place of the mass centre in its axes, coordinates of MuJoCo's, which for a planar body are
# those of its plane.
PLACES = [
    ("prototype", 5e3, [0.05, -0.03, 1.3], [0, 1, 2]),
    ("kntu-planar", 1e4, [0.1, 0.0, 0.05], [0, 2, 4]),
    ("cogiro", 1e6, [0.8, -0.5, 1.5], list(range(6))),
    ("laval-mssm", 2e4, [0.1, 0.05, 1.4], list(range(6))),
]


def _in_mujoco(robot, place):
    # The model of a robot that hangs in a place, and what this package says of it.
    held = cspr_jax.stiffness(robot, [place], point="mass-centre")
    world, is_body = upward(robot.z_axis), PATTERNS[robot.pattern].is_body
    stiff, tension, count = np.asarray(robot.axial_stiffness), held.tensions[0], robot.n_cables
    length = held.unstretched_lengths[0] * (1.0 + tension / stiff)
    pulleys = robot.pulleys
    body = Suspended(
        name="hanging",
        z_axis=robot.z_axis,
        axes=() if is_body else PATTERNS[robot.pattern].forces,
        mass=float(robot.mass),
        inertia=world.rotated_tensor(np.asarray(robot.inertia)) if is_body else None,
        gravity=float(robot.gravity),
        spools=world.rotated(np.asarray(robot.base_points)),
        points=world.rotated(np.asarray(robot.platform_points)) if is_body else np.zeros((count, 3)),
        tension_max=np.full(count, np.inf),
        pulleys=None if pulleys is None else Pulleys(pulleys.radius, world.rotated(np.asarray(pulleys.axes))),
        axial_stiffness=stiff,
    )
    still = np.zeros((3, 3))
    moved = Played(
        time=np.array([0.0, 0.005, 0.01]),
        segment=np.ones(3, int),
        tension=np.tile(tension, (3, 1)),
        position=np.tile(world.rotated(np.asarray(place)), (3, 1)),
        velocity=still,
        acceleration=still,
        rotation=Rotation.identity(3) if is_body else None,
        omega=still if is_body else None,
        omega_dot=still if is_body else None,
        length=np.tile(length, (3, 1)),
    )
    model = mujoco.MjModel.from_xml_string(model_xml(body, moved, elastic=True))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def _linearised(model, data, freedoms):
    # Natural frequencies by differences of accelerations.
    qpos, matrix, step = data.qpos.copy(), np.empty((len(freedoms),) * 2), 1e-6
    for k, freedom in enumerate(freedoms):
        sides = []
        for sign in (1.0, -1.0):
            velocity = np.zeros(model.nv)
            velocity[freedom], data.qpos[:] = sign * step, qpos
            mujoco.mj_integratePos(model, data.qpos, velocity, 1.0)
            mujoco.mj_forward(model, data)
            sides.append(data.qacc[freedoms].copy())
        matrix[:, k] = (sides[1] - sides[0]) / (2.0 * step)
    data.qpos[:] = qpos
    return np.sqrt(np.sort(np.linalg.eigvals(matrix).real))


@pytest.mark.parametrize(
    ("name", "stiffness", "place", "freedoms"),
    [
        pytest.param(*row, id=row[0], marks=[pytest.mark.thorough] * (row[0] in ("kntu-planar", "cogiro")))
        for row in PLACES
    ],
)
def test_frequencies_of_its_models(name, stiffness, place, freedoms):
    """To 1e-6; 1 % was asked for."""
    robot = cspr_jax.with_cables(cspr_jax.load_robot(name), axial_stiffness=stiffness)
    model, data = _in_mujoco(robot, place)
    assert np.abs(data.qacc).max() < 1e-7
    expected = cspr_jax.natural_frequencies(robot, [place], point="mass-centre").frequencies[0]
    np.testing.assert_allclose(_linearised(model, data, freedoms), expected, rtol=1e-6)


def _plan(folder, line="axial_damping = 0.0\n"):
    (folder / "elastic.toml").write_text(ELASTIC + line)
    (folder / "plan.toml").write_text(PLAN.replace("mine.toml", "elastic.toml"))
    return cspr_jax.plan("plan.toml")


def test_set_lengths_land_where_planned(folder):
    """To 1e-7 m all along; without compensation they hang as much lower as statics say."""
    plan = _plan(folder)
    found = cspr_jax.replay_elastic(plan, step=0.002)
    compensated, other = found.deviation(found.compensated), found.deviation(found.uncompensated)
    assert compensated.max() < 1e-7
    # At rest in P0 all three cables stretch by f / EA; along a cable it is more than the whole stretch.
    rest = cspr_jax.natural_frequencies(cspr_jax.load_robot("elastic.toml"), [[0.0, 0.0, 1.5]]).tensions[0]
    assert (rest / 2e3).max() * 1.5 < other[0] < 3.0 * (rest / 2e3).max() * 1.5
    assert other[0] == pytest.approx(found.settled, rel=1e-6)  # the plan ends where it starts
    assert other.max() > other[0] and other[-1] == pytest.approx(found.settled, rel=0.5)


@pytest.mark.thorough
def test_the_command(folder, capsys):
    found = cspr_jax.replay_elastic(_plan(folder), step=0.002)
    told = strict_json(cspr(capsys, "replay", "plan.toml", "--elastic", "--json", "--step", 0.002))
    assert told == found.to_dict()
    assert told["uncompensated"]["largest"]["distance"] == found.deviation(found.uncompensated).max()
    assert cspr(capsys, "replay", "plan.toml", "--elastic", "--step", 0.002).splitlines() == found.lines()


@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_damping(folder, damping):
    """A nudge at rest decays as linear equations say, whose damping matrix is d / EA times the elastic stiffness."""
    (folder / "elastic.toml").write_text(f"{ELASTIC}axial_damping = {damping}\n")
    place, nudge = np.array([0.05, -0.03, 1.3]), 1e-4 * np.array([1.0, 0.4, 0.7])
    rest = {"schema": 1, "robot": "elastic.toml", "family": "spline"}
    plan = cspr_jax.plan(rest | {"pose": [{"position": place.tolist(), "time": t} for t in (0.0, 0.5)]})
    body, moved = suspended(plan), played(plan, 5e-4)
    world, start = upward(plan.robot_file.z_axis), coordinates(body, moved)[0][0]
    path = _path(body, moved, start + world.rotated(nudge), unstretched_of(body, moved))
    found = world.rotated(path.position) - place
    held = cspr_jax.stiffness(cspr_jax.load_robot("elastic.toml"), [place])
    inverse = np.linalg.inv(held.mass[0])
    rates = np.block(
        [[np.zeros((3, 3)), np.eye(3)], [-inverse @ held.matrix[0], -inverse @ held.elastic[0] * damping / 2e3]]
    )
    times = moved.time[ends_of_steps(moved)]
    expected = np.array([(expm(rates * t) @ np.concatenate([nudge, np.zeros(3)]))[:3] for t in times[::20]])
    np.testing.assert_allclose(found[::20], expected, atol=0.01 * np.abs(nudge).max())
    # Undamped it swings on; damped its stiff modes are gone by the end.
    late = np.abs(found[-100:] @ np.linalg.eigh(held.matrix[0])[1][:, -1]).max()
    assert late > 0.5e-4 if damping == 0.0 else late < 0.1e-4


@pytest.mark.thorough
def test_models_with_springs(folder, capsys):
    """Springs and the control file of unstretched lengths, played as the model says."""
    plan = _plan(folder)
    plan.save_mjcf("mine.xml", step=0.002, elastic=True)
    cspr(capsys, "plan", "plan.toml", "--mjcf", "told.xml", "--elastic", "--step", 0.002)
    assert Path("told_control.csv").read_bytes() == Path("mine_control.csv").read_bytes()
    table = np.loadtxt("mine_control.csv", delimiter=",", skiprows=1)
    t, lengths = table[:, 0], table[:, 1:]
    model = mujoco.MjModel.from_xml_path("mine.xml")
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qacc, 0.0, atol=1e-9)
    np.testing.assert_allclose(model.tendon_stiffness, 2e3 / lengths[0])
    np.testing.assert_allclose(model.tendon_lengthspring[:, 1], lengths[0])
    row = 0
    while row + 2 < len(t):
        model.opt.timestep = t[row + 2] - t[row]
        model.tendon_lengthspring[:, 1], model.tendon_stiffness[:] = lengths[row + 1], 2e3 / lengths[row + 1]
        mujoco.mj_step(model, data)
        row += 2 if row + 3 == len(t) or t[row + 3] > t[row + 2] else 3
    np.testing.assert_allclose(data.qpos, plan.points[-1] * [1.0, -1.0, -1.0], atol=1e-4)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("replay", "plan.toml", "--elastic"), "--elastic: must be absent for a robot without axial_stiffness"),
        (("replay", "plan.toml", "--elastic", "-o", "a.png"), "-o: must be absent with --elastic"),
        (("plan", "plan.toml", "--elastic"), "--elastic: must be absent without --mjcf"),
        (("plan", "plan.toml", "--elastic", "--mjcf", "a.xml"), "--elastic: must be absent for a robot without"),
    ],
)
def test_mistakes(folder, capsys, words, line):
    before = set(folder.iterdir())
    assert cspr(capsys, *words, code=2).startswith(f"cspr: {line}")
    assert set(folder.iterdir()) == before


def test_wrong_damping(folder):
    (folder / "mine.toml").write_text(ROBOT + "axial_damping = 1.0\n")
    with pytest.raises(ConfigError, match=r"axial_damping = 1\.0: must be absent without axial_stiffness"):
        cspr_jax.plan("plan.toml")


@pytest.mark.thorough
def test_a_platform_that_only_translates_is_refused(folder):
    pairs = cspr_jax.parallel_pair_robot(0.5, 0.05, mass=1.0)
    robot = {"name": "pairs", "mass": 1.0, "translation_only": True, "axial_stiffness": 2e3}
    robot |= {name: np.asarray(getattr(pairs, name)).tolist() for name in ("base_points", "platform_points", "inertia")}
    poses = [{"rest": True}, {"position": [0.1, 0.0, 1.4]}, {"rest": True}]
    plan = cspr_jax.plan({"schema": 1, "robot": robot, "z0": 1.4, "pose": poses})
    with pytest.raises(ConfigError, match="--elastic: must be absent for a platform that only translates"):
        cspr_jax.replay_elastic(plan)


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["pulleys", "cogiro"])
def test_pulleys_and_eight_cables(folder, kind):
    """To 1e-7 m and rad along the plan, whichever rule chose the tensions."""
    if kind == "pulleys":
        plan = _plan(folder, "pulley_radius = 0.04\n")
    else:
        catalogue = Path(cspr_jax.__file__).parent / "catalogue" / "cogiro.toml"
        (folder / "elastic.toml").write_text(catalogue.read_text() + "axial_stiffness = 2e6\n")
        example = (Path(__file__).parents[2] / "sweeps" / "cogiro.toml").read_text()
        (folder / "plan.toml").write_text(example.replace('"cogiro"', '"elastic.toml"'))
        plan = cspr_jax.plan("plan.toml")
    found = cspr_jax.replay_elastic(plan, step=0.002)
    assert found.deviation(found.compensated).max() < 1e-7 and found.compensated.rotated.max() < 1e-7
    assert found.settled > 1e-3
