"""Verdicts about all robots within an uncertainty, over blocks of time: proved, or refuted by one of these robots.

The motion is the planned one; spools, mass centre and mass differ from the plan. Let W be the structure matrix and w
the wrench per mass in the middle of a block, W mu = w, and E the change of W by displaced spools and by the motion of
rays within the block. Tensions mu' of another robot differ from the planned ones mu at the same time by d = mu' - mu,

    |d| <= A |d| + B mu + b,    so |d| <= (1 - A)^-1 (B mu + b)  where the spectral radius of A = G + B is below 1,

component by component. G_kj is |g_kj . the tangent of ray j| plus |g_kj| times the distance of the ray from its
tangent, B_kj is |part of g_kj across ray j| times the largest displacement of spool j, and b is the effect of the mass
centre (docs/theory.md). If this holds, no such robot is singular either.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import numpy as np

from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.elementary import unit_vectors
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.numerics.tolerances import SIX_CABLES_UNDECIDED
from cspr_jax.robots.model.limits import Limits, Uncertainty
from cspr_jax.verification.bounds.enclosures import Enclosure, Influence, inverted, structure
from cspr_jax.verification.robustness.cable_rates import rates_fail, rates_hold

# Blocks without an enclosure have infinite bounds and no inverse: they give NaN, which neither proves nor refutes.
UNKNOWN = np.errstate(invalid="ignore", divide="ignore", over="ignore")
# Largest relative error of solving for a deviation, and of the tensions.
SOLVING_ERROR = 1e-9
# Number of rounds in which functionals are corrected, and the relative surplus of each correction.
ROUNDS = 8
SPARE = 0.01


@dataclasses.dataclass(frozen=True)
class Requirements:
    """Requirements on all robots within an uncertainty.

    Fields:
        mass: kg.
        slack: (n,) for each motion, tension per mass and length over the slack of a taut cable, g / (n z0), 1/s^2.
        limits: limits widened for proofs, NumPy.
        uncertainty: the uncertainty.
    """

    mass: float
    slack: np.ndarray
    limits: Limits
    uncertainty: Uncertainty


def requirements_of(problem: Problem, slack: Float[np.ndarray, "n"]) -> Requirements:
    """Requirements on all robots within the uncertainty of a problem."""
    limits = jax.tree.map(np.asarray, touchable(problem).limits)
    if limits.uncertainty is None:
        raise ValueError("limits of robots within an uncertainty have none")
    return Requirements(float(problem.robot.mass), slack, limits, limits.uncertainty)


class _Radii(NamedTuple):
    # Multiple of an uncertainty for each block: radii (k,) m, and the factor of the mass.
    spools: np.ndarray
    centre: np.ndarray
    factor: np.ndarray


def _radii(requirements: Requirements, multiple: np.ndarray) -> _Radii:
    uncertainty = requirements.uncertainty
    return _Radii(
        multiple * float(uncertainty.spool_positions),
        multiple * float(uncertainty.mass_centre),
        float(uncertainty.mass_factor) ** multiple,
    )


class _Effects(NamedTuple):
    # Effects of a multiple of the uncertainty in k blocks, (k, n_cables) each: `off`, displacement of spools across
    # rays of planned lengths; `tilt`, motion of rays from the middle, over their lengths; `centre`, effect of the
    # mass centre on tensions.
    off: np.ndarray
    tilt: np.ndarray
    centre: np.ndarray


def _effects(enclosure: Enclosure, influence: Influence, spools: np.ndarray, centre: np.ndarray) -> _Effects:
    near = influence.lengths - enclosure.moved
    fraction = spools[:, None] / np.where(near > 0.0, near, np.nan)
    # Replace each displacement of a spool by one across the ray alone with the same effect at the planned length.
    off = np.where(fraction < 1.0, spools[:, None] / np.sqrt(1.0 - fraction**2), np.nan)
    direct_effect, moment, force = (
        np.linalg.norm(x, axis=2) for x in (influence.centre, influence.moments, influence.forces)
    )
    acceleration_matrix, radius = (
        np.linalg.norm(enclosure.acceleration_matrix, axis=(1, 2)) + enclosure.acceleration_matrix_change,
        centre[:, None],
    )
    rest = (
        direct_effect
        + force * enclosure.acceleration_matrix_change[:, None]
        + moment * (enclosure.force_change + centre * acceleration_matrix)[:, None]
    )
    return _Effects(off, np.minimum(enclosure.moved / influence.lengths, 1.0), radius * rest)


def _changes(
    enclosure: Enclosure, influence: Influence, vectors: np.ndarray, far: _Effects
) -> tuple[np.ndarray, np.ndarray]:
    # Bound changes of rays, within blocks and by displaced spools, along vectors (k, ..., n_cables, 3).
    shape = (len(vectors), *(1,) * (vectors.ndim - 3), *enclosure.deviation.shape[1:])
    full = np.linalg.norm(vectors, axis=-1)
    units = (enclosure.rays / influence.lengths[..., None]).reshape(*shape, 3)
    tangent, deviation, off, tilt = (
        enclosure.tangent.reshape(*shape, 3),
        *(x.reshape(shape) for x in (enclosure.deviation, far.off, far.tilt)),
    )
    along = np.sum(vectors * units, axis=-1)
    across = np.sqrt(np.maximum(full**2 - along**2, 0.0))
    return np.abs(np.sum(vectors * tangent, axis=-1)) + full * deviation, off * np.minimum(full, across + full * tilt)


@UNKNOWN
def deviations(
    enclosure: Enclosure, influence: Influence, spools: Float[np.ndarray, "k"], centre: Float[np.ndarray, "k"]
) -> Float[np.ndarray, "k n_cables"]:
    """Largest differences between tensions of robots and planned tensions at the same time of a block."""
    far = _effects(enclosure, influence, spools, centre)
    within, displaced = _changes(enclosure, influence, influence.spools, far)
    rest = (displaced @ enclosure.high[..., None])[..., 0] + SOLVING_ERROR * enclosure.high + far.centre
    return _solved(within + displaced, rest)


class Changes(NamedTuple):
    """Largest changes of tensions, per mass and length.

    Fields:
        down: (k, n_cables) largest decrease, 1/s^2; infinite where no bound is known.
        up: (k, n_cables) largest increase, 1/s^2; likewise.
    """

    down: np.ndarray
    up: np.ndarray


@UNKNOWN
def closer_changes(
    enclosure: Enclosure,
    influence: Influence,
    spools: Float[np.ndarray, "k"],
    centre: Float[np.ndarray, "k"],
    off: Float[np.ndarray, "k n_cables"],
    minimum: Float[np.ndarray, "k n_cables"],
    *,
    upwards: bool,
) -> Changes:
    """Closer bounds of the changes of tensions, which hold as long as no tension falls below its smallest value.

    Change the planned robot continuously into another one, until a first tension mu'_k reaches its smallest value. All
    other tensions are then above their smallest values, and at least 0. With c_j the entries of row k of B, mu'_k has
    changed by at most the largest sum of c_j mu'_j over such tensions, in which mu'_k itself is known. That sum is at
    most y . w for every functional y of wrenches whose products with the columns of the other robot's W are at least
    c_j.
    """
    far = _effects(enclosure, influence, spools, centre)
    within, displaced = _changes(enclosure, influence, influence.spools, far)
    diagonal = np.eye(displaced.shape[1])[None] * displaced
    rest = np.sum(within * off[:, None], axis=2) + far.centre + SOLVING_ERROR * enclosure.high
    down = _largest_sum(enclosure, influence, displaced - diagonal, far) + rest + np.sum(diagonal, axis=2) * minimum
    is_valid = (enclosure.low - down > minimum).all(1)
    up = _largest_sum(enclosure, influence, displaced, far) + rest if upwards else np.full_like(down, np.inf)
    return Changes(*(np.where(is_valid[:, None], x, np.inf) for x in (down, up)))


def _largest_sum(enclosure: Enclosure, influence: Influence, weights: np.ndarray, far: _Effects) -> np.ndarray:
    # Bound sums of tensions, none below 0, of any robot, weighted by the rows of weights (k, n_cables, n_cables).
    more = np.zeros_like(weights)
    for _ in range(ROUNDS):
        functional = np.einsum("kij,kjlx->kilx", weights + more, influence.spools)
        moved, shifted = _changes(enclosure, influence, functional, far)
        more, last = (moved + shifted) * (1.0 + SPARE) + SOLVING_ERROR * np.max(weights, axis=2, keepdims=True), more
    # The last correction was computed for the functional of the round before: test it for the corrected one.
    functional = np.einsum("kij,kjlx->kilx", weights + last, influence.spools)
    moved, shifted = _changes(enclosure, influence, functional, far)
    total = np.sum((weights + last) * (enclosure.high + far.centre)[:, None] + moved * enclosure.high[:, None], axis=2)
    is_valid = (moved + shifted <= last).all(2)
    return np.where(is_valid, total, np.inf)


def _solved(matrix: np.ndarray, rest: np.ndarray) -> np.ndarray:
    # Find a positive x with x >= matrix x + rest, which proves that the spectral radius of the matrix is below 1.
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
    enclosure: Enclosure, influence: Influence, requirements: Requirements, multiple: Float[np.ndarray, "k"]
) -> Bool[np.ndarray, "k"]:
    """Prove that every robot within a multiple of the uncertainty meets all criteria within blocks."""
    radii = _radii(requirements, multiple)
    is_met = np.ones(len(multiple), bool)
    if float(requirements.uncertainty.spool_positions) > 0.0:
        is_met &= enclosure.distances.hold(radii.spools)
        is_met &= rates_hold(enclosure, influence, requirements.limits, radii.spools)
    off = deviations(enclosure, influence, radii.spools, radii.centre)
    is_taut = _tensions_hold(enclosure, influence, requirements, radii, Changes(off, off))
    again = np.flatnonzero(is_met & ~is_taut & np.isfinite(off).all(1))
    if len(again):
        part = enclosure.part(again), influence.part(again)
        part_share = _Radii(*(x[again] for x in radii))
        less = dataclasses.replace(requirements, slack=requirements.slack[again])
        upwards = requirements.limits.tension_max is not None
        closer = closer_changes(
            *part,
            part_share.spools,
            part_share.centre,
            off[again],
            _minimum_tensions(*part, less, part_share),
            upwards=upwards,
        )
        is_taut[again] = _tensions_hold(*part, less, part_share, closer)
    return is_met & is_taut


def _minimum_tensions(
    enclosure: Enclosure, influence: Influence, requirements: Requirements, radii: _Radii
) -> np.ndarray:
    # Smallest tensions per mass and length that are allowed within blocks.
    minimum = np.repeat(SIX_CABLES_UNDECIDED * requirements.slack[:, None], influence.lengths.shape[1], axis=1)
    limit = requirements.limits.tension_min
    if limit is None:
        return minimum
    near = influence.lengths - enclosure.moved
    return np.maximum(minimum, limit / (near * (requirements.mass / radii.factor)[:, None]))


def _tensions_hold(
    enclosure: Enclosure, influence: Influence, requirements: Requirements, radii: _Radii, changes: Changes
) -> np.ndarray:
    is_met = (enclosure.low - changes.down > _minimum_tensions(enclosure, influence, requirements, radii)).all(1)
    limit = requirements.limits.tension_max
    if limit is None:
        return is_met
    near, far = influence.lengths - enclosure.moved, influence.lengths + enclosure.moved
    longest = far / np.sqrt(1.0 - np.minimum(radii.spools[:, None] / near, 1.0) ** 2)
    maximum = (enclosure.high + changes.up) * longest * (requirements.mass * radii.factor)[:, None]
    return is_met & (maximum <= limit).all(1)


class WorstDisplacements(NamedTuple):
    """Unit displacements that are worst, to first order, in the middles of k blocks.

    Fields:
        spools: (1 or 2, k, n_cables, 3) displacements of the spools that are worst for the cable that falls slack first
            and, where a largest tension is given, for the cable that reaches it first.
        centre: (1 or 2, k, 3) likewise displacements of the mass centre.
    """

    spools: np.ndarray
    centre: np.ndarray


@UNKNOWN
def worst(enclosure: Enclosure, influence: Influence, requirements: Requirements) -> WorstDisplacements:
    """Displacements that are worst, to first order, for tensions."""
    uncertainty, index = requirements.uncertainty, np.arange(len(influence.mu))
    norm = np.sum(np.linalg.norm(influence.across, axis=3) * np.abs(influence.mu)[:, None], axis=2)
    change = float(uncertainty.spool_positions) * norm
    change += float(uncertainty.mass_centre) * np.linalg.norm(influence.centre, axis=2)
    limits, weighted = requirements.limits, requirements.mass * influence.lengths
    low = 0.0 if limits.tension_min is None else limits.tension_min / weighted
    slacks = [(influence.mu - low, 1.0)]
    if limits.tension_max is not None:
        slacks.append((np.asarray(limits.tension_max) / weighted - influence.mu, -1.0))
    spools, centre = [], []
    for slack, sign in slacks:
        cable = np.argmin(np.nan_to_num(slack / change, nan=np.inf), axis=1)
        spools.append(sign * unit_vectors(influence.across[index, cable] * np.sign(influence.mu)[..., None]))
        centre.append(-sign * unit_vectors(influence.centre[index, cable]))
    return WorstDisplacements(np.stack(spools), np.stack(centre))


@UNKNOWN
def fails(
    enclosure: Enclosure,
    influence: Influence,
    worst: WorstDisplacements,
    requirements: Requirements,
    multiple: Float[np.ndarray, "k"],
) -> Bool[np.ndarray, "k"]:
    """Tell where a robot with the worst displacements within a multiple fails a criterion in the middle of a block."""
    radii, limits = _radii(requirements, multiple), requirements.limits
    broken = np.zeros(len(multiple), bool)
    for spools, centre in zip(*worst, strict=True):
        mu, lengths = tensions(enclosure, radii.spools[:, None, None] * spools, radii.centre[:, None] * centre)
        broken |= (mu < -SIX_CABLES_UNDECIDED * requirements.slack[:, None]).any(1)
        weighted = requirements.mass * mu * lengths
        if limits.tension_min is not None:
            broken |= (weighted / radii.factor[:, None] < limits.tension_min).any(1)
        if limits.tension_max is not None:
            broken |= (weighted * radii.factor[:, None] > limits.tension_max).any(1)
    if float(requirements.uncertainty.spool_positions) > 0.0:
        broken |= enclosure.distances.fail(radii.spools)
        broken |= rates_fail(enclosure, influence, limits, radii.spools)
    return broken


def tensions(
    enclosure: Enclosure, spools: Float[np.ndarray, "k n_cables 3"], centre: Float[np.ndarray, "k 3"]
) -> tuple[Float[np.ndarray, "k n_cables"], Float[np.ndarray, "k n_cables"]]:
    """Tensions of other robots in the middles of blocks."""
    rays, is_platform = enclosure.rays - spools, bool(enclosure.arms.any())
    extra = np.einsum("kij,kj->ki", enclosure.acceleration_matrix, centre)
    force = enclosure.force + extra
    wrench = np.concatenate([force, enclosure.moment + np.cross(centre, force)], axis=1) if is_platform else force
    inverse = inverted(structure(rays, enclosure.arms, is_platform=is_platform))
    return (inverse @ wrench[..., None])[..., 0], np.linalg.norm(rays, axis=2)
