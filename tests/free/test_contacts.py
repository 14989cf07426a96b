"""Bodies that free motions keep apart: linearised clearances, sides of cables, ways round obstacles, proofs."""

import dataclasses

import numpy as np
import pytest
from oracles import clearance as oracle

import cspr_jax
from cspr_jax.families.free import contacts
from cspr_jax.families.free.poses import FreePoses, motions_of
from cspr_jax.families.free.problem import FreeQuestion, FreeSettings, slacks_of
from cspr_jax.families.free.search.interior_point import Optima, started
from cspr_jax.families.free.search.tasks import Unknowns
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.contacts.clearance import ContactPair, scene
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.shapes import box, cylinder, hull, sphere
from cspr_jax.robots.statics.kernel_axes import centred

# A sphere half-way on the fastest motion between two poses.
BESIDE = {
    "schema": 1,
    "robot": "prototype",
    "family": "free",
    "z0": 1.3,
    "limits": {"tension_max": 4.0},
    "pose": [{"position": [0.4, 0.1, 1.2]}, {"position": [-0.3, -0.2, 1.3]}],
}
IN_THE_WAY = {"kind": "sphere", "centre": [0.045, -0.05, 0.85], "radius": 0.1}


def moved(name, rng, surroundings):
    """A question about a robot among bodies, a task, and unknowns of a motion near its middle."""
    robot = centred(cspr_jax.load_robot(name))[0]
    body = hull(0.2 * rng.normal(size=(12, 3)), name="platform") if surroundings.pop("hull", False) else None
    around = scene(robot, **surroundings, body=body)
    problem = Problem(robot, Limits(tension_max=np.full(robot.n_cables, 5000.0)), named("A1"))
    middle = 2.0 + rng.uniform(size=3) if body is None else np.array([0.3, 0.2, 3.0])
    places = np.stack([middle, middle + 0.3 * rng.normal(size=3)])
    quaternions = np.array([[1.0, 0.05, -0.1, 0.08], [1.0, -0.1, 0.05, 0.0]])
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    turning = None if robot.dof == 3 else quaternions
    free = np.full((2, robot.dof), np.nan)
    poses = FreePoses(places, turning, np.zeros((2, 3)), free, float(middle[2]))
    question = FreeQuestion.of(problem, around, poses, FreeSettings(intervals=6, samples=3))
    tasks = question.tasks(6, 3)
    line = np.linspace(tasks.ends[0, :, 0], tasks.ends[0, :, 1], tasks.basis.controls, axis=1)[None]
    return question, tasks, started(tasks, line + 0.02 * rng.normal(size=line.shape), np.array([[1.0]]))


SOLIDS = {
    "sphere": (sphere([0.5, 0.3, 1.0], 0.2), ContactPair("obstacle", 1, 0)),
    "cylinder": (cylinder([0.5, 0.3, 1.0], [1.0, 0.0, 2.0], 0.1), ContactPair("obstacle", 2, 0)),
    "box": (box([0.5, 0.3, 1.0], [0.4, 0.6, 0.2]), ContactPair("obstacle", 0, 0)),
    "platform and box": (box([0.5, 0.6, 2.0], [0.4, 0.6, 0.2]), ContactPair("platform-obstacle", -1, 0)),
    "cable and platform": (None, ContactPair("platform", 3, -1)),
    "cables": (None, ContactPair("cables", 0, 4)),
    "cables on the other side": (None, ContactPair("cables", 0, 3)),
}


@pytest.mark.quick("platform and box")
@pytest.mark.parametrize("kind", SOLIDS)
def test_planes_are_clearances_to_first_order(kind):
    """Their values are the clearances of the motion; of one that is near it, they differ by squares of the distance."""
    rng, (shape, meeting) = np.random.default_rng(3), SOLIDS[kind]
    with double_precision():
        surroundings = {"obstacles": [] if shape is None else [shape], "hull": "platform" in kind}
        question, tasks, unknowns = moved("cogiro", rng, surroundings)
        gap = contacts._gap(question, question.scene, meeting)
        places = tasks.basis.evaluate(tasks.controls(unknowns))[..., 0, :]
        # Cables that are far from each other are linear, too.
        gap = gap._replace(of_poses=lambda p, q, whole=gap.of_poses: (whole(p, q)[0], np.ones(len(p), bool)))
        values, slopes = contacts._linear(tasks, places, gap)
        change = rng.normal(size=places.shape)
        missed = []
        for size in (2e-3, 1e-3):
            there, _ = contacts._linear(tasks, places + size * change, gap)
            missed.append(np.abs(there - values - size * np.sum(slopes * change, axis=-1)).max())
        assert np.isfinite(values).all()
        assert np.abs(slopes).max() > 0.1
        assert missed[1] < 0.3 * missed[0] < 1e-4


def test_distances_of_cables_keep_the_sign_of_the_poses():
    """The distance of two lines is that of the oracle, and positive on the side of both poses."""
    rng = np.random.default_rng(5)
    with double_precision():
        question, tasks, _ = moved("cogiro", rng, {})
        pairs = [meeting for meeting in question.scene.contact_pairs if meeting.kind == "cables"]
        robot, places, seen = question.problem.robot, tasks.ends, 0
        flat = rng.uniform([-3.0, -2.0, 1.0, -0.3, -0.3, -0.3], [3.0, 2.0, 4.0, 0.3, 0.3, 0.3], (400, 6))
        positions, vectors = flat[:, :3], flat[:, 3:]
        quaternions = np.concatenate([np.ones((400, 1)), vectors], axis=1)
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        turns = contacts._turns(positions, quaternions)
        for _, k, other in pairs:
            values, is_near = contacts._between_lines(question.scene, k, other)(positions, quaternions)
            starts = [np.tile(robot.base_points[i], (400, 1)) for i in (k, other)]
            rays = [positions + turns @ robot.platform_points[i] - robot.base_points[i] for i in (k, other)]
            expected = oracle.segments(starts[0], rays[0], starts[1], rays[1])
            np.testing.assert_allclose(np.abs(values[is_near]), expected[is_near].astype(float), atol=1e-9)
            assert (np.abs(values) < expected + 1e-9).all()
            seen += is_near.sum()
            linear, _ = contacts._linear(
                tasks, places, contacts._gap(question, question.scene, ContactPair("cables", k, other))
            )
            assert not (linear < 0.0).any()
        assert seen > 100


def test_spools_over_a_face_keep_their_side():
    """A platform that turns over: the height of the spool over its face is positive on the side of both poses."""
    with double_precision():
        robot = centred(cspr_jax.load_robot("laval-mssm"))[0]
        around = scene(robot)
        problem = Problem(robot, Limits(tension_max=np.full(6, 40.0)), named("A1"))
        poses = FreePoses(
            np.tile([0.0, 0.0, 1.7], (2, 1)),
            np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)),
            np.zeros((2, 3)),
            np.full((2, 6), np.nan),
            1.7,
        )
        question = FreeQuestion.of(problem, around, poses, FreeSettings())
        tasks = question.tasks(4, 3)
        gaps = [contacts._gap(question, around, ContactPair("platform", k, -1)) for k in range(6)]
        half_turn = np.broadcast_to([0.0, 0.0, 1.7, 3.0, 0.0, 0.0], (1, 1, 4, 3, 6))
        for gap in gaps:
            always = gap._replace(of_poses=lambda p, q, whole=gap.of_poses: (whole(p, q)[0], np.ones(len(p), bool)))
            assert (contacts._linear(tasks, tasks.ends[:, :, :, None], always)[0] > 0.0).all()
            assert (contacts._linear(tasks, half_turn, always)[0] < 0.0).all()


def clear(planned, keys, samples=2000):
    """Least distance of cables, and so of the mass, from the surface of the sphere, m."""
    rows = planned.rows(rate=samples / planned.to_dict()["segments"][0]["duration"])
    base = np.asarray(cspr_jax.load_robot(keys["robot"]).base_points)
    centre, radius = np.array(keys["obstacle"][0]["centre"]), keys["obstacle"][0]["radius"]
    places = np.asarray(rows["position"])
    point = np.broadcast_to(centre, places.shape)
    cables = [oracle.point_to_segment(point, np.broadcast_to(spool, places.shape), places - spool) for spool in base]
    return float(np.min(cables)) - radius


@pytest.mark.thorough
def test_a_motion_leads_round_what_is_in_its_way():
    """Within all limits, clear by an oracle; the fastest motion without the sphere passes through it."""
    keys = BESIDE | {"obstacle": [IN_THE_WAY]}
    without, planned = cspr_jax.plan(BESIDE), cspr_jax.plan(keys)
    durations = [float(one.answers.duration.sum()) for one in (without, planned)]
    assert without.feasible
    assert clear(without, keys) < -0.05
    assert planned.feasible
    assert planned.to_dict()["segments"][0].get("warnings", []) == []
    assert clear(planned, keys) > 0.0
    assert durations[0] < durations[1] < 1.5 * durations[0]


@pytest.mark.thorough
def test_a_motion_gives_way_to_what_it_only_grazes():
    """A pole beside the motion: the first planes are enough, and the motion is hardly slower."""
    keys = BESIDE | {"obstacle": [IN_THE_WAY | {"centre": [0.045, -0.05, 0.85 + 0.11]}]}
    planned = cspr_jax.plan(keys)
    assert planned.feasible
    assert clear(planned, keys) > 0.0


def across():
    """A question about the prototype, a task from one side of a sphere to the other, unknowns, and its ends (2, 3)."""
    middle = {"obstacles": [sphere([0.0, 0.0, 2.2], 0.05)]}
    question, tasks, unknowns = moved("prototype", np.random.default_rng(1), middle)
    ends = np.array([[0.2, 0.0, 2.2], [-0.2, 0.0, 2.2]])
    return question, dataclasses.replace(tasks, ends=ends[None, None]), unknowns, ends


def test_a_motion_that_does_not_get_clear_is_none(monkeypatch):
    """Planes about one motion after the other, and no end: here a search always comes back to the line."""
    with double_precision():
        question, tasks, unknowns, ends = across()
        begun = []

        def straight(within, unknowns, *level, **levels):
            begun.append(level)
            line = np.linspace(ends[0], ends[1], within.basis.controls)[None, None, 3:-3]
            return Optima(unknowns._replace(inner=line), np.ones(1, bool), np.ones(1, int))

        monkeypatch.setattr(contacts, "optima", straight)
        for radius, is_clear in ((0.05, False), (1e-9, True)):
            begun.clear()
            solid = scene(question.problem.robot, obstacles=[sphere([0.0, 0.0, 2.2 + 0.04], radius)])
            among = dataclasses.replace(question, scene=solid)
            clear = contacts._clear(among, tasks, unknowns, {0: 1e-5})
            assert (clear is not None) == is_clear
            assert len(begun) == (1 if is_clear else contacts.SEARCHES)


def test_the_best_clear_motion_of_all_sides_is_taken(monkeypatch):
    """The cheapest is not clear and goes on alone, one does not converge: the cheaper one of the others is taken."""
    with double_precision():
        question, tasks, unknowns, ends = across()
        line = np.linspace(ends[0], ends[1], tasks.basis.controls)[None, 3:-3]
        aside = np.array([0.0, 0.0, 0.3, 0.3])[:, None, None, None] * np.array([0.0, 1.0, 0.0])
        found = Unknowns(*(np.repeat(leaf, 4, axis=0) for leaf in unknowns))
        found = found._replace(inner=line[None] + aside, duration=np.array([[0.5], [0.6], [0.8], [0.7]]))
        is_optimal, rows = np.array([True, False, True, True]), [np.arange(4), np.array([0]), np.array([0]), [0]]
        sizes = []

        def known(within, unknowns, *level, **levels):
            chosen = np.asarray(rows[len(sizes)])
            sizes.append(len(within.ends))
            several = unknowns._replace(inner=found.inner[chosen], duration=found.duration[chosen])
            return Optima(several, is_optimal[chosen], np.ones(len(chosen), int))

        monkeypatch.setattr(contacts, "optima", known)
        solid = scene(question.problem.robot, obstacles=[sphere([0.0, 0.0, 2.2], 0.05)])
        among = dataclasses.replace(question, scene=solid)
        within, best = contacts._clear(among, tasks.take(np.zeros(4, int)), found, {0: 1e-5})
        assert sizes == [4, 1, 1, 1][: contacts.SEARCHES]
        assert best.duration.tolist() == [[0.7]]
        assert len(within.ends) == 1


def test_planes_about_several_motions_are_those_of_each():
    """Turned platforms among bodies: what is computed together is what is computed alone."""
    rng, (shape, meeting) = np.random.default_rng(8), SOLIDS["platform and box"]
    with double_precision():
        question, tasks, unknowns = moved("cogiro", rng, {"obstacles": [shape], "hull": True})
        other = unknowns._replace(inner=unknowns.inner + 0.05 * rng.normal(size=unknowns.inner.shape))
        gap = contacts._gap(question, question.scene, meeting)
        places = [tasks.basis.evaluate(tasks.controls(each))[..., 0, :] for each in (unknowns, other)]
        together = contacts._linear(tasks.take(np.zeros(2, int)), np.concatenate(places), gap)
        for i, place in enumerate(places):
            for both, alone in zip(together, contacts._linear(tasks, place, gap), strict=True):
                np.testing.assert_allclose(both[i], alone[0], atol=1e-12)
        assert np.abs(together[0][0] - together[0][1]).max() > 1e-3


def test_motions_are_bent_along_the_segments_in_question():
    """Half-way by a part of the segment's length, to the sides; the ends of all segments stay where they are."""
    with double_precision():
        robot = centred(cspr_jax.load_robot("prototype"))[0]
        problem = Problem(robot, Limits(tension_max=np.full(3, 5.0)), named("A1"))
        places = np.array([[0.0, 0.0, 1.0], [0.3, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
        poses = FreePoses(places, None, np.zeros((4, 3)), np.full((4, 3), np.nan), 1.0)
        tasks = FreeQuestion.of(problem, None, poses, FreeSettings()).tasks(24, 3)
        line = np.linspace(tasks.ends[0, :, 0], tasks.ends[0, :, 1], tasks.basis.controls, axis=1)[None]
        unknowns = started(tasks, line, np.ones((1, 3)))
        deviation = list(contacts._deflected(tasks, unknowns, np.array([True, False, True])))
        before, *after = (tasks.basis.evaluate(tasks.controls(one))[0, ..., 0, :] for one in (unknowns, *deviation))
    middle = [(one - before)[:, 12, 0] for one in after]
    assert len(deviation) == 8
    for change in middle:
        assert not change[1].any()
    lengths = [np.linalg.norm(change, axis=-1) for change in middle]
    np.testing.assert_allclose([length[0] for length in lengths], [0.35 * 0.3] * 4 + [0.7 * 0.3] * 4, rtol=0.02)
    np.testing.assert_allclose([length[2] for length in lengths], [0.35 * 0.026] * 4 + [0.7 * 0.026] * 4, rtol=0.02)
    np.testing.assert_allclose(sum(middle[:4])[0], 0.0, atol=1e-12)


@pytest.mark.thorough
def test_nothing_is_bounded_where_bodies_are_apart():
    rng = np.random.default_rng(3)
    with double_precision():
        question, tasks, unknowns = moved("cogiro", rng, {"obstacles": [sphere([0.0, 0.0, 30.0], 0.1)]})
        slacks = slacks_of(question, motions_of(tasks, unknowns, question.poses.z0))
        assert contacts._clearances(question, slacks).shape[1] == len(question.scene.contact_pairs)
        assert (
            contacts.separated(question, tasks, unknowns, slacks._replace(low=np.maximum(slacks.low, 0.0)), 1) is None
        )
        met = slacks.low.copy()
        met[3, -1] = -0.01
        within, begun = contacts.separated(
            question, tasks, unknowns, slacks._replace(low=np.where(met < 0.0, met, 0.0)), 1
        )
        far, still = contacts._parted(question, tasks, unknowns, {len(question.scene.contact_pairs) - 1: 1e-3}, np.inf)
        _, residual = far.equations(still)
    # The motion has the values of its planes: here 24 m or more, over the size of the robot.
    assert (still.values[..., -1] > 2.0).all()
    np.testing.assert_allclose(residual[..., -1], 0.0, atol=1e-12)
    numbers = [number for number, _ in within.planes.minimum]
    assert len(question.scene.contact_pairs) - 1 in numbers
    assert begun.values.shape == within.low.shape
    assert within.n_limited == tasks.low.shape[-1]
