"""Compiled margins of many poses: cables as lanes up to eight in space, as arrays of all cocircuits beyond.

Unit vectors of the cables come from a call of their own: in one call with the rest XLA would compute each length three
times.
"""

import itertools
from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.arithmetic import lanes
from cspr_jax.arithmetic.lanes import Matrix, Vector
from cspr_jax.arithmetic.rotations import matrix
from cspr_jax.feasibility.workspace.cocircuits import CABLES, Cocircuit, by_block, direct
from cspr_jax.feasibility.workspace.margins import Margin, Tensions, closure_margin, tension_margin
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.patterns import PATTERNS
from cspr_jax.robots.platform import PlatformRobot
from cspr_jax.robots.pulleys import Pulleys, exit_lanes, exits
from cspr_jax.robots.state import State
from cspr_jax.robots.wrench_sets import normals_to, spanning

# More cables in space go by arrays: unrolled they would take minutes to compile.
UNROLLED = 8
# As many in a line or a plane, or with three components.
UNROLLED_DIRECT = 12
# Of unit columns, in float64: a normal to dof - 1 of them whose products with all others are smaller means nothing.
SHORT_NORMAL = 1e-10
# Of six unit columns: below this share of a determinant the tensions that it divides are lost to rounding.
REGULAR = {"float32": 3e-3, "float64": 1e-7}


@jax.jit
def unit_vectors(robot: AnyRobot, position: Vector, quaternion: Vector | None) -> list[Vector]:
    """Unit vectors of the cables, from the effector on, one lane a pose.

    Args:
        robot: z down.
        position: of the mass centre, or of the joint, m.
        quaternion: unit quaternion, scalar first; None: no rotation.

    Returns:
        one a cable; with pulleys those of the free cables.
    """
    arms, found = arms_of(robot, quaternion), list[Vector]()
    for k in range(robot.n_cables):
        target = tuple(position[i] + arms[k][i] for i in range(3)) if arms else tuple(position)
        base = _row(robot.base_points, k)
        if robot.pulleys is None:
            ray = tuple(base[i] - target[i] for i in range(3))
            inverse = 1.0 / jnp.sqrt(lanes.dot(ray, ray))
            found.append(tuple(x * inverse for x in ray))
        else:
            way = exit_lanes(base, _row(robot.pulleys.axes, k), robot.pulleys.radius[k], target).direction
            found.append(tuple(-x for x in way))
    return found


def _row(array: Array, k: int) -> Vector:
    return tuple(array[k, i] for i in range(3))


def arms_of(robot: AnyRobot, quaternion: Vector | None) -> list[Vector]:
    """Arms from the mass centre, or from the joint, to the attachment points.

    Args:
        robot: the robot.
        quaternion: as for `unit_vectors`.

    Returns:
        one a cable, fixed axes, m; none of a point mass.
    """
    if not isinstance(robot, PlatformRobot):
        return []
    points = [_row(robot.platform_points, k) for k in range(robot.n_cables)]
    turn: Matrix | None = None if quaternion is None else lanes.rotation(quaternion)
    return points if turn is None else [lanes.turned(turn, point) for point in points]


def columns(robot: AnyRobot, units: Sequence[Vector], arms: Sequence[Vector], length: Array) -> list[Sequence[Array]]:
    """Columns of the wrench matrix.

    Args:
        robot: gives the pattern.
        units: of `unit_vectors`.
        arms: of `arms_of`.
        length: () by which moments are divided, m.

    Returns:
        one a cable, of dof components; not of a rod.
    """
    row = PATTERNS[robot.pattern]
    found = list[Sequence[Array]]()
    for k, unit in enumerate(units):
        forces = [unit[i] for i in row.forces]
        moment = lanes.cross(arms[k], unit) if row.moments else ()
        found.append([*forces, *(moment[i] / length for i in row.moments)])
    return found


@partial(jax.jit, static_argnames=("condition", "order", "unbounded"))
def margins(
    robot: AnyRobot,
    units: Sequence[Vector],
    quaternion: Vector | None,
    wrenches: Sequence[Sequence[Array]],
    limits: tuple[Array, Array],
    length: Array,
    *,
    condition: str,
    order: tuple[int, ...],
    unbounded: tuple[bool, ...],
) -> Margin:
    """Margins of poses, one lane a pose.

    Args:
        robot: z down.
        units: of `unit_vectors`.
        quaternion: as for `unit_vectors`.
        wrenches: what the cables must supply, of dof components each, moments over `length`, N.
        limits: (n_cables,) smallest and (n_cables,) largest tensions, N; of cables without a largest one any number.
        length: () m.
        condition: "closure", or any other for the tensions; known when this is compiled, as what follows.
        order: of cables in space, those of the base block first.
        unbounded: which cables have no largest tension.

    Returns:
        the margins.
    """
    cables = columns(robot, units, arms_of(robot, quaternion), length)
    is_lost, unit = jnp.zeros(units[0][0].shape, bool), 1.0
    if len(cables[0]) == CABLES:
        unit = 0.0
        cocircuits, common = by_block(cables, wrenches, order)
        is_lost = ~(jnp.abs(common) > REGULAR[str(common.dtype)])
    else:
        cocircuits = direct(cables, wrenches)
    found = _judged(list(cocircuits), limits, condition, unbounded, unit)
    return Margin(found.value, found.is_open | is_lost)


def _judged(
    rows: Sequence[Cocircuit], limits: tuple[Array, Array], condition: str, unbounded: Sequence[bool], unit: float
) -> Margin:
    if condition == "closure":
        return closure_margin(rows, unit)
    low, high = ([limit[k] for k in range(len(unbounded))] for limit in limits)
    return tension_margin(rows, Tensions(low, high, unbounded), unit)


@partial(jax.jit, static_argnames=("condition", "unbounded"))
def array_margins(
    robot: AnyRobot,
    positions: Array,
    quaternions: Array,
    wrenches: Array,
    limits: tuple[Array, Array],
    length: Array,
    *,
    condition: str,
    unbounded: tuple[bool, ...],
) -> Margin:
    """Margins of poses of any robot, by arrays of all cocircuits; slower than `margins`.

    Args:
        robot: z down.
        positions: (n, 3) of the mass centre, or of the joint, m.
        quaternions: (n, 4) unit quaternions, scalar first.
        wrenches: (n, k, dof) what the cables must supply, moments over `length`, N.
        limits: (n_cables,) smallest and (n_cables,) largest tensions, N.
        length: () m.
        condition: as for `margins`.
        unbounded: which cables have no largest tension.

    Returns:
        the margins, (n,).
    """
    scale = scales(robot)

    def one(position, quaternion, given):
        own_matrix = robot.wrench_matrix(at_rest(position, quaternion))
        columns = own_matrix / jnp.where(scale, length, 1.0)[:, None]
        normals = normals_to(columns)
        entries, products = normals @ columns, normals @ given.T
        own = np.zeros(entries.shape, bool)
        np.put_along_axis(own, spanning(*columns.shape[::-1]), True, axis=1)
        entries = jnp.where(own, 0.0, entries)
        rows = Cocircuit(dict(enumerate(entries.T)), list(products.T))
        found = _judged([rows], limits, condition, unbounded, 0.0)
        sizes = jnp.sum(jnp.abs(entries), axis=1)
        is_short = ~(jnp.min(sizes) > SHORT_NORMAL)
        return Margin(jnp.min(found.value), found.is_open.any() | is_short)

    return jax.vmap(one)(positions, quaternions, wrenches)


def scales(robot: AnyRobot) -> np.ndarray:
    """Which components of a wrench are moments.

    Args:
        robot: the robot.

    Returns:
        (dof,).
    """
    row = PATTERNS[robot.pattern]
    return np.arange(robot.dof) >= len(row.forces)


def is_unrolled(robot: AnyRobot) -> bool:
    """Whether a robot goes by lanes.

    Args:
        robot: the robot.

    Returns:
        whether it does.
    """
    most = {CABLES: UNROLLED, 5: 0}.get(robot.dof, UNROLLED_DIRECT)
    return robot.n_cables <= most


def base_order(matrices: np.ndarray) -> tuple[int, ...]:
    """Order of cables in space whose first six, and of these the first three forces, are the farthest from singular.

    Args:
        matrices: (n, 6, n_cables) of some poses, moments over a length.

    Returns:
        the cables.
    """
    count = matrices.shape[2]

    def size(chosen, rows):
        return np.quantile(np.abs(np.linalg.det(matrices[:, :rows][:, :, list(chosen)])), 0.02)

    triples = {chosen: size(chosen, 3) for chosen in itertools.combinations(range(count), 3)}
    sixes = {chosen: size(chosen, CABLES) for chosen in itertools.combinations(range(count), CABLES)}

    def worth(pair):
        six, three = pair
        return sixes[six] * triples[three] ** 3

    pairs = [(six, three) for six in sixes for three in itertools.combinations(six, 3)]
    six, three = max(pairs, key=worth)
    last = [k for k in range(count) if k not in six]
    return (*three, *(k for k in six if k not in three), *last)


def at_rest(position: Array, quaternion: Array) -> State:
    """State of an effector that rests.

    Args:
        position: (3,) m.
        quaternion: (4,) unit quaternion, scalar first.

    Returns:
        the state.
    """
    still = jnp.zeros_like(position)
    return State(position, still, still, matrix(quaternion), still, still, quaternion)


@jax.jit
def wrench_matrices(robot: AnyRobot, positions: Array, quaternions: Array) -> Array:
    """Wrench matrices of poses.

    Args:
        robot: z down.
        positions: (n, 3) m.
        quaternions: (n, 4).

    Returns:
        (n, dof, n_cables).
    """
    return jax.vmap(lambda p, q: robot.wrench_matrix(at_rest(p, q)))(positions, quaternions)


@jax.jit
def exit_points(robot: AnyRobot, pulleys: Pulleys, positions: Array, quaternions: Array) -> Array:
    """Where cables leave their pulleys.

    Args:
        robot: z down.
        pulleys: of the robot.
        positions: (n, 3) m.
        quaternions: (n, 4).

    Returns:
        (n, n_cables, 3) m.
    """

    def one(position, quaternion):
        arms = robot.platform_points @ matrix(quaternion).T if isinstance(robot, PlatformRobot) else 0.0
        targets = jnp.broadcast_to(position[None] + arms, robot.base_points.shape)
        return exits(robot.base_points, pulleys.axes, pulleys.radius, targets).point

    return jax.vmap(one)(positions, quaternions)


@jax.jit
def weights(robot: AnyRobot, positions: Array, quaternions: Array) -> Array:
    """Wrenches that hold a robot still.

    Args:
        robot: z down.
        positions: (n, 3) m.
        quaternions: (n, 4).

    Returns:
        (n, dof) N and N m.
    """
    return jax.vmap(lambda p, q: robot.inertial_wrench(at_rest(p, q)))(positions, quaternions)
