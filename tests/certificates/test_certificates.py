"""Certificates that the package writes, read by the independent checker."""

import copy
import json
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from exact.cases import hexapod
from oracles.any_motion_cases import KINDS

import cspr_jax
from cspr_jax.certificate_checker.checking import check
from cspr_jax.certificate_checker.reading import NotACertificate, read
from cspr_jax.cli import main
from cspr_jax.errors import ConfigError
from cspr_jax.verification.certificates.certificate import digest

from .cases import certified, random_motion

ROOT = Path(__file__).parents[2]
SPOOLS = [[1.0, 0.0, 0.0], [-0.5, 0.75, 0.0], [-0.5, -0.75, 0.0]]
TIMES, POINTS = [0.0, 1.0, 2.0, 3.0], [[0, 0, 1], [0.2, 0.1, 1.2], [0.1, -0.2, 1.1], [0, 0, 1]]


def holds(content):
    """Whether a certificate, once written and read, holds."""
    return check(read(json.dumps(content))).holds


def checked(limits=None, spools=SPOOLS, **how):
    """A check of a short motion of a point mass."""
    return cspr_jax.check(cspr_jax.point_mass(spools, mass=2.0), TIMES, POINTS, limits=limits, **how)


def test_a_feasible_motion_has_a_certificate_that_holds():
    limits = {"cable_speed_max": 5.0, "cable_length_max": 3.0, "tension_max": 100.0, "speed_max": 5.0, "floor": 2.0}
    motion = checked(limits | {"cable_acceleration_max": 50.0, "acceleration_max": 50.0})
    assert motion.feasible
    content = motion.plan.certificate()
    assert content["verdict"] == "feasible"
    assert holds(content)
    assert set(content["limits"]) == {*limits, "cable_acceleration_max", "acceleration_max", "tension_min", "touched"}


def test_bounds_are_no_better_than_the_proof():
    content = checked().plan.certificate()
    smallest = checked(digits=12).margin
    stated = min(Fraction(bound) for name, bound in content["bounds"].items() if name.startswith("slack_cable"))
    assert 0.8 * smallest < stated < smallest
    raised = copy.deepcopy(content)
    name = min((n for n in content["bounds"] if n.startswith("slack")), key=lambda n: Fraction(content["bounds"][n]))
    raised["bounds"][name] = str(Fraction(smallest) + Fraction(1, 10**6))
    assert not holds(raised | {"sha256": digest(raised)})


def test_an_infeasible_motion_has_a_certificate_of_its_failures():
    motion = checked({"cable_speed_max": 0.05})
    content = motion.plan.certificate()
    assert content["verdict"] == "infeasible"
    assert {row["criterion"].partition(":")[0] for row in content["failures"]} == {"cable_too_fast"}
    assert holds(content)
    content["failures"][0]["time"] = "0"  # at rest
    assert not holds(content | {"sha256": digest(content)})


def test_redundant_cables_have_witnesses():
    spools = [[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]
    motion = checked({"tension_min": 1.0, "tension_max": 40.0}, spools)
    assert motion.feasible
    content = motion.plan.certificate()
    assert all(len(block["tensions"][0]) == 4 for block in content["blocks"])
    assert holds(content)
    refused = checked({"tension_min": 1.0, "tension_max": 7.0}, spools).plan.certificate()
    assert refused["failures"][0]["criterion"] == "wrench_infeasible"
    assert holds(refused)


def test_a_limit_that_is_touched_and_one_beside_the_extreme():
    """The certificate of a motion that keeps its limit by 1e-15 of it holds, and so does that of one that does not."""
    fastest = checked({"speed_max": 5.0}, digits=15).demands["speed_max"]["value"]
    for factor in (1.0 - 1e-15, 1.0 + 1e-15):
        motion = checked({"speed_max": fastest * factor / (1.0 + 1e-8)})
        content = motion.plan.certificate()
        assert content["verdict"] == ("feasible" if motion.feasible else "infeasible")
        assert holds(content)
    assert holds(checked({"speed_max": fastest}).plan.certificate())


def test_nothing_is_written_of_what_is_not_proved(tmp_path):
    motion = cspr_jax.check(
        cspr_jax.point_mass(SPOOLS, mass=2.0), lambda t: np.array([0.0, 0.0, 1.0]) * (1.0 + 0.0 * t), duration=1.0
    )
    path = tmp_path / "motion.json"
    with pytest.raises(ConfigError, match=r"motion\.json: not written: the motion has no formulas"):
        motion.plan.save_certificate(path)
    with pytest.raises(ConfigError, match=r"must end in \.json"):
        checked().plan.save_certificate(tmp_path / "motion.txt")
    uncertain = checked({"uncertainty": {"spool_positions": 1e-4}})
    with pytest.raises(ConfigError, match="not written: a certificate holds no uncertainty"):
        uncertain.plan.save_certificate(path)
    assert not list(tmp_path.iterdir())


def test_bodies_of_more_points_than_the_format_allows(monkeypatch):
    """Cables beside a sphere: two points times one."""
    robot = {"name": "triangle", "mass": 2.0, "base_points": SPOOLS}
    sphere = {"kind": "sphere", "centre": [1.0, 1.0, 2.0], "radius": 0.1}
    poses = [{"position": point, "time": time} for point, time in zip(POINTS, TIMES, strict=True)]
    plan = cspr_jax.plan({"schema": 1, "family": "spline", "robot": robot, "obstacle": [sphere], "pose": poses})
    monkeypatch.setattr("cspr_jax.verification.certificates.statement.MOST_POINTS", 2)
    assert holds(plan.certificate())
    monkeypatch.setattr("cspr_jax.verification.certificates.statement.MOST_POINTS", 1)
    with pytest.raises(ConfigError, match="at most 1 points of one body times those of another"):
        plan.certificate()


def test_commands_write_and_verify(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{t},{x},{y},{z}" for t, (x, y, z) in zip(TIMES, POINTS, strict=True))
    Path("motion.csv").write_text(f"t,x,y,z\n{rows}\n")
    Path("robot.toml").write_text(f'name = "triangle"\nmass = 2.0\nbase_points = {SPOOLS}\n')
    assert main(["check", "motion.csv", "--robot", "robot.toml", "--certificate", "m.json"]) == 0
    capsys.readouterr()
    assert main(["verify", "m.json"]) == 0
    assert "the proof holds" in capsys.readouterr().out
    assert main(["verify", "m.json", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["holds"] is True
    text = Path("m.json").read_text()
    Path("short.json").write_text(text[:-20])
    assert main(["verify", "short.json"]) == 2
    assert re.search(r"short\.json: no certificate", capsys.readouterr().err)
    forged = json.loads(text)
    forged["bounds"] = dict.fromkeys(forged["bounds"], "50")
    Path("forged.json").write_text(json.dumps(forged))
    assert main(["verify", "forged.json"]) == 2
    Path("forged.json").write_text(json.dumps(forged | {"sha256": digest(forged)}))
    capsys.readouterr()
    assert main(["verify", "forged.json"]) == 5
    assert "the proof does not hold" in capsys.readouterr().err
    assert main(["verify", "missing.json"]) == 2
    assert main(["check", "motion.csv", "--robot", "robot.toml", "--certificate", "m.txt"]) == 2


def test_the_example_of_the_documents_holds():
    text = (ROOT / "docs" / "certificates.md").read_text("utf-8")
    example = re.findall(r"```json\n(.*?)```", text, re.DOTALL)
    assert len(example) == 1
    assert check(read(example[0])).holds
    robot = {"name": "lift", "pattern": "1T", "base_points": [[0, 0, 0]], "mass": 1.0, "cable_length_max": 2.0}
    plan = {"schema": 1, "robot": robot, "family": "spline"}
    plan["pose"] = [{"position": [0, 0, 1], "time": 0.0}, {"position": [0, 0, 2], "time": 1.0}]
    written = cspr_jax.plan(plan | {"interpolation": "cubic"}).certificate()
    stated = json.loads(example[0])
    assert {key: written[key] for key in ("robot", "limits", "motion")} == {
        key: stated[key] for key in ("robot", "limits", "motion")
    }


PLANS = {
    "spline": "sweeps/way_points.toml",
    "hypocycloid": "sweeps/table_2_1.toml",
    "mixed": "sweeps/mixed_sequence.toml",
    "bezier": "sweeps/bezier_sequence.toml",
    "ellipse": "sweeps/turns.toml",
    "line": "sweeps/straight_line.toml",
    "free": "sweeps/free_obstacle.toml",
    "launch": "sweeps/swing_launch.toml",
    "platform on eight cables": "sweeps/cogiro.toml",
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", PLANS)
def test_plans_of_every_family_have_certificates(name):
    plan = cspr_jax.plan(ROOT / PLANS[name])
    content = plan.certificate()
    assert content["verdict"] == ("feasible" if plan.feasible else "infeasible")
    assert Fraction(content["motion"]["duration"]) == pytest.approx(plan.answers.duration.sum(), rel=1e-12)
    assert holds(content)


@pytest.mark.thorough
def test_cables_that_cross_are_shown():
    """A platform that turns by 2.4 rad, whose cables have no thickness and pass through each other."""
    angle, height = np.linspace(0.0, 2.4, 6), np.linspace(1.0, 1.1, 6)
    quaternions = np.stack([np.cos(angle / 2), 0.0 * angle, 0.0 * angle, np.sin(angle / 2)], axis=1)
    positions = np.stack([0.0 * angle + 0.02, 0.0 * angle + 0.01, height], axis=1)
    robot = hexapod(np.random.default_rng(0))
    motion = cspr_jax.check(robot, np.arange(6.0), positions, quaternions=quaternions)
    content = motion.plan.certificate()
    crossed = [row for row in content["failures"] if "until" in row]
    assert crossed and "cable_cable" in motion.verdict
    assert holds(content)
    for change in (-Fraction(1, 100), Fraction(1, 100)):  # no crossing between times beside it
        other = copy.deepcopy(content)
        for row in other["failures"]:
            if "until" in row:
                row |= {name: str(Fraction(row[name]) + change) for name in ("time", "until")}
        assert not holds(other | {"sha256": digest(other)})


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_random_motions_have_certificates(kind):
    """One each: of twelve seeds two have pulleys and winches, two pulleys alone, four winches alone."""
    compare_random(kind, [KINDS.index(kind)])


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_random_motions_have_certificates_in_full(kind):
    compare_random(kind, range(100, 180))


def compare_random(kind, seeds):
    """Random robots, with pulleys and winches, and motions of one kind: certificates hold."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        problem, motion = random_motion(rng, kind, pulleys=seed % 3 == 0, winches=seed % 2 == 0)
        proof, content = certified(problem, motion)
        assert (content["verdict"] == "feasible") == proof.is_feasible
        finding = check(read(json.dumps(content)))
        assert finding.holds, finding.message


def mutated(rng, content):
    """A certificate with one of its numbers changed, and its path."""
    found = []

    def walk(value, path):
        for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(entry, dict | list):
                walk(entry, (*path, key))
            elif key not in ("format", "version", "sha256", "name", "note", "verdict"):
                found.append((*path, key))

    walk(content, ())
    other = copy.deepcopy(content)
    path = found[rng.integers(len(found))]
    place = other
    for key in path[:-1]:
        place = place[key]
    value = place[path[-1]]
    if isinstance(value, int):
        place[path[-1]] = value + int(rng.choice([-1, 1]))
    elif re.fullmatch(r"[-0-9./e+]+", value):
        factor = Fraction(1) + Fraction(int(rng.integers(1, 100)), int(10 ** rng.integers(2, 12)))
        moved = Fraction(value) * factor if Fraction(value) else Fraction(1, 1000)
        place[path[-1]] = str(-Fraction(value) if Fraction(value) and rng.random() < 0.2 else moved)
    else:
        place[path[-1]] = "cos" if value == "sin" else "sin"
    return other, path


def contents():
    """Some certificates, cheap to check."""
    return [
        checked({"cable_speed_max": 5.0, "tension_max": 100.0, "floor": 2.0}).plan.certificate(),
        checked({"cable_speed_max": 0.05}).plan.certificate(),
        checked(
            {"tension_min": 1.0, "tension_max": 40.0}, [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]
        ).plan.certificate(),
    ]


def compare_mutations(count):
    """Changed numbers are noticed; with a new checksum, nothing false is accepted; how many were accepted."""
    rng, accepted = np.random.default_rng(0), 0
    for i in range(count):
        content = contents_of_session()[i % 3]
        other, path = mutated(rng, content)
        with pytest.raises(NotACertificate):
            read(json.dumps(other))
        other["sha256"] = digest(other)
        try:
            finding = check(read(json.dumps(other)))
        except NotACertificate:
            continue
        if finding.holds:
            accepted += 1
            assert is_true(other), path
    return accepted


_CONTENTS = []


def contents_of_session():
    """The certificates, computed once."""
    if not _CONTENTS:
        _CONTENTS.extend(contents())
    return _CONTENTS


def is_true(content):
    """Whether the statement of a certificate of a point mass holds at samples, by NumPy alone."""
    robot, limits = content["robot"], content["limits"]
    base = np.array([[float(Fraction(x)) for x in row] for row in robot["base_points"]])
    mass, gravity = (float(Fraction(robot[key])) for key in ("mass", "gravity"))
    touched = float(Fraction(limits["touched"]))
    worst = {}

    def note(name, values):
        worst[name] = min(worst.get(name, np.inf), float(np.min(values)))

    for piece in content["motion"]["pieces"]:
        width = float(Fraction(piece["end"]) - Fraction(piece["start"]))
        curves = [
            np.polynomial.Polynomial([float(Fraction(c)) for c in piece["program"][k][1]]) for k in piece["position"]
        ]
        u = np.linspace(0.0, width, 400)
        x, v, a = (np.stack([(c.deriv(order) if order else c)(u) for c in curves], 1) for order in range(3))
        rays = base[None] - x[:, None]
        lengths = np.linalg.norm(rays, axis=2)
        units = rays / lengths[..., None]
        force = mass * (a - [0.0, 0.0, gravity])
        low = np.array([float(Fraction(t)) for t in limits["tension_min"]])
        if len(base) == 3:
            tensions = np.linalg.solve(np.swapaxes(units, 1, 2), force[..., None])[..., 0]
            for k in range(3):
                note(f"slack_cable:{k}", tensions[:, k] - low[k])
                if "tension_max" in limits:
                    note(f"over_tension:{k}", float(Fraction(limits["tension_max"][k])) - tensions[:, k])
        if "cable_speed_max" in limits:
            rates = np.abs(np.einsum("tki,ti->tk", units, v))
            for k in range(len(base)):
                note(f"cable_too_fast:{k}", float(Fraction(limits["cable_speed_max"][k])) - rates[:, k])
        if "floor" in limits:
            note("below_floor", float(Fraction(limits["floor"])) - x[:, 2])
    if content["verdict"] == "infeasible":
        return any(worst[row["criterion"]] < 1e-9 for row in content["failures"])
    return all(value > -1e-6 - touched * 1e3 for value in worst.values())


def test_mutations_are_noticed():
    compare_mutations(60)


@pytest.mark.soak
def test_mutations_are_noticed_in_full():
    compare_mutations(100_000)
