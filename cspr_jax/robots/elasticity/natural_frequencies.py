"""Natural frequencies and modes of a robot on elastic cables in many states: (K - w^2 M) x = 0.

Drums hold unstretched lengths fixed, and tensions are those of the state: at rest those of the equilibrium, in motion
those of the motion, as if it stood still there with its inertial force as a constant load.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import maximum_of
from cspr_jax.numerics.linear.eigenvalues import eigenpairs, inverse_factor
from cspr_jax.numerics.linear.rotations import matrix
from cspr_jax.numerics.shapes import Bool, Float
from cspr_jax.robots import cables
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.elasticity.stiffness import Stiffness, stiffness_at, twists
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.tension_rule_table import CENTRED
from cspr_jax.robots.statics.wrench_balance import at_rest
from cspr_jax.robots.statics.wrench_sets import tension_range

BATCH = 256  # number of states computed at a time
# A cable counts as slack up to this fraction of the largest tension: it would act in one direction only.
SLACK = 1e-9
# Tensions balance a wrench if they miss it by no more than this fraction.
BALANCED = 1e-6


class Modes(NamedTuple):
    """Natural frequencies and modes in n states, from the lowest on; NaN where a cable is not taut.

    Fields:
        squares: (n, dof) squares of the frequencies, rad^2/s^2; negative where the state is not stable.
        frequencies: (n, dof) natural frequencies, rad/s; 0 where the square is not positive.
        shapes: (n, dof, dof) coordinates of each mode, one row a mode, of modal mass 1.
    """

    squares: np.ndarray
    frequencies: np.ndarray
    shapes: np.ndarray


def are_taut(tensions: Float[np.ndarray, "n n_cables"]) -> Bool[np.ndarray, "n"]:
    """Tell in which states all cables are taut."""
    largest = np.abs(tensions).max(axis=1, initial=0.0)
    return np.isfinite(tensions).all(axis=1) & (tensions > SLACK * largest[:, None]).all(axis=1)


def rest_poses(
    robot: AnyRobot,
    centres: Float[np.ndarray, "n 3"],
    quaternions: Float[np.ndarray, "n 4"],
    limits: Limits,
    rule: str = CENTRED,
) -> tuple[State, Float[np.ndarray, "n n_cables"]]:
    """States at rest, and the tensions that hold them; NaN where none do."""
    kernel = partial(_at_rest, robot, _of_tensions(robot, limits), rule=rule)
    answer: tuple[State, np.ndarray] = in_batches(kernel, (centres, quaternions), batch_size=BATCH)
    return answer


def tensions_in(robot: AnyRobot, states: State, limits: Limits, rule: str = CENTRED) -> Float[np.ndarray, "n n_cables"]:
    """Tensions that move a robot through n states."""
    kernel = partial(_tensions, robot, _of_tensions(robot, limits), rule=rule)
    return in_batches(kernel, states, batch_size=BATCH)


def _of_tensions(robot: AnyRobot, limits: Limits) -> Limits:
    # Limits between which tensions are chosen; without the others, so that compiled functions are shared.
    motors = cables.BOUNDING if robot.n_cables > robot.dof and robot.winches is not None else ()
    return Limits(*tension_range(robot, limits), **{name: getattr(limits, name) for name in motors})


def stiffnesses(
    robot: AnyRobot, states: State, tensions: Float[np.ndarray, "n n_cables"]
) -> tuple[Stiffness, Float[np.ndarray, "n dof 6"]]:
    """Stiffness and mass matrices of a robot in n states, and the twists of their coordinates."""
    answer: tuple[Stiffness, np.ndarray] = in_batches(partial(_in_states, robot), (states, tensions), batch_size=BATCH)
    return answer


def modes_of(stiffness: Stiffness, taut: Bool[np.ndarray, "n"]) -> Modes:
    """Modes of stiffness and mass matrices, by NumPy: batches of LAPACK inside XLA may wait for ever."""
    matrix, mass = (np.asarray(values)[taut] for values in (stiffness.total, stiffness.mass))
    finite = np.isfinite(matrix).all(axis=(1, 2))
    taut, matrix, mass = np.flatnonzero(taut)[finite], matrix[finite], mass[finite]
    count, dof = len(stiffness.mass), stiffness.mass.shape[-1]
    squares, shapes = np.full((count, dof), np.nan), np.full((count, dof, dof), np.nan)
    if len(taut):
        back = np.linalg.inv(np.linalg.cholesky(mass))
        values, vectors = np.linalg.eigh(back @ matrix @ back.swapaxes(1, 2))
        squares[taut], shapes[taut] = values, (back.swapaxes(1, 2) @ vectors).swapaxes(1, 2)
    return Modes(squares, np.sqrt(np.maximum(squares, 0.0)), shapes)


def modes_in(robot: AnyRobot, states: State, tensions: Float[np.ndarray, "n n_cables"]) -> Modes:
    """Modes of a robot in n states."""
    return modes_of(stiffnesses(robot, states, tensions)[0], are_taut(tensions))


@partial(jax.jit, static_argnames=("rule",))
def _at_rest(robot: AnyRobot, limits: Limits, poses: tuple[Array, Array], *, rule: str) -> tuple[State, Array]:
    def one(centre: Array, quaternion: Array) -> tuple[State, Array]:
        state = at_rest(centre, matrix(quaternion))
        tensions = tensions_at_rest(robot, state, limits, rule)
        if not PATTERNS[robot.pattern].is_body:
            state = State(*state[:3])
        return state, tensions

    return jax.vmap(one)(*poses)


def tensions_at_rest(robot: AnyRobot, state: State, limits: Limits, rule: str) -> Float[Array, "n_cables"]:
    """Tensions that hold a robot at rest; NaN where none do."""
    tensions, wrench = cables.tensions(robot, state, limits, rule), robot.inertial_wrench(state)
    missed = jnp.linalg.norm(robot.wrench_matrix(state) @ tensions - wrench)
    return jnp.where(missed <= BALANCED * (1.0 + jnp.linalg.norm(wrench)), tensions, jnp.nan)


def frequencies_at_rest(robot: AnyRobot, state: State, limits: Limits, rule: str = CENTRED) -> Float[Array, "dof"]:
    """Natural frequencies in one state at rest, as in `modes_of`, in pure jax."""
    tensions = tensions_at_rest(robot, state, limits, rule)
    is_taut = (tensions > SLACK * maximum_of(jnp.abs(tensions))).all()
    # Gradients of numbers that are not selected must be finite, too.
    stiffness = stiffness_at(robot, state, jnp.where(is_taut, tensions, 1.0))
    back = inverse_factor(stiffness.mass)
    squares = eigenpairs(back @ stiffness.total @ back.T)[0]
    is_stable = squares > 0.0
    frequencies = jnp.where(is_stable, jnp.sqrt(jnp.where(is_stable, squares, 1.0)), 0.0)
    return jnp.where(is_taut, frequencies, jnp.nan)


@partial(jax.jit, static_argnames=("rule",))
def _tensions(robot: AnyRobot, limits: Limits, states: State, *, rule: str) -> Array:
    return jax.vmap(lambda state: cables.tensions(robot, state, limits, rule))(states)


@jax.jit
def _in_states(robot: AnyRobot, arguments: tuple[State, Array]) -> tuple[Stiffness, Array]:
    def one(state: State, tensions: Array) -> tuple[Stiffness, Array]:
        return stiffness_at(robot, state, tensions), twists(robot, state)

    return jax.vmap(one)(*arguments)
