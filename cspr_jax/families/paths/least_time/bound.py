"""Lower bound of the time along a section, from the multipliers of its grid."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.families.paths.least_time.constraints import TINY, tangent_directions, tension_faces, unit_wrenches
from cspr_jax.families.paths.least_time.discrete import Discrete
from cspr_jax.families.paths.least_time.duality import Multipliers, SpeedMultipliers, lower_bound
from cspr_jax.families.paths.least_time.multipliers import dual_multipliers
from cspr_jax.families.paths.least_time.nodes import BATCH, PathPoints, points_on, state_at
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.bounds.witness_tensions import right_inverse
from cspr_jax.robots.cables import AnyRobot, cable_motion
from cspr_jax.robots.model.limits import Limits
from cspr_jax.runtime import compile_options
from cspr_jax.runtime.persistent_jit import persistent_jit

# The search for multipliers starts from x of at least this fraction of the largest x.
SMALLEST = 1e-9


def path_bound(problem: Problem, path: Discrete, x: Float[np.ndarray, "n_nodes"]) -> float:
    """Rigorous lower bound of the time of any motion that goes forward along a section."""
    robot, limits, curve, grid = problem.robot, problem.limits, path.section.curve, path.grid
    middles = np.maximum(0.5 * (x[1:] + x[:-1]), SMALLEST * x.max())
    of_nodes, of_cells = dual_multipliers(path.dual_half_planes(), path.ends, middles)
    nodes = points_on(curve, grid.nodes, ahead=True)
    values = in_batches(partial(_of_nodes, robot, limits), (nodes, of_nodes.T), batch_size=BATCH)
    centres = points_on(curve, 0.5 * (grid.nodes[1:] + grid.nodes[:-1]), ahead=True)
    rates = in_batches(partial(_of_cells, robot, limits), (centres, grid.speed, of_cells), batch_size=BATCH)
    return lower_bound(robot, limits, path, Multipliers(*values), SpeedMultipliers(*rates))


@persistent_jit(compiler_options=compile_options.proof_options())
def _of_nodes(robot: AnyRobot, limits: Limits, nodes: tuple[PathPoints, Array]) -> tuple[Array, Array, Array]:
    # Return multipliers of the wrench and of cable and Cartesian accelerations from those of half-planes.
    def one(point: PathPoints, multipliers: Array) -> tuple[Array, Array, Array]:
        state = state_at(point)
        matrix = unit_wrenches(robot, state).matrix
        along = tension_faces(robot, limits, matrix).along
        count, n_cables = along.shape
        wrench = -(multipliers[:count] @ along @ right_inverse(matrix)) / (robot.mass * robot.gravity)
        cable_acceleration, acceleration, rest = jnp.zeros(n_cables), jnp.zeros(3), multipliers[count:]
        if limits.cable_acceleration_max is not None:
            cable_acceleration, rest = rest[:n_cables] - rest[n_cables : 2 * n_cables], rest[2 * n_cables :]
        if limits.acceleration_max is not None:
            acceleration = rest @ tangent_directions(state.velocity, state.acceleration)
        return wrench, cable_acceleration, acceleration

    return jax.vmap(one)(*nodes)


@persistent_jit(compiler_options=compile_options.proof_options())
def _of_cells(robot: AnyRobot, limits: Limits, cells: tuple[PathPoints, Array, Array]) -> tuple[Array, Array]:
    # The cap of a cell is due to the cable, or the mass centre, that is nearest to its limit in the middle of the cell.
    def one(point: PathPoints, speed_max: Array, multiplier: Array) -> tuple[Array, Array]:
        state = state_at(point)
        none, square = jnp.zeros(robot.n_cables), jnp.maximum(jnp.sum(state.velocity**2), TINY)
        if limits.cable_speed_max is None:
            return none, multiplier / square
        rates = jnp.square(cable_motion(robot, state)[1])
        ratios = rates / jnp.square(limits.cable_speed_max)
        nearest = jnp.argmax(ratios)
        is_cable = ratios[nearest] >= square / jnp.square(speed_max)
        of_cables = jnp.where(
            is_cable & (jnp.arange(robot.n_cables) == nearest), multiplier / jnp.maximum(rates, TINY), none
        )
        return of_cables, jnp.where(is_cable, 0.0, multiplier / square)

    return jax.vmap(one)(*cells)
