"""Test whether a robot on any number of cables can hang at rest with all of them taut, by linear programs."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.wrench_balance import at_rest
from cspr_jax.robots.tensions.tension_programs import by_program

# Depths that are tried, over the mean distance of the spools from their centroid.
DEPTHS = np.linspace(-0.95, 1.0, 40)


def slack_at_rest(robot: AnyRobot, limits: Limits) -> str | None:
    """Reason why no tensions hold a robot at rest with every cable taut; None where it can hang."""
    distance = float(np.linalg.norm(np.asarray(robot.base_points), axis=1).mean())
    low = np.zeros(robot.n_cables) if limits.tension_min is None else np.asarray(limits.tension_min)
    high = np.full(robot.n_cables, np.inf) if limits.tension_max is None else np.asarray(limits.tension_max)
    with double_precision():
        for depth in DEPTHS * distance:
            matrix, wrench = (np.asarray(x) for x in _balance(robot, np.array([0.0, 0.0, depth])))
            if np.isfinite(matrix).all() and by_program(matrix, wrench, low, high):
                return None
    return (
        f"at no depth down to {distance:.4g} m below the centroid of its spools, in the orientation of its file, do "
        "tensions within its limits hold it with every cable taut"
    )


@jax.jit
def _balance(robot: AnyRobot, position: Float[Array, "3"]) -> tuple[Float[Array, "dof n_cables"], Float[Array, "dof"]]:
    # Wrench matrix of a pose at rest, and the wrench that its cables must supply.
    rest = at_rest(position, jnp.eye(3))
    return robot.wrench_matrix(rest), robot.inertial_wrench(rest)
