"""Feasible accelerations of a point mass on any number of cables: verdicts, margins, and how large they can be.

A position belongs to the static workspace if no cable has to push at rest there, to the wrench-feasible workspace if
the tensions at rest also keep their limits, to the wrench-closure workspace if the cables can resist any force.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float, Int
from cspr_jax.numerics.tolerances import BOUNDARY
from cspr_jax.robots.model.limits import NO_LIMITS, Limits
from cspr_jax.robots.model.point_mass import PointMassRobot, is_planar, plane_normal
from cspr_jax.robots.statics.wrench_sets import Faces, acceleration_faces, tension_range
from cspr_jax.schema.verdicts import Verdict

# Components of unit normals below this count as zero.
LEVEL = 1e-12


def faces_at(robot: PointMassRobot, limits: Limits, position: Float[Array, "3"]) -> Faces:
    """Faces of the set of feasible accelerations at one position."""
    return acceleration_faces(robot, position, *tension_range(robot, limits))


def verdict(
    robot: PointMassRobot, faces: Faces, wider: Faces, position: Float[Array, "3"], acceleration: Float[Array, "3"]
) -> Int[Array, ""]:
    """Verdict of an acceleration at one position, from its faces and the faces of limits widened as for proofs."""
    rounding, slacks = wider.rounding(acceleration), wider.slacks(acceleration)
    # Faces that belong to limits may be touched.
    doubt = jnp.where(wider.offsets < faces.offsets, rounding, jnp.maximum(BOUNDARY * robot.gravity, rounding))
    # A flat set has no inside: its margin is the distance beside it.
    flat = jnp.where(wider.is_regular, jnp.inf, wider.margin(acceleration))
    broken, is_beside = slacks < -doubt, flat < -maximum_of(doubt)
    is_out = jnp.where(wider.is_regular, broken.any(), is_beside)
    over = is_out & (broken & faces.of_largest).any()
    slack = is_out & ((broken & ~faces.of_largest).any() | ~over)
    above = is_out & ~(plane_normal(robot) @ position > 0.0)
    doubtful = ~is_out & (jnp.where(wider.is_regular, (slacks <= doubt).any(), flat <= maximum_of(doubt)))
    flags = (
        (slack, Verdict.SLACK_CABLE),
        (over, Verdict.OVER_TENSION),
        (~faces.is_regular, Verdict.SINGULAR),
        (above, Verdict.ABOVE_SPOOLS),
        (doubtful & faces.is_regular, Verdict.UNDECIDED),
        (~jnp.isfinite(acceleration).all(), Verdict.NOT_FINITE),
    )
    return sum((jnp.where(is_so, flag.value, 0) for is_so, flag in flags), jnp.zeros((), int))


class AccelerationRanges(NamedTuple):
    """Feasible accelerations at one position, and how large they are; () each.

    Fields:
        verdict: of rest there, flags of `Verdict`.
        acceleration_margin: distance of rest from the nearest face, m/s^2; positive in the wrench-feasible workspace.
        static_margin: the same without limits of the tensions, m/s^2; positive in the static workspace.
        closure_margin: margin of wrench closure, a pure number; positive in the wrench-closure workspace.
        level_acceleration: largest level acceleration that is feasible in all directions, m/s^2.
        level_acceleration_max: largest magnitude of a feasible level acceleration, m/s^2.
        upward_acceleration: largest upward acceleration, m/s^2.
        downward_acceleration: largest downward acceleration, m/s^2.
    """

    verdict: Array
    acceleration_margin: Array
    static_margin: Array
    closure_margin: Array
    level_acceleration: Array
    level_acceleration_max: Array
    upward_acceleration: Array
    downward_acceleration: Array


def acceleration_ranges(
    robot: PointMassRobot, limits: Limits, allowed: Limits, position: Float[Array, "3"]
) -> AccelerationRanges:
    """Feasible accelerations at one position."""
    faces, cone = faces_at(robot, limits, position), faces_at(robot, NO_LIMITS, position)
    at_rest = jnp.zeros_like(position)
    slack, margin = faces.slacks(at_rest), faces.margin(at_rest)

    def until(steepness: Array) -> Array:
        # Largest acceleration along the directions that have these components along the normals of the faces.
        distance = jnp.where(steepness > LEVEL, slack / jnp.where(steepness > LEVEL, steepness, 1.0), jnp.inf)
        return jnp.where(margin > 0.0, jnp.maximum(minimum_of(distance), 0.0), 0.0)

    across = jnp.linalg.norm(faces.normals[:, :2], axis=1)
    return AccelerationRanges(
        verdict=verdict(robot, faces, faces_at(robot, allowed, position), position, at_rest),
        acceleration_margin=margin,
        static_margin=cone.margin(at_rest),
        closure_margin=cone.closure,
        level_acceleration=until(across),
        level_acceleration_max=_largest_level(faces, is_planar(robot)),
        upward_acceleration=until(faces.normals[:, 2]),
        downward_acceleration=until(-faces.normals[:, 2]),
    )


def _largest_level(faces: Faces, planar: bool) -> Array:
    # The largest level acceleration lies at a corner of the level section; 0 where the section is empty.
    normal, offset = faces.normals[:, :2], faces.offsets
    first, second = np.array(list(itertools.combinations(range(len(offset)), 2))).T
    a, b = normal[first], normal[second]
    determinant = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    crosses = (jnp.abs(determinant) > LEVEL) & jnp.isfinite(offset[first]) & jnp.isfinite(offset[second])
    p, q = (jnp.where(crosses, offset[indices], 0.0) for indices in (first, second))
    corner = jnp.stack([p * b[:, 1] - q * a[:, 1], a[:, 0] * q - b[:, 0] * p], 1)
    corner = corner / jnp.where(crosses, determinant, 1.0)[:, None]
    # The level section of a planar robot is part of a line; each of its corners lies on a single face.
    length = jnp.linalg.norm(normal, axis=1)
    is_line = jnp.isfinite(offset) & (length > LEVEL)
    alone = normal * (jnp.where(is_line, offset, 0.0) / jnp.where(is_line, length, 1.0) ** 2)[:, None]
    points, counts = jnp.concatenate([corner, alone]), jnp.concatenate([crosses, is_line])
    tolerance = BOUNDARY * (1.0 + jnp.linalg.norm(points, axis=1))
    inside = counts & (points @ normal.T - offset[None] >= -tolerance[:, None]).all(1)
    # The section is unbounded if an edge of a face has no end in it.
    if planar:
        along = jnp.array([[1.0, 0.0], [-1.0, 0.0]])
    else:
        edge = jnp.stack([-normal[:, 1], normal[:, 0]], axis=1)
        along = jnp.concatenate([edge, -edge, normal])
    endless = (along @ normal.T >= -LEVEL).all(1) & (jnp.linalg.norm(along, axis=1) > LEVEL)
    is_open = endless.any() | ~is_line.any()
    largest = maximum_of(jnp.where(inside, jnp.linalg.norm(points, axis=1), 0.0))
    return jnp.where(faces.is_regular, jnp.where(is_open & inside.any(), jnp.inf, largest), 0.0)


def along(
    robot: PointMassRobot, limits: Limits, position: Float[Array, "3"], direction: Float[Array, "3"]
) -> Float[Array, "2"]:
    """Range of feasible accelerations along a direction at one position, Boralugoda (15) to (21) and figure 4.1."""
    faces = faces_at(robot, limits, position)
    steep = faces.normals @ direction
    ends = faces.offsets / jnp.where(jnp.abs(steep) > LEVEL, steep, 1.0)
    low = maximum_of(jnp.where(steep > LEVEL, ends, -jnp.inf))
    high = minimum_of(jnp.where(steep < -LEVEL, ends, jnp.inf))
    beside = (jnp.abs(steep) <= LEVEL) & (faces.offsets > 0.0)
    return jnp.where((low > high) | beside.any(), jnp.nan, jnp.stack([low, high]))


@jax.jit
def acceleration_ranges_at(
    robot: PointMassRobot, limits: Limits, allowed: Limits, positions: Float[Array, "n 3"]
) -> AccelerationRanges:
    """Feasible accelerations at many positions."""
    return jax.vmap(lambda position: acceleration_ranges(robot, limits, allowed, position))(positions)
