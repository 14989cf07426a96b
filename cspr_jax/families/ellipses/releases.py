"""Releases from ellipses: the ellipse through a point with a given velocity, and the choice of what is left open.

An object that is to be released at p with velocity v is on the ellipse

    x = C + (p - C) cos(angle) + (v / w) sin(angle)

at the angle 0. At the natural frequency w it is feasible exactly if C lies below the hull of the spools and

    (rise of p - C)^2 + (rise of v / w)^2 < D^2,

with rises towards the plane of the spools and D the depth of C (`harmonics`), however far p lies to the side.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.frequencies import natural_frequency, sampled_slacks, searched_frequency
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import formula_hull
from cspr_jax.families.ellipses.transfers import Turning, motion_between, smallest_transfer
from cspr_jax.launch.flight import Parabola, aimed, flown
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.verification.proved_answers import MotionProof, proof_of, sampled_proof

# Shortest and longest time of flight of a grid, times the natural frequency at the centre, and the number of times.
SHORTEST = 0.01
LONGEST = 100.0
GRID = 257
COARSE_GRID = 33  # number of times of flight tried for each number of arcs
HALVINGS = 40  # bisections for an end of the feasible times
PROVED_HALVINGS = 24  # bisections for such an end, by proofs
PASSES = 8  # number of grids, each about the best time of the previous one
# Distances tried from an end of the feasible times, over the distance from the end to their middle.
INSIDE = (1e-3, 1e-2, 1e-1)
SAMPLES = 256  # samples of a transfer
# Frequencies are searched for from 1 / WIDEST to WIDEST times the natural one.
WIDEST = 100.0


@dataclasses.dataclass(frozen=True)
class Release(Turning):
    """Ellipse from which an object is released after a whole number of turns; see `Turning`.

    Fields:
        flight_time: time of flight, s.
    """

    flight_time: float = math.nan


class ReleaseRequirement(NamedTuple):
    """Requirements of a release.

    Fields:
        problem: robot and limits.
        scene: bodies that can touch each other.
        parabola: flight of the object.
        centre: (3,) centre of the ellipse, from the centroid of the spools, z down, m.
        turns: number of turns on the ellipse before the release.
    """

    problem: Problem
    scene: Scene | None
    parabola: Parabola
    centre: np.ndarray
    turns: float

    def states(self, times: Any) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Positions and velocities of releases, by time of flight."""
        parabola, gravity = self.parabola, self.problem.robot.gravity
        time = np.asarray(times, float)[:, None]
        if parabola.point is None:
            return flown(parabola.target, parabola.velocity, gravity, -time)
        velocity = aimed(parabola.point, parabola.target, gravity, time)
        return np.broadcast_to(parabola.point, velocity.shape), velocity

    def ellipses(self, times: Any, frequencies: Float[np.ndarray, "n"]) -> Ellipse:
        """Ellipses through the points of release with the velocities of release."""
        position, velocity = self.states(times)
        return Ellipse(
            np.broadcast_to(self.centre, position.shape), position - self.centre, velocity / frequencies[:, None]
        )

    def slacks(self, times: Any, frequencies: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Slacks of the ellipses, positive if feasible: the smaller of samples' and, where they hold, formulas'."""
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
        """Release after a given time of flight, at a given frequency, after a whole number of turns."""
        ellipse = Ellipse(*(array[0] for array in self.ellipses([time], np.array([frequency]))))
        return Release(ellipse, frequency, -2.0 * math.pi * self.turns, flight_time=time)


def chosen_release(
    requirement: ReleaseRequirement, before: Turning, rule: str | float, choose: str | None, arcs: range
) -> Release:
    """Release of a launch; time of flight and frequency are chosen where the launch does not give them."""
    nothing = np.zeros(3)
    natural = natural_frequency(requirement.problem, Ellipse(requirement.centre, nothing, nothing))
    frequency, time = rule if isinstance(rule, float) else natural, requirement.parabola.time
    if time is None:
        times = _Times(requirement, frequency, natural)
        time = times.of_least_energy(before, arcs) if choose == "energy" else times.of_earliest_landing(before, arcs)
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
    # A grid of times of flight at one frequency, and the slacks of their ellipses.

    def __init__(self, requirement: ReleaseRequirement, frequency: float, natural: float) -> None:
        self._requirement = self._allowed = requirement
        self._frequency = frequency
        self._grid = np.geomspace(SHORTEST / natural, LONGEST / natural, GRID)
        self._slacks = self._slack(self._grid)
        if not (self._slacks > 0.0).any():
            self._find_one()

    def _find_one(self) -> None:
        # Search between the times of the grid: the one with the largest slack may be feasible, or touch the limits.
        grid, slacks = self._grid, self._slacks
        for _ in range(PASSES):
            at = int(slacks.argmax())
            grid = np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)], COARSE_GRID)
            slacks = self._slack(grid)
        best = grid[slacks.argmax()][None]
        for requirement in (self._touching, self._requirement):
            slack = self._slack(best, requirement)
            if slack[0] > 0.0:
                self._allowed, self._grid, self._slacks = requirement, best, slack

    @property
    def _touching(self) -> ReleaseRequirement:
        return self._requirement._replace(problem=touchable(self._requirement.problem))

    def of_least_energy(self, before: Turning, arcs: range) -> float:
        # The energy is convex in the time: if its minimum is infeasible, the best time is an end of feasible times.
        lowest, slacks = self._slowest(), self._slacks
        if self._slack(np.array([lowest]), self._touching)[0] > 0.0:
            return lowest
        feasible = np.flatnonzero(slacks > 0.0)
        if not len(feasible) or len(slacks) == 1:
            return float(self._grid[slacks.argmax()])
        energy = (self._requirement.states(self._grid)[1] ** 2).sum(1)
        at = int(feasible[energy[feasible].argmin()])
        inside, grid = float(self._grid[at]), self._grid
        # The grid has no feasible time between this one and the minimum.
        if inside < lowest:
            outside = min(lowest, grid[grid > inside].min(initial=np.inf))
        else:
            outside = max(lowest, grid[grid < inside].max(initial=0.0))
        end = _narrowed(self._slack, inside, outside)
        time = end + INSIDE[0] * (self._middle(at) - end)
        problem, turns, scene = self._requirement.problem, self._requirement.turns, self._requirement.scene
        fixed, release = arcs.start if len(arcs) == 1 else 0, self._requirement.release(time, self._frequency)
        transfer = smallest_transfer(problem, before, release, turns, scene, arcs=fixed, max_arcs=arcs.stop - 1)
        return self._touched(before, time, end, transfer.arcs) if transfer.proof.is_feasible else time

    def of_earliest_landing(self, before: Turning, arcs: range) -> float:
        # Fewer arcs take less time, but are feasible only for slower releases.
        feasible = np.flatnonzero(self._slacks > 0.0)
        best, landing = None, np.inf
        if not len(feasible):
            return float(self._grid[self._slacks.argmax()])
        grid = self._grid[feasible[np.unique(np.linspace(0, len(feasible) - 1, COARSE_GRID).astype(int))]]
        for number in arcs:
            duration = float(self._transfer(before, float(grid[0]), number).duration())
            times = self._earliest(before, grid[grid + duration < landing], number)
            if times is not None:
                best, landing = (*times, number), times[0] + duration
        return self.of_least_energy(before, arcs) if best is None else self._touched(before, *best)

    def _earliest(self, before: Turning, grid: np.ndarray, number: int) -> tuple[float, float] | None:
        # Return the shortest proved time of flight with this number of arcs, and the end of such times.
        def slack(times: np.ndarray) -> np.ndarray:
            problem, scene = self._allowed.problem, self._allowed.scene
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
                return time, end
        return None

    def _touched(self, before: Turning, time: float, end: float, number: int) -> float:
        # Return a proved time beside an end, or, where only limits set the end, the end itself: they may be touched.
        problem, mirrored = self._requirement.problem, 2.0 * end - time
        if problem.limits.uncertainty is not None:
            return time
        # Narrow the limits by as much as proofs widen them.
        limits = jax.tree.map(lambda limit, wide: 2.0 * limit - wide, problem.limits, self._touching.problem.limits)
        aimed_at = problem._replace(limits=limits)

        def proof(at: float) -> MotionProof:
            return proof_of(aimed_at, self._transfer(before, at, number, 1.0), self._requirement.scene, intervals=False)

        outside = proof(mirrored)
        may_touch = np.array([row.allowance > 0.0 for row in outside.criteria])
        if not ((outside.proof.low > 0.0) | may_touch).all():
            return time
        return _narrowed(lambda times: [proof(float(times[0])).is_feasible], time, mirrored, PROVED_HALVINGS)

    def _transfer(self, before: Turning, time: float, number: int, more_turns: float = 0.0) -> Any:
        release = self._requirement.release(time, self._frequency)
        problem, turns = self._requirement.problem, self._requirement.turns
        return motion_between(problem.amplitude, before, release, number, turns + more_turns)

    def _slack(self, times: np.ndarray, requirement: ReleaseRequirement | None = None) -> np.ndarray:
        return (requirement or self._allowed).slacks(times, np.full(len(times), self._frequency))

    def _slowest(self) -> float:
        # Return the time of flight of the slowest release, by a formula; if the velocity at the target is given, the
        # release is slowest at the summit of the parabola.
        parabola, gravity = self._requirement.parabola, float(self._requirement.problem.robot.gravity)
        if parabola.velocity is None:
            time = math.sqrt(2.0 * float(np.linalg.norm(parabola.target - parabola.point)) / gravity)
        else:
            time = float(parabola.velocity[2]) / gravity
        return max(time, float(self._grid[0]))

    def _middle(self, at: int) -> float:
        # Return the time of largest slack in the feasible interval around a feasible time.
        is_out = np.flatnonzero(self._slacks <= 0.0)
        low, high = is_out[is_out < at].max(initial=-1) + 1, is_out[is_out > at].min(initial=GRID)
        return float(self._grid[low + self._slacks[low:high].argmax()])


def _narrowed(slack: Callable, inside: float, outside: float, halvings: int = HALVINGS) -> float:
    # Return the end of the feasible times between a feasible and an infeasible time.
    for _ in range(halvings):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if slack(np.array([middle]))[0] > 0.0 else (inside, middle)
    return inside
