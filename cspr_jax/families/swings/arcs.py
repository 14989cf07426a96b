"""Smallest number of arcs of many segments, with duration, margin and verdict.

A screen bounds the margin of every number of arcs from above; `families.swings.decide` decides the remaining ones.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.families.swings import hypocycloid
from cspr_jax.families.swings.decide import decided, end_slacks
from cspr_jax.families.swings.hypocycloid import Segment
from cspr_jax.families.swings.proof import screen
from cspr_jax.motion.amplitudes import boundary_errors
from cspr_jax.motion.answers import Answers, joined
from cspr_jax.motion.problem import Problem, touchable
from cspr_jax.numerics.batches import device_batch_size, in_batches, in_parts
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.point_mass import AT_P0, LARGEST_LENGTH, PointMassRobot, spool_radius
from cspr_jax.runtime.persistent_jit import persistent_jit
from cspr_jax.runtime.stages import stage

# Largest number of segments that each thread holds in memory at a time.
PART = 16 * screen.BATCH


@persistent_jit
def _segments(problem: Problem, points) -> tuple[Segment, Segment, jax.Array]:
    def one(start, end, z0):
        even, odd = (hypocycloid.segment(problem.robot, start, end, z0, odd=jnp.asarray(odd)) for odd in (False, True))
        return even, odd, hypocycloid.feasibility_at_infinity(even, problem.amplitude)

    return jax.vmap(one)(*points)


def segments_between(
    problem: Problem, starts: Float[np.ndarray, "n 3"], ends: Float[np.ndarray, "n 3"], z0: Float[np.ndarray, "n"]
) -> tuple[dict[int, Segment], np.ndarray]:
    """Segments of many pairs of points."""
    even, odd, infinity = in_batches(partial(_segments, problem), (starts, ends, z0), batch_size=screen.BATCH)
    return {0: even, 1: odd}, infinity


def minimum_arcs(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    z0: Float[np.ndarray, "n"],
    *,
    max_arcs: int = 30,
    arcs=None,
    dtype="float64",
) -> Answers:
    """Smallest number of arcs of each segment from a start to an end.

    Needs 64-bit jax (`jax.config.update("jax_enable_x64", True)`): verdicts are in float64.
    """
    check_numbers(problem.robot, z0, max_arcs)

    def part(rows: slice) -> Answers:
        fixed = None if arcs is None else np.asarray(arcs)[rows]
        points = (starts[rows], ends[rows], z0[rows])
        return arcs_and_segments(problem, *points, max_arcs=max_arcs, arcs=fixed, dtype=dtype)[0]

    # Do not divide segments that fit into one batch.
    return (
        joined(in_parts(part, len(z0), device_batch_size(PART)))
        if len(z0) > device_batch_size(screen.BATCH)
        else part(slice(None))
    )


def arcs_and_segments(
    problem: Problem,
    starts: Float[np.ndarray, "n 3"],
    ends: Float[np.ndarray, "n 3"],
    z0: Float[np.ndarray, "n"],
    *,
    max_arcs: int = 30,
    arcs=None,
    dtype="float64",
) -> tuple[Answers, Segment]:
    """Smallest number of arcs of each segment, with the segments: `minimum_arcs` in one part."""
    check_numbers(problem.robot, z0, max_arcs)
    broken = boundary_errors(problem.amplitude)
    if broken:
        raise InputError(
            "amplitude", problem.amplitude.name, "an amplitude function that meets (2.49): " + "; ".join(broken)
        )
    stage(f"numbers of arcs, 1 to {max_arcs}")
    parities, infinity = segments_between(problem, starts, ends, z0)
    if problem.robot.n_cables > problem.robot.dof:
        from cspr_jax.families.swings.redundant_arcs import redundant_arcs

        return redundant_arcs(problem, parities, infinity, max_arcs=max_arcs, arcs=arcs)
    upper, at_ends = _screened(problem, parities[0], parities[1], max_arcs, dtype)
    return decided(problem, parities, upper, at_ends, infinity, arcs=arcs)


def check_numbers(robot: PointMassRobot, z0: Float[np.ndarray, "n"], max_arcs: int) -> None:
    """Refuse arguments that no search can use."""
    if not jax.config.read("jax_enable_x64"):
        raise InputError("jax_enable_x64", False, "true: verdicts need float64")
    if max_arcs < 1:
        raise InputError("max_arcs", max_arcs, "an integer >= 1")
    if np.abs(np.asarray(robot.base_points).mean(0)).max() > AT_P0 * float(spool_radius(robot)):
        raise InputError(
            "base_points",
            np.asarray(robot.base_points).tolist(),
            "from their centroid; see `kernel_axes.centred`",
        )
    fits = (np.asarray(z0) > 0.0) & (np.asarray(z0) <= LARGEST_LENGTH)
    if not fits.all():
        raise InputError("z0", float(np.asarray(z0)[~fits][0]), "a number > 0, at most 1e6 m")


def _screened(
    problem: Problem, even: Segment, odd: Segment, max_arcs: int, dtype: str
) -> tuple[np.ndarray, np.ndarray]:
    # Return the upper bounds (n, max_arcs) of the screen, and the slacks (n, n_criteria) at both ends, which do not
    # depend on the number of arcs.
    cast = jax.tree.map(lambda x: np.asarray(x, dtype), (even, odd))
    kernel = partial(screen.upper_bounds, max_arcs=max_arcs)
    upper = in_batches(lambda pair: kernel(problem.amplitude, *pair), cast, batch_size=screen.BATCH).astype(float)
    at_ends = in_batches(partial(end_slacks, touchable(problem), 3.0), odd, batch_size=screen.BATCH)
    return np.where(np.isnan(upper), -np.inf, upper), at_ends
