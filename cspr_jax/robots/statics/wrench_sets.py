"""Sets of wrenches that cables can supply, by their faces: for any number of cables, and two, three or six components.

With tensions between smallest and largest values the wrenches W t fill a zonotope; without largest tensions, a cone.
Every face is parallel to d - 1 independent columns of W, so that the normals to all choices of d - 1 columns, with both
signs, are candidates for its normal (hyperplane shifting: Bouchard, Gosselin and Moore 2010; Gouttefarde and
Krut 2010). A candidate is no face where a cable without a largest tension can pull beyond it.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from cspr_jax.numerics.elementary import as_float64, maximum_of, minimum_of
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import PLANAR, PointMassRobot, relative_acceleration
from cspr_jax.robots.model.robot import Robot
from cspr_jax.robots.model.state import State

# Columns are unit vectors: d - 1 with a volume below this span no face; a column this near to a plane lies in it.
FLAT = 1e-12
# Rounding error of a slack, relative to the numbers that are subtracted; divided by the volume of the face's columns,
# it bounds the error.
SLACK_ERROR = 1e-14


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Faces:
    """Set of the wrenches, or accelerations, that are feasible: those for which no slack is negative.

    Fields:
        normals: (..., n_faces, n_components) unit normals that point inside; 0 for a candidate that is no face.
        offsets: (..., n_faces) products of the normals with points of the faces, N or m/s^2; -inf likewise.
        volumes: (..., n_faces) volume of the unit columns that span the face, in [0, 1].
        apex: (..., n_components) wrench, or acceleration, at the smallest tensions.
        of_largest: (..., n_faces) whether a cable is at its largest tension on the face.
        is_regular: (...) whether the set has an inside: the cables span all d components.
        closure: (...) margin of wrench closure, in [-1, 1], positive if large enough tensions resist every wrench. Each
            side of each plane of d - 1 unit columns has a largest distance of a column; this is the smallest of these.
    """

    normals: Array
    offsets: Array
    volumes: Array
    apex: Array
    of_largest: Array
    is_regular: Array
    closure: Array

    def slacks(self, values: Float[Array, "... n_components"]) -> Float[Array, "... n_faces"]:
        """Distances from the planes of the faces."""
        return jnp.sum(self.normals * values[..., None, :], axis=-1) - self.offsets

    def margin(self, values: Float[Array, "... n_components"]) -> Float[Array, "..."]:
        """Distance to the nearest face."""
        slacks = self.slacks(values)
        minimum, spanned = minimum_of(slacks, axis=-1), jnp.isfinite(self.offsets).any(-1)
        flat = jnp.where(spanned, jnp.minimum(minimum, 0.0), -jnp.linalg.norm(values - self.apex, axis=-1))
        return jnp.where(self.is_regular, minimum, flat)

    def rounding(self, values: Float[Array, "... n_components"]) -> Float[Array, "..."]:
        """Bound of the rounding error of the smallest slack."""
        magnitude = jnp.linalg.norm(values, axis=-1)[..., None]
        offsets = jnp.abs(jnp.where(jnp.isfinite(self.offsets), self.offsets, 0.0))
        each = SLACK_ERROR * (magnitude + offsets + jnp.linalg.norm(self.apex, axis=-1)[..., None])
        finite = jnp.isfinite(self.offsets) & (self.volumes > FLAT)
        smallest = minimum_of(jnp.where(finite, self.slacks(values), jnp.inf), axis=-1, keepdims=True)
        # Only faces that may be the nearest one matter.
        each = each / jnp.where(finite, self.volumes, 1.0)
        near = finite & (self.slacks(values) - each <= smallest + each)
        return maximum_of(jnp.where(near, each, 0.0), axis=-1)


@functools.cache
def _subsets(count: int, n: int) -> np.ndarray:
    return np.array(list(itertools.combinations(range(count), n)), int).reshape(math.comb(count, n), n)


@functools.cache
def _level(rows: int, columns: int, n: int) -> tuple[np.ndarray, ...]:
    # Indices for expanding minors of `n` columns along their last column: for each choice of columns, the choice
    # without the last one, and the last one; for each choice of rows, each of its rows, the choice of the other rows,
    # and the sign, (n_choices, n) each.
    smaller = {tuple(s): i for i, s in enumerate(_subsets(columns, n - 1).tolist())}
    chosen = _subsets(columns, n)
    parent = np.array([smaller[tuple(s[:-1])] for s in chosen.tolist()])
    others = {tuple(s): i for i, s in enumerate(_subsets(rows, n - 1).tolist())}
    row = _subsets(rows, n)
    rest = np.array([[others[tuple(s[:k] + s[k + 1 :])] for k in range(n)] for s in row.tolist()])
    sign = np.array([(-1.0) ** (n - 1 - k) for k in range(n)])
    return parent, chosen[:, -1], row, rest, sign


def spanning(count: int, dof: int) -> np.ndarray:
    """Choices of cables whose directions span a face."""
    return _subsets(count, dof - 1)


def normals_to(matrix: Float[Array, "dof n_cables"]) -> Float[Array, "n_choices dof"]:
    """Normals to all choices of d - 1 columns: their generalised cross products."""
    dof, count = matrix.shape
    if dof == 1:
        return jnp.ones((1, 1), matrix.dtype)
    products = matrix.T  # minors of one column, indexed by row
    for n in range(2, dof):
        parent, last, row, rest, sign = _level(dof, count, n)
        terms = products[parent][:, rest] * matrix.T[last][:, row]
        products = terms @ sign
    # The first of `_subsets` leaves out the last row, the second the last but one, and so on.
    signs = np.array([(-1.0) ** (dof - 1 - i) for i in range(dof)])
    return products[:, ::-1] * signs[None]


@functools.cache
def beside_faces(count: int, dof: int) -> np.ndarray:
    """Cables that are not among those that span a face, for each face."""
    return np.array([np.setdiff1d(np.arange(count), columns) for columns in spanning(count, dof)])


def one_sided_faces(
    matrix: Float[Array, "dof n_cables"], kernel: Float[Array, "n n_cables"]
) -> Float[Array, "n_choices n_others"]:
    """Products of a normal to each choice of d - 1 cables with the other cables.

    With up to two redundant cables they follow from the kernel by some thirty multiplications, without determinants.
    """
    dof, count = matrix.shape
    chosen = beside_faces(count, dof)
    if count - dof > 2:
        normals = normals_to(matrix)
        square = jnp.sum(normals**2, axis=1)[:, None]
        is_normal = square > FLAT**2
        units = normals / jnp.sqrt(jnp.where(is_normal, square, 1.0))
        along = jnp.take_along_axis(units @ matrix, jnp.asarray(chosen), axis=1)
        return jnp.where(is_normal, _without_noise(along), 0.0)
    # The products are the coefficients of the linear relation among the kernel's rows for the other cables.
    rows = kernel.T[chosen]
    if chosen.shape[1] == 1:
        return jnp.ones(chosen.shape)
    if chosen.shape[1] == 2:
        along = jnp.stack([rows[:, 1, 0], -rows[:, 0, 0]], axis=1)
    else:
        after, last = rows[:, np.array([1, 2, 0])], rows[:, np.array([2, 0, 1])]
        along = after[..., 0] * last[..., 1] - after[..., 1] * last[..., 0]
    norm = maximum_of(jnp.abs(along), axis=1, keepdims=True)
    return _without_noise(jnp.where(norm > FLAT, along / jnp.where(norm > FLAT, norm, 1.0), 0.0))


def _without_noise(along: Array) -> Array:
    # Products that are zero but for rounding become zero, and keep their derivatives.
    is_noise = jnp.abs(along) <= FLAT
    return jnp.where(is_noise, along - lax.stop_gradient(along), jnp.where(jnp.isnan(along), 0.0, along))


def face_distances(
    along: Float[Array, "n m"], slacks: Float[Array, "n"], weights: Float[Array, "n m"]
) -> Float[Array, "n"]:
    """Amount by which all limits can shrink until a wrench lies on the face, for each face."""
    norms = jnp.sum(jnp.abs(along) * weights, axis=1)
    return jnp.where(norms > 0.0, slacks / jnp.where(norms > 0.0, norms, 1.0), jnp.inf)


@jax.jit
def wrench_faces(
    matrix: Float[Array, "dof n_cables"], tension_min: Float[Array, "n_cables"], tension_max: Float[Array, "n_cables"]
) -> Faces:
    """Faces of the set of wrenches that cables can supply."""
    dof, count = matrix.shape
    # A cable of length zero has no direction.
    has_directions = jnp.isfinite(matrix).all()
    matrix = jnp.where(jnp.isfinite(matrix), matrix, 0.0)
    products = normals_to(matrix)
    volumes = jnp.linalg.norm(products, axis=1)
    spans = volumes > FLAT
    units = products / jnp.where(spans, volumes, 1.0)[:, None]
    along = units @ matrix
    is_own = np.zeros(along.shape, bool)
    np.put_along_axis(is_own, spanning(count, dof), True, axis=1)
    along = jnp.where(is_own | (jnp.abs(along) <= FLAT), 0.0, along)
    is_regular = has_directions & (spans & (along != 0.0).any(1)).any()
    both = jnp.concatenate([along, -along])
    offsets = _offset(both, tension_min, tension_max)
    bounds = jnp.concatenate([spans, spans]) & jnp.isfinite(offsets)
    farthest = maximum_of(jnp.where(np.concatenate([is_own, is_own]), -jnp.inf, both), axis=1)
    emptier = minimum_of(jnp.where(jnp.concatenate([spans, spans]), farthest, jnp.inf))
    return Faces(
        normals=jnp.where(bounds[:, None], jnp.concatenate([units, -units]), 0.0),
        offsets=jnp.where(bounds, offsets, -jnp.inf),
        volumes=jnp.concatenate([volumes, volumes]),
        apex=matrix @ tension_min,
        of_largest=bounds & (both < 0.0).any(1),
        is_regular=is_regular,
        closure=jnp.where(is_regular, emptier, -1.0),
    )


def _offset(along: Array, low: Array, high: Array) -> Array:
    # Smallest product of each normal with a wrench of the set.
    return jnp.sum(along * jnp.where(along > 0.0, low[None], jnp.where(along < 0.0, high[None], 0.0)), axis=1)


@jax.jit
def acceleration_faces(
    robot: PointMassRobot,
    position: Float[Array, "3"],
    tension_min: Float[Array, "n_cables"],
    tension_max: Float[Array, "n_cables"],
) -> Faces:
    """Faces of the set of accelerations that the cables of a point mass can give at one position."""
    zero = jnp.zeros_like(position)
    matrix = robot.wrench_matrix(State(position, zero, zero))
    faces = wrench_faces(matrix, tension_min / robot.mass, tension_max / robot.mass)
    if robot.dof == PLANAR:
        normals, apex = (jnp.stack([x[..., 0], 0.0 * x[..., 0], x[..., 1]], -1) for x in (faces.normals, faces.apex))
    else:
        normals, apex = faces.normals, faces.apex
    falling = -relative_acceleration(robot, zero)
    # A candidate that is no face keeps its -inf.
    return dataclasses.replace(faces, normals=normals, apex=apex + falling, offsets=faces.offsets + normals @ falling)


def tension_range(robot: Robot, limits: Limits) -> tuple[Float[Array, "n_cables"], Float[Array, "n_cables"]]:
    """Smallest and largest tension of each cable; NumPy arrays unless jax traces them."""
    is_traced = any(isinstance(array, jax.core.Tracer) for array in jax.tree.leaves((robot, limits)))
    xp = jnp if is_traced else np
    low = as_float64(0.0 if limits.tension_min is None else limits.tension_min)
    high = as_float64(np.inf if limits.tension_max is None else limits.tension_max)
    return xp.broadcast_to(low, (robot.n_cables,)), xp.broadcast_to(high, (robot.n_cables,))
