"""Free motions that are the best in energy, largest tension or margin: closed forms, and each against least times."""

import numpy as np
import pytest
from oracles import least_time_forms
from support.free_motions import QUICK, solve

from cspr_jax.families.free import proofs
from cspr_jax.families.free.free_motion import free_motion
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.families.free.search import interior_point
from cspr_jax.families.free.search.newton import newton_step
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import guided_robot
from cspr_jax.robots.statics.kernel_axes import centred

RING = least_time_forms.ring_robot(3, 1.0, 2.0)
WEIGHT = 2.0 * 9.81
LIMITS = {"tension_min": np.full(3, 0.02 * WEIGHT), "tension_max": np.full(3, 0.8 * WEIGHT)}
ASIDE = np.array([[0.3, 0.1, 1.0], [-0.2, 0.3, 1.4]])
LONGEST = 0.9


def best(objective, limits=LIMITS, **settings):
    free, _ = solve(RING, limits, ASIDE, settings=QUICK._replace(objective=objective, **settings))
    assert free.is_optimal
    assert free.answers.feasible.all()
    return free


@pytest.mark.thorough
def test_energy_of_a_guided_weight(monkeypatch):
    """Cubics have the least sum of squared accelerations: of m^2 (g^2 T + 12 d^2 / T^3) half is paid for by a cable up
    and one down, which may push; it is least at T^2 = 6 d / g.
    """
    monkeypatch.setattr(proofs, "ROUNDS", 1)  # what the search finds is compared, before a proof tightens it
    mass, gravity, way = 2.0, 9.81, 0.3
    with double_precision():
        robot, frame = centred(guided_robot([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]], mass=mass, gravity=gravity))
        push = as_float64(np.full(2, 9.0 * mass * gravity))
        problem = Problem(robot, Limits(tension_min=-push, tension_max=push), named("A1"))
        places = frame.inward(np.array([[0.0, 0.0, 0.6], [0.0, 0.0, 0.6 + way]]))
        poses = FreePoses(places, None, np.zeros((2, 3)), np.full((2, 3), np.nan), 1.0)
        time = np.sqrt(6.0 * way / gravity)
        for longest in (None, 0.7 * time):
            free = free_motion(problem, None, poses, QUICK._replace(objective="energy", longest=longest))
            least = time if longest is None else longest
            energy = 0.5 * mass**2 * (gravity**2 * least + 12.0 * way**2 / least**3)
            assert free.is_optimal
            assert free.duration == pytest.approx(least, rel=1e-3)
            assert free.energy[0] == pytest.approx(energy, rel=1e-3)


@pytest.mark.thorough
@pytest.mark.parametrize("objective", ["tension", "margin"])
def test_least_time_within_the_best_level_is_the_longest_duration(objective):
    """Within the tensions of the best motion, no motion is faster than it."""
    free = best(objective, longest=LONGEST)
    assert free.duration == pytest.approx(LONGEST, rel=1e-5)
    low, high = LIMITS["tension_min"], LIMITS["tension_max"]
    if objective == "tension":
        level = free.level[0]
        assert 0.4 < level < 0.9
        within = LIMITS | {"tension_max": level * high}
    else:
        margin = -free.level[0] * WEIGHT
        assert free.answers.margin[0] == pytest.approx(margin, abs=0.02 * WEIGHT)
        within = {"tension_min": low + margin, "tension_max": high - margin}
    assert best("time", within).duration == pytest.approx(LONGEST, rel=3e-3)


@pytest.mark.thorough
def test_each_objective_is_the_best_in_what_it_is_for():
    energies = {name: best(name, longest=LONGEST).energy[0] for name in ("time", "energy", "tension", "margin")}
    assert all(energies["energy"] < energy for name, energy in energies.items() if name != "energy")
    assert best("time").duration < LONGEST


@pytest.mark.thorough
@pytest.mark.parametrize("objective", ["time", "tension", "margin"])
def test_no_segment_is_shorter_than_limits_allow(objective):
    """The least time is 0.68 s; in less the best tensions break their limits."""
    free, _ = solve(RING, LIMITS, ASIDE, settings=QUICK._replace(objective=objective, longest=0.6))
    assert not free.is_optimal


@pytest.mark.thorough
def test_a_sequence_has_the_sum_of_its_segments():
    settings = QUICK._replace(objective="energy")
    places = np.array([*ASIDE, [0.1, -0.3, 1.2]])
    whole, _ = solve(RING, LIMITS, places, settings=settings)
    alone = [solve(RING, LIMITS, places[i : i + 2], settings=settings)[0].energy[0] for i in range(2)]
    assert sum(alone) * (1.0 - 1e-4) < whole.energy.sum()
    resting = np.full((3, 3), np.nan)
    resting[1] = 0.0
    assert whole.energy.sum() < solve(RING, LIMITS, places, resting, settings)[0].energy.sum()


def test_fewer_starts_and_no_time():
    """One start is enough here; without time there is the start, which is not proved."""
    few = best("time", starts=1)
    assert few.duration == pytest.approx(best("time").duration, rel=1e-3)
    free, _ = solve(RING, LIMITS, ASIDE, settings=QUICK._replace(until=0.0))
    assert free.is_stopped
    assert not free.is_optimal


@pytest.mark.parametrize("when", ["early", "searching", "joining", "tightening"])
def test_control_c_keeps_the_best_so_far(monkeypatch, when):
    """Where there is no motion yet on all intervals and instants, it ends the program as always."""
    interrupts, counts, fine = [KeyboardInterrupt], [], []

    def interrupted(tasks, unknowns, *others):
        counts.append(len(unknowns.duration))
        fine.append(len(tasks.basis.tau) == QUICK.intervals)
        is_due = {
            "early": True,
            "searching": counts[-1] < counts[0],  # once a search has ended, there is a motion
            "joining": fine[-1],
            # Only then bounds change along the motion.
            "tightening": any(np.ptp(side[..., :3], axis=2).any() for side in (tasks.low, tasks.high)),
        }
        if interrupts and is_due[when]:
            raise interrupts.pop()
        return newton_step(tasks, unknowns, *others)

    monkeypatch.setattr(interior_point, "newton_step", interrupted)
    if when in ("early", "joining"):
        with pytest.raises(KeyboardInterrupt):
            best("time")
    else:
        free, _ = solve(RING, LIMITS, ASIDE)
        assert free.is_stopped
        assert free.is_optimal
        assert free.answers.feasible.all() == (when == "searching")
    assert not interrupts
