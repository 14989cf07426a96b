"""Free motions beside closed forms of other families: starts from them, and no motion slower than they are."""

import dataclasses

import numpy as np
import pytest
from support.motions import states_along

import cspr_jax
from cspr_jax.families.free import leg, no_slower
from cspr_jax.families.free.closed_forms import ClosedForm, closed_forms, controls_of, form_starts
from cspr_jax.families.free.free_motion import _keep, free_motion
from cspr_jax.families.free.poses import segments_of
from cspr_jax.families.free.problem import FreeQuestion
from cspr_jax.families.free.search.interior_point import Optima, started
from cspr_jax.families.free.search.starts import starts
from cspr_jax.motion.motion import states_at
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.verdicts import Verdict

KEYS = {"schema": 1, "robot": "prototype", "family": "free", "z0": 1.7, "limits": {"tension_max": 1.6}}
# The hypocycloid takes five arcs.
POSES = [{"position": [-1.1, -0.9, 1.5]}, {"position": [0.8, 0.5, 1.5]}]
ARCS = 5


@pytest.fixture(scope="module")
def asked():
    """What the leg of a plan asks the search: its arguments, and the forms of other families."""
    box = {}

    def grasp(*arguments):
        box["question"] = arguments
        free = free_motion(*arguments)
        box.setdefault("first", free)
        box["free"] = missed(free)
        return box["free"]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(leg, "free_motion", grasp)
        patch.setattr(leg, "closed_forms", lambda legs, *rest: box.update(legs=legs) or closed_forms(legs, *rest))
        patch.setattr(leg, "no_slower", lambda free, *rest: box.update(forms=rest[-1]) or free)
        cspr_jax.plan(KEYS | {"starts": 1, "pose": POSES})
    return box


def duration(robot):
    """About that of five half swings."""
    return ARCS * np.pi * np.sqrt(KEYS["z0"] / float(robot.gravity))


def missed(free):
    """A motion that the proof leaves open."""
    verdict = np.full(len(free.motions), Verdict.UNDECIDED)
    return dataclasses.replace(free, answers=dataclasses.replace(free.answers, verdict=verdict), is_optimal=False)


@pytest.mark.thorough
def test_other_families_are_asked(asked):
    (form,) = asked["forms"]
    assert form.family == "hypocycloid-standard"
    assert form.is_feasible.all()
    np.testing.assert_allclose(form.duration, duration(asked["question"][0].robot), rtol=1e-3)
    # The second search began from them.
    assert len(asked["question"][-1]) == 1


@pytest.mark.thorough
def test_forms_keep_limits_of_the_mass_centre(asked):
    """A form that breaks one is none, and does not stand in."""
    problem, scene, poses, settings = asked["question"][:4]
    for most, stands_in in ((1.0, False), (50.0, True)):
        limited = problem._replace(limits=dataclasses.replace(problem.limits, speed_max=np.asarray(most)))
        with double_precision():
            forms = closed_forms(asked["legs"], limited, poses)
            free = no_slower.no_slower(asked["free"], limited, scene, poses, settings, forms)
        assert [form.family for form in forms] == ["hypocycloid-standard"] * stands_in
        assert any(free.families) == stands_in


@pytest.mark.thorough
def test_splines_follow_a_motion(asked):
    problem, scene, poses, settings = asked["question"][:4]
    (form,) = asked["forms"]
    with double_precision():
        tasks = FreeQuestion.of(problem, scene, poses, settings).tasks(96, 3)
        controls = controls_of(tasks, form.motions[0])
        at = states_at(form.motions[0], tasks.basis.tau.ravel())
    near = tasks.basis.evaluate(controls).reshape(-1, 3, 3) / form.duration[0] ** np.arange(3)[:, None]
    np.testing.assert_allclose(near[:, 0], at.position, atol=1e-7)
    np.testing.assert_allclose(near[:, 2], at.acceleration, atol=1e-2)


def test_starts_of_the_segments_in_question(asked):
    """The number of each is that of its segment among those in question."""
    problem, scene, poses, settings = asked["question"][:4]
    (form,) = asked["forms"]
    several = ClosedForm("several", form.motions * 3, np.array([True, False, True]), np.array([5.0, 6.0, 7.0]))
    with double_precision():
        single = segments_of(FreeQuestion.of(problem, scene, poses, settings).tasks(24, 3))
        begun = form_starts(single.take(np.zeros(3, int)), np.array([0, 2]), [several, several])
    assert begun.task.tolist() == [0, 1, 0, 1]
    assert begun.duration.ravel().tolist() == [5.0, 7.0, 5.0, 7.0]
    assert begun.controls.shape == (4, 1, 29, 3)


@pytest.mark.thorough
def test_a_search_from_forms_goes_on_from_what_was_best(asked):
    """It keeps what the usual starts have led to, and begins from nothing but the forms."""
    problem, scene, poses, settings = asked["question"][:4]
    first = asked["first"]
    assert first.parts[0].is_optimal
    better = first.parts[0]._replace(cost=0.0, duration=1e-3)
    with double_precision():
        further = free_motion(problem, scene, poses, settings, first, asked["forms"])
        kept = free_motion(problem, scene, poses, settings, dataclasses.replace(first, parts=(better,)), asked["forms"])
    assert further.parts[0].cost <= first.parts[0].cost
    assert kept.parts[0].cost == 0.0


@pytest.mark.parametrize(
    ("durations", "is_shared"), [((1.0005, 1.5), False), ((1.5, 1.0005), True), ((1.5, 1.6), False)]
)
def test_starts_of_two_searches_agree(asked, durations, is_shared):
    """Where another start leads to the same motion, and not the same one once more."""
    problem, scene, poses, settings = asked["question"][:4]
    with double_precision():
        single = segments_of(FreeQuestion.of(problem, scene, poses, settings).tasks(24, 3))
        begun, best = starts(single, KEYS["z0"], 2), {}
        lanes = single.take(begun.task)
        unknowns = started(lanes, begun.controls, begun.duration)
        for pair in ((1.0, 2.0), durations):
            optimum = Optima(unknowns._replace(duration=np.array(pair)[:, None]), np.ones(2, bool), np.zeros(2, int))
            _keep(best, np.array([0]), begun.task, lanes, optimum)
    assert best[0].duration == 1.0
    assert best[0].start == 0
    assert best[0].is_shared == is_shared


def test_a_closed_form_stands_in_for_nothing(asked):
    problem, scene, poses, settings = asked["question"][:4]
    with double_precision():
        free = no_slower.no_slower(asked["free"], problem, scene, poses, settings, asked["forms"])
        ends = states_along(free.motions[0], [0.0, 1.0])
    assert free.families == ("hypocycloid-standard",)
    assert free.answers.feasible.all()
    assert free.duration == pytest.approx(asked["forms"][0].duration.sum(), rel=1e-12)
    np.testing.assert_allclose(ends.position, poses.positions, atol=1e-12)


@pytest.mark.parametrize("change", ["accelerations", "verdict", "duration", "objective"])
def test_a_closed_form_that_does_not_serve(asked, change):
    """It accelerates otherwise, is not proved, takes too long, or is slower than what is proved."""
    problem, scene, poses, settings = asked["question"][:4]
    (form,), free = asked["forms"], asked["free"]
    if change == "accelerations":
        poses = poses._replace(accelerations=np.zeros((2, 3)))
    elif change == "verdict":
        form = form._replace(is_feasible=np.array([False]))
    elif change == "duration":
        settings = settings._replace(longest=0.9 * float(form.duration[0]))
    else:
        free = dataclasses.replace(free, answers=dataclasses.replace(free.answers, verdict=np.array([0])))
        assert not no_slower.can_be_faster(free, problem, poses, settings)
    with double_precision():
        assert no_slower.no_slower(free, problem, scene, poses, settings, [form]) is free


@pytest.mark.thorough
def test_ctrl_c_keeps_what_is_proved(monkeypatch):
    """While other families are asked."""

    def interrupted(legs, *rest):
        if any(FAMILIES[leg.waypoints.family].precedes_searches for leg in legs):
            return closed_forms(legs, *rest)  # lines are there before the search
        raise KeyboardInterrupt

    monkeypatch.setattr(leg, "can_be_faster", lambda *arguments: True)
    monkeypatch.setattr(leg, "closed_forms", interrupted)
    planned = cspr_jax.plan(KEYS | {"starts": 1, "pose": POSES})
    assert planned.feasible
    assert "the search was stopped before its end" in planned.warnings[0]
    monkeypatch.setattr(leg, "free_motion", lambda *arguments: missed(free_motion(*arguments)))
    with pytest.raises(KeyboardInterrupt):
        cspr_jax.plan(KEYS | {"starts": 1, "pose": POSES})


@pytest.mark.thorough
def test_a_plan_says_whose_motion_it_is(monkeypatch):
    monkeypatch.setattr(leg, "free_motion", lambda *arguments: missed(free_motion(*arguments)))
    planned = cspr_jax.plan(KEYS | {"starts": 1, "pose": POSES})
    (segment,) = planned.to_dict()["segments"]
    assert planned.feasible
    assert segment["duration"] == pytest.approx(duration(planned.problem.robot), rel=1e-3)
    assert segment["energy"] > 0.0
    expected = 'the search found nothing faster than family = "hypocycloid-standard", whose motions these are'
    assert planned.warnings == (f'family = "free": {expected}',)
