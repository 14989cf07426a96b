"""Verdicts about all robots within an uncertainty, over blocks of time: proved, or refuted by one of these robots.

The motion is the planned one; spools, mass centre and mass differ from the plan's. With W the structure matrix and w
the wrench per mass in the middle of a block, W mu = w, and E what rays within the block and displaced spools add to W,
the tensions mu' of another robot differ from the planned ones mu at the same instant by d = mu' - mu,

    |d| <= A |d| + B mu + b,    so |d| <= (1 - A)^-1 (B mu + b)  where the spectral radius of A = G + B is below 1,

component by component. G_kj is |g_kj . the way of ray j| plus |g_kj| times the distance of the ray from its tangent,
B_kj is |g_kj across ray j| times the largest displacement of spool j, and b is the effect of the mass centre:
docs/theory.md. Then no such robot is singular either.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, NamedTuple

import jax
import numpy as np

from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.elementary import unit_vectors
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.robots.model.limits import Limits, Uncertainty
from cspr_jax.verification.bounds.enclosures import Enclosure, Influence, inverted, structure
from cspr_jax.verification.robustness.cable_rates import rates_fail, rates_hold

if TYPE_CHECKING:
    from jaxtyping import Float

# Blocks of which nothing is known have infinite bounds and no inverse: NaN proves nothing, and refutes nothing.
UNKNOWN = np.errstate(invalid="ignore", divide="ignore", over="ignore")
# Largest relative error of solving for a deviation, and of the tensions.
SOLVING_ERROR = 1e-9
# Rounds in which functionals are corrected, and the relative surplus of each correction.
ROUNDS, SPARE = 8, 0.01


@dataclasses.dataclass(frozen=True)
class Requirements:
    """Requirements on all robots within an uncertainty.

    Fields:
        mass: kg.
        slack: tension per mass and length over the slack of a taut cable, g / (n z0), 1/s^2, (n,) for each motion.
        limits: the limits as proofs take them, NumPy.
        uncertainty: the uncertainty.
    """

    mass: float
    slack: np.ndarray
    limits: Limits
    uncertainty: Uncertainty


def requirements_of(problem: Problem, slack: Float[np.ndarray, "n"]) -> Requirements:
    """Return the requirements on all robots within the uncertainty of a problem."""
    limits = jax.tree.map(np.asarray, touchable(problem).limits)
    if limits.uncertainty is None:
        raise ValueError("limits of robots within an uncertainty have none")
    return Requirements(float(problem.robot.mass), slack, limits, limits.uncertainty)


class _Share(NamedTuple):
    # A multiple of an uncertainty, one for each block: radii (k,) m, and the factor of the mass.
    spools: np.ndarray
    centre: np.ndarray
    factor: np.ndarray


def _share(requirements: Requirements, multiple: np.ndarray) -> _Share:
    uncertainty = requirements.uncertainty
    return _Share(
        multiple * float(uncertainty.spool_positions),
        multiple * float(uncertainty.mass_centre),
        float(uncertainty.mass_factor) ** multiple,
    )


class _Reaches(NamedTuple):
    # Reach of k blocks and a multiple of the uncertainty, (k, n_cables) each: displacement of spools across rays, at
    # planned lengths; motion of rays from the middle, over their lengths; effect of the mass centre on tensions.
    off: np.ndarray
    tilt: np.ndarray
    centre: np.ndarray


def _reaches(known: Enclosure, influence: Influence, spools: np.ndarray, centre: np.ndarray) -> _Reaches:
    near = influence.lengths - known.moved
    fraction = spools[:, None] / np.where(near > 0.0, near, np.nan)
    # A displaced spool counts as one that is displaced across its ray alone, at the planned length.
    off = np.where(fraction < 1.0, spools[:, None] / np.sqrt(1.0 - fraction**2), np.nan)
    direct_effect, moment, force = (
        np.linalg.norm(x, axis=2) for x in (influence.centre, influence.moments, influence.forces)
    )
    acceleration_matrix, radius = (
        np.linalg.norm(known.acceleration_matrix, axis=(1, 2)) + known.acceleration_matrix_change,
        centre[:, None],
    )
    rest = (
        direct_effect
        + force * known.acceleration_matrix_change[:, None]
        + moment * (known.force_change + centre * acceleration_matrix)[:, None]
    )
    return _Reaches(off, np.minimum(known.moved / influence.lengths, 1.0), radius * rest)


def _changes(
    known: Enclosure, influence: Influence, vectors: np.ndarray, far: _Reaches
) -> tuple[np.ndarray, np.ndarray]:
    # Bound the changes of rays within blocks, and by displaced spools, along vectors (k, ..., n_cables, 3).
    shape = (len(vectors), *(1,) * (vectors.ndim - 3), *known.deviation.shape[1:])
    full = np.linalg.norm(vectors, axis=-1)
    units = (known.rays / influence.lengths[..., None]).reshape(*shape, 3)
    way, deviation, off, tilt = (
        known.way.reshape(*shape, 3),
        *(x.reshape(shape) for x in (known.deviation, far.off, far.tilt)),
    )
    along = np.sum(vectors * units, axis=-1)
    across = np.sqrt(np.maximum(full**2 - along**2, 0.0))
    return np.abs(np.sum(vectors * way, axis=-1)) + full * deviation, off * np.minimum(full, across + full * tilt)


@UNKNOWN
def deviations(
    known: Enclosure, influence: Influence, spools: Float[np.ndarray, "k"], centre: Float[np.ndarray, "k"]
) -> Float[np.ndarray, "k n_cables"]:
    """Largest differences between tensions of robots and the planned ones, at the same instant of a block."""
    far = _reaches(known, influence, spools, centre)
    within, displaced = _changes(known, influence, influence.spools, far)
    rest = (displaced @ known.high[..., None])[..., 0] + SOLVING_ERROR * known.high + far.centre
    return _solved(within + displaced, rest)


class Changes(NamedTuple):
    """Largest changes of tensions, per mass and length.

    Fields:
        down: (k, n_cables) 1/s^2; infinite where nothing is known.
        up: (k, n_cables) likewise.
    """

    down: np.ndarray
    up: np.ndarray


@UNKNOWN
def closer_changes(
    known: Enclosure,
    influence: Influence,
    spools: Float[np.ndarray, "k"],
    centre: Float[np.ndarray, "k"],
    off: Float[np.ndarray, "k n_cables"],
    least: Float[np.ndarray, "k n_cables"],
    *,
    upwards: bool,
) -> Changes:
    """Closer bounds of the changes of tensions, which hold as long as no tension falls below its smallest value.

    Change the planned robot into another one little by little, until a first tension mu'_k reaches its smallest value.
    All others are then above theirs, and at least 0. With c_j the terms of row k of B, mu'_k has changed by at most
    the largest sum of c_j mu'_j over such tensions, in which mu'_k itself is known. That sum is at most y . w for every
    functional y of wrenches whose products with the columns of the other robot's W are at least c_j.
    """
    far = _reaches(known, influence, spools, centre)
    within, displaced = _changes(known, influence, influence.spools, far)
    diagonal = np.eye(displaced.shape[1])[None] * displaced
    rest = np.sum(within * off[:, None], axis=2) + far.centre + SOLVING_ERROR * known.high
    down = _largest_sum(known, influence, displaced - diagonal, far) + rest + np.sum(diagonal, axis=2) * least
    is_valid = (known.low - down > least).all(1)
    up = _largest_sum(known, influence, displaced, far) + rest if upwards else np.full_like(down, np.inf)
    return Changes(*(np.where(is_valid[:, None], x, np.inf) for x in (down, up)))


def _largest_sum(known: Enclosure, influence: Influence, weights: np.ndarray, far: _Reaches) -> np.ndarray:
    # Bound the sum of tensions of any robot, none below 0, times each of the rows of weights (k, n_cables, n_cables).
    more = np.zeros_like(weights)
    for _ in range(ROUNDS):
        functional = np.einsum("kij,kjlx->kilx", weights + more, influence.spools)
        moved, shifted = _changes(known, influence, functional, far)
        more, last = (moved + shifted) * (1.0 + SPARE) + SOLVING_ERROR * np.max(weights, axis=2, keepdims=True), more
    # The last correction is enough for the functional of the round before; it must be enough for its own.
    functional = np.einsum("kij,kjlx->kilx", weights + last, influence.spools)
    moved, shifted = _changes(known, influence, functional, far)
    total = np.sum((weights + last) * (known.high + far.centre)[:, None] + moved * known.high[:, None], axis=2)
    is_valid = (moved + shifted <= last).all(2)
    return np.where(is_valid, total, np.inf)


def _solved(matrix: np.ndarray, rest: np.ndarray) -> np.ndarray:
    # Find x with x >= matrix x + rest, all of them positive, which proves the spectral radius of the matrix below 1.
    is_finite = np.isfinite(matrix).all((1, 2)) & np.isfinite(rest).all(1)
    count = matrix.shape[1]
    system = np.where(is_finite[:, None, None], np.eye(count) - matrix, np.eye(count))
    system = np.where((np.linalg.det(system) != 0.0)[:, None, None], system, np.eye(count))
    x = np.linalg.solve(system, np.where(is_finite[:, None], rest, 0.0)[..., None])[..., 0] * (1.0 + SOLVING_ERROR)
    holds = is_finite & (x > 0.0).all(1) & (rest > 0.0).all(1)
    holds &= ((matrix @ x[..., None])[..., 0] + rest <= x).all(1)
    return np.where(holds[:, None], x, np.inf)


@UNKNOWN
def holds(
    known: Enclosure, influence: Influence, requirements: Requirements, multiple: Float[np.ndarray, "k"]
) -> Float[np.ndarray, "k"]:
    """Prove that every robot within a multiple of the uncertainty meets all criteria within blocks."""
    fraction = _share(requirements, multiple)
    is_met = np.ones(len(multiple), bool)
    if float(requirements.uncertainty.spool_positions) > 0.0:
        is_met &= known.distances.hold(fraction.spools)
        is_met &= rates_hold(known, influence, requirements.limits, fraction.spools)
    off = deviations(known, influence, fraction.spools, fraction.centre)
    is_taut = _tensions_hold(known, influence, requirements, fraction, Changes(off, off))
    again = np.flatnonzero(is_met & ~is_taut & np.isfinite(off).all(1))
    if len(again):
        part = known.part(again), influence.part(again)
        part_share = _Share(*(x[again] for x in fraction))
        less = dataclasses.replace(requirements, slack=requirements.slack[again])
        upwards = requirements.limits.tension_max is not None
        closer = closer_changes(
            *part, part_share.spools, part_share.centre, off[again], _least(*part, less, part_share), upwards=upwards
        )
        is_taut[again] = _tensions_hold(*part, less, part_share, closer)
    return is_met & is_taut


def _least(known: Enclosure, influence: Influence, requirements: Requirements, fraction: _Share) -> np.ndarray:
    # Return the smallest tensions per mass and length that are allowed within blocks.
    minimum = np.repeat(SIX_CABLES_UNDECIDED * requirements.slack[:, None], influence.lengths.shape[1], axis=1)
    limit = requirements.limits.tension_min
    if limit is None:
        return minimum
    near = influence.lengths - known.moved
    return np.maximum(minimum, limit / (near * (requirements.mass / fraction.factor)[:, None]))


def _tensions_hold(
    known: Enclosure, influence: Influence, requirements: Requirements, fraction: _Share, changes: Changes
) -> np.ndarray:
    is_met = (known.low - changes.down > _least(known, influence, requirements, fraction)).all(1)
    limit = requirements.limits.tension_max
    if limit is None:
        return is_met
    near, far = influence.lengths - known.moved, influence.lengths + known.moved
    longest = far / np.sqrt(1.0 - np.minimum(fraction.spools[:, None] / near, 1.0) ** 2)
    maximum = (known.high + changes.up) * longest * (requirements.mass * fraction.factor)[:, None]
    return is_met & (maximum <= limit).all(1)


class WorstDisplacements(NamedTuple):
    """Unit displacements that are worst, to first order, in the middles of k blocks.

    Fields:
        spools: (1 or 2, k, n_cables, 3) of the spools: worst for the cable that falls slack first and, where a largest
            tension is given, for the cable that reaches it first.
        centre: (1 or 2, k, 3) of the mass centre, likewise.
    """

    spools: np.ndarray
    centre: np.ndarray


@UNKNOWN
def worst(known: Enclosure, influence: Influence, requirements: Requirements) -> WorstDisplacements:
    """Displacements that are worst to first order."""
    uncertainty, rows = requirements.uncertainty, np.arange(len(influence.mu))
    size = np.sum(np.linalg.norm(influence.across, axis=3) * np.abs(influence.mu)[:, None], axis=2)
    change = float(uncertainty.spool_positions) * size
    change += float(uncertainty.mass_centre) * np.linalg.norm(influence.centre, axis=2)
    limits, pull = requirements.limits, requirements.mass * influence.lengths
    low = 0.0 if limits.tension_min is None else limits.tension_min / pull
    rooms = [(influence.mu - low, 1.0)]
    if limits.tension_max is not None:
        rooms.append((np.asarray(limits.tension_max) / pull - influence.mu, -1.0))
    spools, centre = [], []
    for room, sign in rooms:
        cable = np.argmin(np.nan_to_num(room / change, nan=np.inf), axis=1)
        spools.append(sign * unit_vectors(influence.across[rows, cable] * np.sign(influence.mu)[..., None]))
        centre.append(-sign * unit_vectors(influence.centre[rows, cable]))
    return WorstDisplacements(np.stack(spools), np.stack(centre))


@UNKNOWN
def fails(
    known: Enclosure,
    influence: Influence,
    worst: WorstDisplacements,
    requirements: Requirements,
    multiple: Float[np.ndarray, "k"],
) -> Float[np.ndarray, "k"]:
    """Tell where a worst robot within a multiple of the uncertainty breaks a criterion in the middle of a block."""
    fraction, limits = _share(requirements, multiple), requirements.limits
    broken = np.zeros(len(multiple), bool)
    for spools, centre in zip(*worst, strict=True):
        mu, lengths = tensions(known, fraction.spools[:, None, None] * spools, fraction.centre[:, None] * centre)
        broken |= (mu < -SIX_CABLES_UNDECIDED * requirements.slack[:, None]).any(1)
        pull = requirements.mass * mu * lengths
        if limits.tension_min is not None:
            broken |= (pull / fraction.factor[:, None] < limits.tension_min).any(1)
        if limits.tension_max is not None:
            broken |= (pull * fraction.factor[:, None] > limits.tension_max).any(1)
    if float(requirements.uncertainty.spool_positions) > 0.0:
        broken |= known.distances.fail(fraction.spools)
        broken |= rates_fail(known, influence, limits, fraction.spools)
    return broken


def tensions(
    known: Enclosure, spools: Float[np.ndarray, "k n_cables 3"], centre: Float[np.ndarray, "k 3"]
) -> tuple[Float[np.ndarray, "k n_cables"], Float[np.ndarray, "k n_cables"]]:
    """Tensions of other robots in the middles of blocks."""
    rays, is_platform = known.rays - spools, bool(known.arms.any())
    extra = np.einsum("kij,kj->ki", known.acceleration_matrix, centre)
    force = known.force + extra
    wrench = np.concatenate([force, known.moment + np.cross(centre, force)], axis=1) if is_platform else force
    inverse = inverted(structure(rays, known.arms, is_platform=is_platform))
    return (inverse @ wrench[..., None])[..., 0], np.linalg.norm(rays, axis=2)
