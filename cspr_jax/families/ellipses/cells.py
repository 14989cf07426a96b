"""Turns on many ellipses: frequencies and margins by formulas, limits by the proof for any motion."""

from __future__ import annotations

import dataclasses
import itertools
import math

import jax
import numpy as np

from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import SpoolHull, edge_ends, formula_hull
from cspr_jax.motion.limits import limits_set
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds
from cspr_jax.numerics.bounds.function_bounds import sincospi
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.robots.bounds.state_bounds import StateBounds
from cspr_jax.robots.model.point_mass import PointMassRobot, plane_normal, spool_radius
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.schema.columns import Columns
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_answers import MotionProof, answers_of, proofs_of

# Bound of the rounding error of a margin, over the largest number in its formula.
MARGIN_ERROR = 256.0 * float(np.finfo(float).eps)
BATCH = 64  # number of blocks whose bounds are computed at a time
TOGETHER = 1024  # number of turns proved at a time
# An angle just above a full turn, so that rounding leaves no part of the turn out.
TURN = math.nextafter(2.0 * math.pi, 7.0)


@dataclasses.dataclass(frozen=True)
class EllipseCells(Columns):
    """Turns on n ellipses; rows of `schema.quantities` describe each field.

    Fields:
        verdict: (n,) flags of `Verdict` at `used_frequency`.
        margin: (n,) smallest normalised pseudotension or depth at `used_frequency`; NaN where no formula holds.
        used_frequency: (n,) rad/s.
        lowest_frequency: (n,) rad/s.
        highest_frequency: (n,) rad/s.
        natural_frequency: (n,) rad/s.
        binding_cable: (n,) names of `schema.meanings.slack_cables`.
        duration: (n,) duration of a turn, s.
        tension_margin: (n,) N; NaN where no proof bounds it.
        limit_margin: (n,) margin of other limits; NaN likewise.
    """

    verdict: np.ndarray
    margin: np.ndarray
    used_frequency: np.ndarray
    lowest_frequency: np.ndarray
    highest_frequency: np.ndarray
    natural_frequency: np.ndarray
    binding_cable: np.ndarray
    duration: np.ndarray
    tension_margin: np.ndarray
    limit_margin: np.ndarray


def ellipse_cells(problem: Problem, ellipses: Ellipse, frequencies: Float[np.ndarray, "n"] | str) -> EllipseCells:
    """Answers of one turn on each ellipse."""
    robot, count = problem.robot, len(ellipses.centre)
    depth = np.asarray(ellipses.centre) @ np.asarray(plane_normal(robot))
    with np.errstate(invalid="ignore", divide="ignore"):
        natural = np.where(depth > 0.0, np.sqrt(float(robot.gravity) / depth), np.nan)
    nothing = np.full(count, np.nan)
    hull = formula_hull(robot)
    low, high = (nothing, nothing) if hull is None else harmonics.of_many(harmonics.frequency_interval, hull, ellipses)
    if not isinstance(frequencies, str):
        used = np.asarray(frequencies, float)
    elif hull is not None and frequencies == "best":
        used = harmonics.of_many(harmonics.best_frequency, hull, ellipses)
    else:
        used = natural
    has_frequency = np.isfinite(used)
    if hull is None:
        verdict = np.where(has_frequency, FLAGS(Verdict.UNDECIDED.value), FLAGS(Verdict.NOT_FINITE.value))
        margin, binding = nothing, np.zeros(count, int)
    else:
        # If no frequency is feasible, any frequency shows what fails: take the natural one.
        margins, rounding = _margins(hull, robot, ellipses, np.where(has_frequency, used, np.nan_to_num(natural)))
        verdict = _verdict(robot, margins, rounding)
        margin = np.where(has_frequency, margins.min(1), np.nan)
        binding = np.where(has_frequency, _binding(robot, margins, rounding), 0)
    tension, other = nothing.copy(), nothing.copy()
    if hull is None or limits_set(problem.limits):
        open_cells = np.flatnonzero(has_frequency & ((verdict == 0) | (verdict == Verdict.UNDECIDED.value)))
        chosen = Turns(Ellipse(*(np.asarray(array)[open_cells] for array in ellipses)), used[open_cells])
        answers = answers_of(turn_proofs(problem, chosen), chosen.frequencies)
        verdict[open_cells], tension[open_cells] = answers.verdict, answers.margin
        other[open_cells] = answers.limit_margin
    with np.errstate(divide="ignore"):
        duration = 2.0 * np.pi / used
    return EllipseCells(verdict, margin, used, low, high, natural, binding, duration, tension, other)


def _margins(
    hull: SpoolHull, robot: PointMassRobot, ellipses: Ellipse, frequencies: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    # Return the smallest values of the edges and of the depth, (n, n_edges + 1), and their rounding errors, (n, 1).
    margins = harmonics.of_many(harmonics.harmonic_margins, hull, ellipses, frequencies)
    centre, a, b = (np.linalg.norm(array, axis=1) for array in ellipses)
    normal = np.asarray(hull.normal)
    normal_norm, steepest = float(np.linalg.norm(normal)), float(np.linalg.norm(np.asarray(hull.edges), axis=1).max())
    depth = np.abs(np.asarray(ellipses.centre) @ normal)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        rise, far = normal_norm * (a + b) / depth, 1.0 + normal_norm * centre / depth
        e = 1.0 + frequencies**2 * depth / float(hull.gravity)
        magnitude = (1.0 + steepest * centre) * (1.0 + rise * (1.0 + e)) + e * steepest * (a + b)
        rounding = MARGIN_ERROR * far * (1.0 + steepest * float(spool_radius(robot))) * magnitude
    return margins, np.nan_to_num(rounding, nan=np.inf)[:, None]


def _verdict(robot: PointMassRobot, margins: np.ndarray, rounding: np.ndarray) -> np.ndarray:
    is_broken, is_open = margins < -rounding, ~(margins > rounding)
    slack, above = (Verdict.SLACK_CABLE, Verdict.ABOVE_SPOOLS)
    if robot.n_cables > robot.dof:
        slack = above = Verdict.WRENCH_INFEASIBLE
    flags = np.where(is_broken[:, :-1].any(1), slack.value, 0) | np.where(is_broken[:, -1], above.value, 0)
    undecided = np.where(is_open.any(1), Verdict.UNDECIDED.value, 0)
    return np.where(flags != 0, flags, undecided).astype(FLAGS)


def _binding(robot: PointMassRobot, margins: np.ndarray, rounding: np.ndarray) -> np.ndarray:
    # Among equals, as on symmetric robots, take the first cable.
    first = np.argmax(margins <= margins.min(1, keepdims=True) + rounding, axis=1)
    if robot.n_cables == robot.dof:
        return first + 1
    pairs = list(itertools.combinations(range(robot.n_cables), robot.dof - 1))
    ends = edge_ends(np.asarray(robot.base_points), robot.dof)
    numbers = [pairs.index(tuple(sorted(pair))) + 1 for pair in ends.tolist()]
    return np.array([*numbers, len(pairs) + 1])[first]


@dataclasses.dataclass(frozen=True)
class Turns:
    """One turn on each of n ellipses; time is the angle, so that slow turns have a limit.

    Fields:
        ellipses: the n ellipses, leaves (n, 3).
        frequencies: (n,) rad/s; 0 is the limit of slow turns.
    """

    ellipses: Ellipse
    frequencies: np.ndarray

    def bounds(
        self, motion: Int[np.ndarray, "k"], start: Float[np.ndarray, "k"], end: Float[np.ndarray, "k"]
    ) -> StateBounds:
        """Bounds of the states over blocks of angles."""
        chosen = Ellipse(*(np.asarray(array)[motion] for array in self.ellipses))
        return in_batches(_bounds, (chosen, self.frequencies[motion], start, end), batch_size=BATCH)


@persistent_jit
def _bounds(blocks: tuple) -> StateBounds:
    def one(block: tuple) -> StateBounds:
        (centre, a, b), rate, start, end = block
        angle = AffineBounds(0.5 * (start + end), 0.5 * (end - start), 0.0 * start) * (1.0 / math.pi)
        sine, cosine = sincospi(angle.each(lambda x: x[None]))
        outward, forward = cosine * a + sine * b, cosine * b - sine * a
        return StateBounds(outward + centre, forward * rate, outward * -(rate**2))

    return jax.vmap(one)(blocks)


def turn_proofs(problem: Problem, turns: Turns) -> list[MotionProof]:
    """Proofs of one turn on each ellipse."""
    proofs: list[MotionProof] = []
    for first in range(0, len(turns.frequencies), TOGETHER):
        part = slice(first, first + TOGETHER)
        chunk = Turns(Ellipse(*(array[part] for array in turns.ellipses)), turns.frequencies[part])
        proofs += proofs_of(problem, chunk.bounds, np.full(len(chunk.frequencies), TURN))
    return proofs
