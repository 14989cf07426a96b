"""Equations and bounds of a motion at an instant, for a search.

Values are the tensions over the weight, and whatever else limits bound, over the limit. Tensions are unknowns of their
own: equations say that they balance the motion, and that all other values are those of its state. So redundant cables
need no rule, and no matrix is inverted, which may be singular on the way.
"""

import functools
import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic import rotations
from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.curves.spline import turning_of
from cspr_jax.motions.criteria import Criterion, judged_poses
from cspr_jax.motions.limits import limits_set
from cspr_jax.robots.cables import AnyRobot, cable_motion, wrench_units
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.point_mass import plane_normal, spool_radius
from cspr_jax.robots.state import State
from cspr_jax.robots.wrench_sets import tension_range
from cspr_jax.schema.limits import Limit
from cspr_jax.schema.verdicts import Verdict

BATCH = 128
# Entries of x behind the coordinates.
SCALARS = 2
# Depth below the spools, over the size of the robot, that a search keeps at least.
BELOW = 0.02


class InstantValues(NamedTuple):
    """Equations of instants, whose residuals are those of the tensions and less other values, and their derivatives.

    Derivatives are by x: the coordinates, their first and second derivatives in normalised time, the duration, and the
    level of the objective, on which the equations do not depend.

    Fields:
        residual: (..., n_equations) without the other values: what tensions miss of the wrench, over the weight; then
            less the other values of the state.
        slope: (..., n_equations, n_x).
        matrix: (..., dof, n_cables) wrenches of unit tensions.
        bend: (..., n_x, n_x) second derivatives of the residuals times multipliers.
        mixed: (..., n_cables, n_x) of the same, by a tension and x.
    """

    residual: Any
    slope: Any
    matrix: Any
    bend: Any
    mixed: Any


def coordinates(pattern: str) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates of an effector.

    Args:
        pattern: name of a row of `robots.patterns`.

    Returns:
        axes along which it moves, and axes of the components of a Rodrigues vector, from 0 to 2.
    """
    row = PATTERNS[pattern]
    return np.array(row.forces, int), np.array(row.moments, int)


def state_of(robot: AnyRobot, reference: Array, place: Array, duration: Array) -> State:
    """State of a motion at one instant.

    Args:
        reference: (4,) orientation from which the Rodrigues vector counts.
        place: (3, d) coordinates, and their first two derivatives in normalised time.
        duration: () s.

    Returns:
        the state.
    """
    along, about = coordinates(robot.pattern)
    rate = 1.0 / duration
    rates = place * jnp.stack([jnp.ones_like(rate), rate, rate * rate])[:, None]
    position = jnp.zeros((3, 3)).at[:, along].set(rates[:, : len(along)])
    if not len(about):
        return State(position[0], position[1], position[2])
    vector = jnp.zeros((3, 3)).at[:, about].set(rates[:, len(along) :])
    quaternions = jnp.concatenate([jnp.asarray([[1.0], [0.0], [0.0]]), vector], axis=1)
    rotation, spin, spin_rate, _ = turning_of(*(rotations.product(one, reference) for one in quaternions))
    return State(position[0], position[1], position[2], rotation, spin, spin_rate)


def other_rows(limits: Limits) -> list[Limit]:
    """Rows of the limits that are set, but those of tensions.

    Returns:
        the rows.
    """
    return [row for row in limits_set(limits) if row.quantity != "tension"]


def _other_values(robot: AnyRobot, limits: Limits, longest: Array | None, state: State, duration: Array) -> Array:
    # Values beside tensions and determinant: over limits, of the mass centre squared; depths over the robot's size.
    length, rate, bend = cable_motion(robot, state)
    size = spool_radius(robot)
    values = {
        "depth": state.position[2:],
        "length": length,
        "speed": rate,
        "acceleration": bend,
        "mass_centre_speed": jnp.sum(state.velocity**2, keepdims=True),
        "mass_centre_acceleration": jnp.sum(state.acceleration**2, keepdims=True),
    }
    parts = []
    for row in other_rows(limits):
        limit = jnp.atleast_1d(jnp.asarray(getattr(limits, row.name)))
        scale = size if row.is_height else limit**2 if row.of_mass_centre else limit
        parts.append(values[row.quantity] / scale)
    if judged_poses(robot)[1]:
        parts.append(jnp.dot(plane_normal(robot), state.position)[None] / size)
    if longest is not None:
        parts.append(duration[None] / longest)
    return jnp.concatenate(parts) if parts else jnp.zeros(0)


def determinant(robot: AnyRobot, state: State) -> Array:
    """Determinant of the wrenches of unit tensions, their moments over the size of the platform.

    It is a polynomial in their components, so that its derivatives are numbers where it vanishes, too.

    Args:
        robot: a platform on as many cables as degrees of freedom.

    Returns:
        ().
    """
    matrix = robot.wrench_matrix(state) / wrench_units(robot)[:, None]
    rows = [[matrix[i, j] for j in range(robot.dof)] for i in range(robot.dof)]
    if robot.dof == 3:
        return _minors(rows)[0, 1, 2]
    # Laplace's expansion by the first three rows.
    forces, moments = _minors(rows[:3]), _minors(rows[3:])
    terms = [
        (-1.0) ** (sum(columns) - 3) * minor * moments[tuple(k for k in range(6) if k not in columns)]
        for columns, minor in forces.items()
    ]
    return functools.reduce(jnp.add, terms)


def _minors(rows: list[list[Array]]) -> dict[tuple[int, ...], Array]:
    # Determinants of three rows for each choice of three columns. Numbers, since gathers of columns take much longer.
    a, b, c = rows
    columns = range(len(a))
    pairs = {(i, j): a[i] * b[j] - a[j] * b[i] for i, j in itertools.combinations(columns, 2)}
    return {
        (i, j, k): pairs[i, j] * c[k] - pairs[i, k] * c[j] + pairs[j, k] * c[i]
        for i, j, k in itertools.combinations(columns, 3)
    }


def _missed(
    robot: AnyRobot,
    limits: Limits,
    longest: Array | None,
    reference: Array,
    place: Array,
    duration: Array,
    tensions: Array,
) -> Array:
    # Residuals of one instant, but that of the determinant.
    state, unit = state_of(robot, reference, place, duration), wrench_units(robot)
    wrench = robot.wrench_matrix(state) @ tensions - robot.inertial_wrench(state) / (robot.mass * robot.gravity)
    return jnp.concatenate([wrench / unit, -_other_values(robot, limits, longest, state, duration)])


@jax.jit
def _residual_kernel(robot: AnyRobot, limits: Limits, longest: Array | None, instants: tuple[Array, ...]) -> Array:
    def one(reference: Array, place: Array, *others: Array) -> Array:
        missed = _missed(robot, limits, longest, reference, place, *others)
        if not judged_poses(robot)[0]:
            return missed
        return jnp.append(missed, -_determinant_at(robot, reference, place[0]))

    return jax.vmap(one)(*instants)


def _determinant_at(robot: AnyRobot, reference: Array, place: Array) -> Array:
    # The determinant by the coordinates (d,) alone, on which nothing else of a state has an influence.
    still = jnp.concatenate([place[None], jnp.zeros((2, len(place)))])
    return determinant(robot, state_of(robot, reference, still, jnp.ones(())))


@jax.jit
def _kernel(robot: AnyRobot, limits: Limits, longest: Array | None, instants: tuple[Array, ...]) -> InstantValues:
    def one(reference: Array, place: Array, duration: Array, tensions: Array, multipliers: Array) -> InstantValues:
        unit = wrench_units(robot)

        def matrix(x: Array) -> Array:
            state = state_of(robot, reference, x[:-1].reshape(place.shape), x[-1])
            return robot.wrench_matrix(state) / unit[:, None]

        def residual(x: Array) -> Array:
            return _missed(robot, limits, longest, reference, x[:-1].reshape(place.shape), x[-1], tensions)

        def widened(derivatives: Array, axes: int = 1) -> Array:
            return jnp.pad(derivatives, [(0, 0)] * (2 - axes) + [(0, SCALARS - 1)] * axes)

        x, is_regular = jnp.concatenate([place.ravel(), duration[None]]), judged_poses(robot)[0]
        pushes = multipliers[:-1] if is_regular else multipliers
        values = InstantValues(
            residual(x),
            widened(jax.jacfwd(residual)(x)),
            matrix(x),
            widened(jax.jacfwd(jax.grad(lambda x: jnp.dot(residual(x), pushes)))(x), 2),
            widened(jax.jacfwd(lambda x: multipliers[: robot.dof] @ matrix(x))(x)),
        )
        return _with_determinant(robot, values, reference, place[0], multipliers[-1]) if is_regular else values

    return jax.vmap(one)(*instants)


def _with_determinant(
    robot: AnyRobot, values: InstantValues, reference: Array, place: Array, multiplier: Array
) -> InstantValues:
    # Values with the determinant, whose derivatives take a third of the time by its own coordinates alone.
    def less(place: Array) -> Array:
        return -_determinant_at(robot, reference, place)

    slope = jnp.zeros(values.slope.shape[-1]).at[: len(place)].set(jax.grad(less)(place))
    bend = values.bend.at[: len(place), : len(place)].add(multiplier * jax.jacfwd(jax.grad(less))(place))
    residual = jnp.append(values.residual, less(place))
    return values._replace(residual=residual, slope=jnp.concatenate([values.slope, slope[None]]), bend=bend)


def instant_values(robot: AnyRobot, limits: Limits, longest: np.ndarray | None, *instants: np.ndarray) -> InstantValues:
    """Equations at many instants.

    Args:
        robot: centred, z down.
        longest: () longest duration, s; None for any.
        instants: references (..., 4), places (..., 3, d), durations (...), tensions (..., n_cables) over the weight,
            and multipliers (..., n_equations), as of `state_of` and `InstantValues`.

    Returns:
        the equations, leaves (..., ...).
    """
    return InstantValues(*_at_all(partial(_kernel, robot, limits, longest), instants))


def residuals(robot: AnyRobot, limits: Limits, longest: np.ndarray | None, *instants: np.ndarray) -> np.ndarray:
    """Residuals of the equations at many instants, for trials of steps, which need no derivatives.

    Args:
        longest: () longest duration, s; None for any.
        instants: as of `instant_values`, without multipliers.

    Returns:
        (..., n_equations).
    """
    return _at_all(lambda part: (_residual_kernel(robot, limits, longest, part),), instants)[0]


def _at_all(
    kernel: Callable[[tuple[Array, ...]], Sequence[Array]], instants: tuple[np.ndarray, ...]
) -> list[np.ndarray]:
    # Results of a kernel, leaves (..., ...).
    shape = instants[2].shape
    flat = tuple(np.ascontiguousarray(part.reshape(-1, *part.shape[len(shape) :])) for part in instants)
    return [leaf.reshape(*shape, *leaf.shape[1:]) for leaf in in_batches(kernel, flat, size=BATCH)]


class ValueBounds(NamedTuple):
    """Bounds of the values at an instant, and how criteria tighten them.

    Fields:
        low: (n_values,) -inf for none.
        high: (n_values,) inf for none.
        rises: (n_criteria, n_values) by how much a lower bound rises so that the slack of a criterion grows by 1.
        falls: (n_criteria, n_values) by how much an upper bound falls.
        determinant: number of the value that is the determinant; None without one.
    """

    low: np.ndarray
    high: np.ndarray
    rises: np.ndarray
    falls: np.ndarray
    determinant: int | None = None


class _Value(NamedTuple):
    # A value: bounds, the criteria that they stand for, its cable or -1, and its change with that of the slack.
    low: float
    high: float
    least: Verdict
    most: Verdict
    cable: int
    change: float


def bounds(robot: AnyRobot, limits: Limits, rows: Sequence[Criterion], is_timed: bool = False) -> ValueBounds:
    """Bounds of the values.

    Args:
        robot: centred, z down.
        rows: its criteria.
        is_timed: whether a longest duration is a limit, too.

    Returns:
        the bounds.
    """
    weight, size = float(robot.mass * robot.gravity), float(spool_radius(robot))
    together, numbers = Verdict.WRENCH_INFEASIBLE, range(robot.n_cables)
    low, high = (np.asarray(side) / weight for side in tension_range(robot, limits))
    slack, over = Verdict.SLACK_CABLE | together, Verdict.OVER_TENSION | together
    values = [_Value(low[k], high[k], slack, over, k, 1.0 / weight) for k in numbers]
    for row in other_rows(limits):
        limit = np.broadcast_to(getattr(limits, row.name), robot.n_cables if row.per_cable else 1)
        for k, most in enumerate(limit):
            # Squares change twice as much.
            change = 1.0 / size if row.is_height else (2.0 if row.of_mass_centre else 1.0) / most
            top = most / size if row.is_height else 1.0
            bottom = -1.0 if row.quantity in ("speed", "acceleration") else -np.inf
            values.append(_Value(bottom, top, row.flag, row.flag, k if row.per_cable else -1, change))
    is_regular, is_below = judged_poses(robot)
    if is_below:
        values.append(_Value(BELOW, np.inf, Verdict.ABOVE_SPOOLS, Verdict.FEASIBLE, -1, 1.0 / size))
    if is_timed:
        values.append(_Value(-np.inf, 1.0, Verdict.FEASIBLE, Verdict.FEASIBLE, -1, 0.0))
    if is_regular:
        # Bounded on the side of the poses, `poses.tasks_of`.
        values.append(_Value(-np.inf, np.inf, Verdict.SINGULAR, Verdict.SINGULAR, -1, 0.0))

    def changes(side: str, bound: str) -> np.ndarray:
        return np.array(
            [
                [
                    value.change
                    if getattr(value, side) & row.flag
                    and value.cable in (*(row.cables or numbers), -1)
                    and np.isfinite(getattr(value, bound))
                    else 0.0
                    for value in values
                ]
                for row in rows
            ]
        )

    low, high = (np.array([getattr(value, side) for value in values]) for side in ("low", "high"))
    place = [k for k, value in enumerate(values) if value.least == Verdict.SINGULAR]
    return ValueBounds(low, high, changes("least", "low"), changes("most", "high"), *place)
