"""Releases from ellipses: the ellipse that passes a point with a given velocity, and choices that a launch leaves open.

An object that is to leave at the point p with the velocity v leaves the ellipse

    x = C + (p - C) cos(angle) + (v / w) sin(angle)

at the angle 0. At the natural frequency w it is feasible exactly if C lies below the hull of the spools and

    (rise of p - C)^2 + (rise of v / w)^2 < D^2,

with rises towards the plane of the spools and D the depth of C (`harmonics`): however far aside p lies.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.frequencies import natural_frequency, sampled_slacks, searched_frequency
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import formula_hull
from cspr_jax.families.ellipses.transfers import Turning, motion_between
from cspr_jax.launch.flight import Parabola, aimed, flown
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.proved_answers import proof_of, sampled_proof

# Times of flight of a grid, over the time of a fall from the plane of the spools to the centre, and their number.
SHORTEST = 0.01
LONGEST = 100.0
GRID = 257
COARSE_GRID = 33  # times of flight for each number of arcs
HALVINGS = 40  # of an interval that holds an end of the feasible times
# Distances from an end of the feasible times that are tried, over the distance to their middle.
INSIDE = (1e-3, 1e-2, 1e-1)
SAMPLES = 256  # of a transfer
# Frequencies are sought from 1 / WIDEST to WIDEST times the natural one.
WIDEST = 100.0


@dataclasses.dataclass(frozen=True)
class Release(Turning):
    """Ellipse from which an object is released, at a whole number of turns; see `Turning`.

    Fields:
        flight_time: s.
    """

    flight_time: float = math.nan


class ReleaseRequirement(NamedTuple):
    """Requirements of a release.

    Fields:
        problem: robot and limits.
        scene: bodies that can meet.
        parabola: flight of the object.
        centre: (3,) of the ellipse, from the centroid of the spools, z down, m.
        turns: on the ellipse before the release.
    """

    problem: Problem
    scene: Scene | None
    parabola: Parabola
    centre: np.ndarray
    turns: float

    def states(self, times: Any) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Position and velocity of the release."""
        parabola, gravity = self.parabola, self.problem.robot.gravity
        time = np.asarray(times, float)[:, None]
        if parabola.point is None:
            return flown(parabola.target, parabola.velocity, gravity, -time)
        velocity = aimed(parabola.point, parabola.target, gravity, time)
        return np.broadcast_to(parabola.point, velocity.shape), velocity

    def ellipses(self, times: Any, frequencies: Float[np.ndarray, "n"]) -> Ellipse:
        """Ellipses that pass the point of the release with its velocity."""
        position, velocity = self.states(times)
        return Ellipse(
            np.broadcast_to(self.centre, position.shape), position - self.centre, velocity / frequencies[:, None]
        )

    def slacks(self, times: Any, frequencies: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Slacks of the ellipses, positive where they are feasible: of samples, and of formulas where these hold."""
        ellipses = self.ellipses(times, frequencies)
        each = Ellipse(*(array[:, None] for array in ellipses))
        return np.fmin(self.margins(ellipses, frequencies), sampled_slacks(self.problem, each, frequencies, self.scene))

    def margins(self, ellipses: Ellipse, frequencies: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Margins of ellipses by formulas."""
        hull = formula_hull(self.problem.robot)
        if hull is None:
            return np.full(len(frequencies), np.nan)
        return harmonics.of_many(harmonics.least_margin, hull, ellipses, frequencies)

    def release(self, time: float, frequency: float) -> Release:
        """Release after a whole number of turns."""
        ellipse = Ellipse(*(array[0] for array in self.ellipses([time], np.array([frequency]))))
        return Release(ellipse, frequency, -2.0 * math.pi * self.turns, flight_time=time)


def chosen_release(
    requirement: ReleaseRequirement, before: Turning, rule: str | float, choose: str | None, arcs: range
) -> Release:
    """Release of a launch, with the time of flight and the frequency chosen where the launch does not give them."""
    nothing = np.zeros(3)
    natural = natural_frequency(requirement.problem, Ellipse(requirement.centre, nothing, nothing))
    frequency, time = rule if isinstance(rule, float) else natural, requirement.parabola.time
    if time is None:
        times = _Times(requirement, frequency, natural)
        time = times.of_least_energy() if choose == "energy" else times.of_earliest_landing(before, arcs)
    if isinstance(rule, str) and rule != "natural":
        frequency = _by_rule(requirement, time, rule, natural)
    return requirement.release(time, frequency)


def _by_rule(requirement: ReleaseRequirement, time: float, rule: str, natural: float) -> float:
    has_formula = formula_hull(requirement.problem.robot) is not None

    def slack(frequencies: np.ndarray) -> np.ndarray:
        times = np.full(len(frequencies), time)
        if rule == "best" and has_formula:
            return requirement.margins(requirement.ellipses(times, frequencies), frequencies)
        return requirement.slacks(times, frequencies)

    return searched_frequency(slack, natural / WIDEST, natural * WIDEST, natural, rule)


class _Times:
    # Times of flight at one frequency, and which of them have feasible ellipses.

    def __init__(self, requirement: ReleaseRequirement, frequency: float, natural: float) -> None:
        self._requirement, self._frequency = requirement, frequency
        self._grid = np.geomspace(SHORTEST / natural, LONGEST / natural, GRID)
        self._slacks = self._slack(self._grid)

    def of_least_energy(self) -> float:
        # The energy is convex in the time: if its minimum is infeasible, the best time is an end of feasible times.
        lowest, slacks = self._slowest(), self._slacks
        if self._slack(np.array([lowest]))[0] > 0.0:
            return lowest
        feasible = np.flatnonzero(slacks > 0.0)
        if not len(feasible):
            return float(self._grid[slacks.argmax()])
        energy = (self._requirement.states(self._grid)[1] ** 2).sum(1)
        at = int(feasible[energy[feasible].argmin()])
        inside, grid = float(self._grid[at]), self._grid
        # No time of the grid is feasible between this time and the minimum.
        if inside < lowest:
            outside = min(lowest, grid[grid > inside].min(initial=np.inf))
        else:
            outside = max(lowest, grid[grid < inside].max(initial=0.0))
        end = _narrowed(self._slack, inside, outside)
        return end + INSIDE[0] * (self._middle(at) - end)

    def of_earliest_landing(self, before: Turning, arcs: range) -> float:
        # Fewer arcs take less time, but are feasible only for slower releases.
        feasible = np.flatnonzero(self._slacks > 0.0)
        best, landing = None, np.inf
        if not len(feasible):
            return float(self._grid[self._slacks.argmax()])
        grid = self._grid[feasible[np.unique(np.linspace(0, len(feasible) - 1, COARSE_GRID).astype(int))]]
        for number in arcs:
            duration = float(self._transfer(before, float(grid[0]), number).duration())
            time = self._earliest(before, grid[grid + duration < landing], number)
            if time is not None:
                best, landing = time, time + duration
        return self.of_least_energy() if best is None else best

    def _earliest(self, before: Turning, grid: np.ndarray, number: int) -> float | None:
        # The shortest time of flight whose transfer, with this number of arcs, is proved.
        def slack(times: np.ndarray) -> np.ndarray:
            problem, scene = self._requirement.problem, self._requirement.scene
            proofs = [sampled_proof(problem, self._transfer(before, t, number), scene, SAMPLES) for t in times.tolist()]
            slacks = np.array([(proof.proof.high / proof.scales).min() for proof in proofs])
            return np.minimum(slacks, self._slack(times))

        first = next((i for i, time in enumerate(grid) if slack(grid[i : i + 1])[0] > 0.0), None)
        if first is None:
            return None
        end = float(grid[first])
        if first:
            end = _narrowed(slack, end, float(grid[first - 1]))
        inside = float(grid[min(first + 1, len(grid) - 1)])
        for fraction in INSIDE:
            time = end + fraction * (inside - end)
            if not proof_of(
                self._requirement.problem, self._transfer(before, time, number), self._requirement.scene
            ).verdict:
                return time
        return None

    def _transfer(self, before: Turning, time: float, number: int) -> Any:
        release = self._requirement.release(time, self._frequency)
        problem, turns = self._requirement.problem, self._requirement.turns
        return motion_between(problem.amplitude, before, release, number, turns)

    def _slack(self, times: np.ndarray) -> np.ndarray:
        return self._requirement.slacks(times, np.full(len(times), self._frequency))

    def _slowest(self) -> float:
        # The time of flight with the slowest release, by a formula; if the velocity at the target is given, the release
        # is slowest at the summit of the parabola.
        parabola, gravity = self._requirement.parabola, float(self._requirement.problem.robot.gravity)
        if parabola.velocity is None:
            time = math.sqrt(2.0 * float(np.linalg.norm(parabola.target - parabola.point)) / gravity)
        else:
            time = float(parabola.velocity[2]) / gravity
        return max(time, float(self._grid[0]))

    def _middle(self, at: int) -> float:
        # The time of the largest slack among the feasible ones around a feasible one.
        is_out = np.flatnonzero(self._slacks <= 0.0)
        low, high = is_out[is_out < at].max(initial=-1) + 1, is_out[is_out > at].min(initial=GRID)
        return float(self._grid[low + self._slacks[low:high].argmax()])


def _narrowed(slack: Callable, inside: float, outside: float) -> float:
    # The end of the feasible times between a feasible and an infeasible one.
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if slack(np.array([middle]))[0] > 0.0 else (inside, middle)
    return inside
