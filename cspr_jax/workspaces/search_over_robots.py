"""Margins of poses of many robots at once, whose numbers are affine in parameters and whose cables are rearranged.

Each pose has a robot of its own. Kernels take the numbers in which robots differ lane by lane, like positions, so that
batches are full whatever the number of poses of each robot, and are compiled once.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.maps.grid_map import RobotsApartError
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.shapes import Float
from cspr_jax.numerics.tolerances import BOUNDARY
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.workspaces.poses import geometry, kernels
from cspr_jax.workspaces.poses.facet_normals import CableSubsets, choices_of
from cspr_jax.workspaces.poses.kernels import TensionLimits
from cspr_jax.workspaces.required_wrenches import RequiredWrenches
from cspr_jax.workspaces.requirements import CLOSURE, Requirement
from cspr_jax.workspaces.search import BATCH, Constants, Poses, Stage, WorkspaceSearch, cast, has_limits

# Numbers count as equal, and as affine, up to this fraction of the largest of their array.
EQUAL, AFFINE = 1e-14, 1e-11
# Largest ratio of the largest limits or weights of robots that share the distance from limits at which poses are open.
LARGEST_RATIO = 1000.0
# Number of poses whose derivatives are computed at a time.
FACET_BATCH = 64
# A limit of tensions that stands for none, over the largest of the other limits and required wrenches.
VERY_LARGE = 1e6
# Largest difference of the bounds of the margin along a facet normal, over the largest limit or required wrench; and by
# how much that is more with limits that stand for none.
FACET_ERROR, OF_VERY_LARGE = 1e-5, 100.0


class RobotRows(NamedTuple):
    """Robots of n poses.

    Fields:
        values: (n, k) values of the parameters.
        attachments: (n, n_cables) attachment point of each cable; None: in their order.
    """

    values: np.ndarray
    attachments: np.ndarray | None

    def rows(self, index: Any) -> RobotRows:
        """Robots of poses chosen by indices, a slice or a mask (n,)."""
        return RobotRows(self.values[index], None if self.attachments is None else self.attachments[index])


class RobotSamples(NamedTuple):
    """Robots from which the others follow: the first, one in which each parameter differs, and some to check.

    Fields:
        robots: robots, centred as the first is, z down.
        requirements: requirement of each.
        values: (m, k) their values of the parameters, m > k.
        attachments: (p, n_cables) some arrangements of the cables; None: one.
    """

    robots: Sequence[AnyRobot]
    requirements: Sequence[Requirement]
    values: np.ndarray
    attachments: np.ndarray | None


class AffineConstants(NamedTuple):
    """Numbers that kernels take, as affine functions of parameters.

    Fields:
        first: numbers of the first robot.
        start: (k,) its values of the parameters.
        derivatives: for each leaf of `first`, derivatives (k, ...) by the parameters; None: equal for all robots.
    """

    first: Constants
    start: np.ndarray
    derivatives: tuple[np.ndarray | None, ...]


def affine_constants(samples: Sequence[Constants], values: Float[np.ndarray, "s k"]) -> AffineConstants:
    """Affine functions through the first samples, checked at all."""
    leaves, trees = zip(*(jax.tree.flatten(sample) for sample in samples), strict=True)
    if any(tree != trees[0] for tree in trees):
        raise RobotsApartError
    derivatives = tuple(_derivatives([np.asarray(x) for x in array], values) for array in zip(*leaves, strict=True))
    return AffineConstants(samples[0], values[0], derivatives)


def _derivatives(samples: Sequence[np.ndarray], values: np.ndarray) -> np.ndarray | None:
    if any(sample.shape != samples[0].shape for sample in samples):
        raise RobotsApartError
    finite = np.isfinite(samples[0])
    for sample in samples:
        is_same = np.array_equal(sample[~finite], samples[0][~finite], equal_nan=True)
        if not is_same or not np.array_equal(np.isfinite(sample), finite):
            raise RobotsApartError
    numbers = [np.where(finite, sample, 0.0) for sample in samples]
    magnitude = max(np.abs(x).max(initial=0.0) for x in numbers)
    changes = [x - numbers[0] for x in numbers[1:]]
    if all(np.abs(change).max(initial=0.0) <= EQUAL * magnitude for change in changes):
        return None
    count = values.shape[1]
    steps = np.diagonal(values[1 : count + 1] - values[0])
    derivatives = np.stack([change / step for change, step in zip(changes[:count], steps, strict=True)])
    expected = numbers[0] + np.tensordot(values - values[0], derivatives, 1)
    if np.abs(expected - np.stack(numbers)).max(initial=0.0) > AFFINE * magnitude:
        raise RobotsApartError
    return derivatives


@jax.jit
def constants_of_lanes(
    family: AffineConstants, values: Sequence[Array], attachments: Sequence[Array] | None
) -> Constants:
    """Numbers of the robot of each lane: those in which robots differ have a last dimension."""
    leaves, tree = jax.tree.flatten(family.first)
    changes = [value - start for value, start in zip(values, family.start, strict=True)]
    moved = [
        array if each is None else _affine(array, each, changes)
        for array, each in zip(leaves, family.derivatives, strict=True)
    ]
    constants: Constants = jax.tree.unflatten(tree, moved)
    low, high, measure = constants.limits
    if low.ndim != high.ndim:
        low, high = (x if x.ndim == 2 else x[:, None] for x in (low, high))
        constants = constants._replace(limits=TensionLimits(low, high, measure))
    if attachments is None:
        return constants
    robot: Any = constants.robot
    points, chosen = robot.platform_points, jnp.stack(attachments)
    if points.ndim == 2:
        points = jnp.moveaxis(points[chosen], 1, 2)
    else:
        points = jnp.take_along_axis(points, chosen[:, None], axis=0)
    return constants._replace(robot=dataclasses.replace(robot, platform_points=points))


def _affine(array: Array, derivatives: Any, changes: Sequence[Array]) -> Array:
    value = jnp.broadcast_to(array[..., None], (*array.shape, len(changes[0])))
    for derivative, change in zip(derivatives, changes, strict=True):
        value = value + derivative[..., None] * change.reshape((1,) * array.ndim + change.shape)
    return value


class SearchOverRobots(WorkspaceSearch):
    """Search for poses of many robots that meet a requirement; see `WorkspaceSearch`. `answers` takes the poses.

    Raises:
        RobotsApartError: the robots cannot be computed together.
    """

    def __init__(self, samples: RobotSamples) -> None:
        """Prepare the search from samples of the robots."""
        self._samples = samples._replace(robots=[_without_words(robot) for robot in samples.robots])
        super().__init__(self._samples.robots[0], samples.requirements[0])
        pairs = list(zip(self._samples.robots, samples.requirements, strict=True))
        row, magnitudes = PATTERNS[self.robot.pattern], [_largest(pair) for pair in pairs]
        # A facet normal that some robots lack would be missed in others: all samples together must have all of them.
        is_full = len(self._choices.table) == math.comb(self.robot.n_cables, self.robot.dof - 1)
        is_apart = max(magnitudes) > LARGEST_RATIO * min(magnitudes) or not is_full
        if row.along_line or row.is_jointed or self.robot.pulleys is not None or is_apart:
            raise RobotsApartError
        if self.requirement.condition == CLOSURE:
            # Components that are zero at all poses of some robots are told from others by the robot.
            if samples.attachments is not None or not self._has_all_components:
                raise RobotsApartError
        else:
            self._boundary *= max(magnitudes) / magnitudes[0]
        self._choices = self._choices._replace(counts=None)
        self._has_limits = any(map(has_limits, samples.requirements))
        self._families = {
            by_null_space: affine_constants(
                [self._constants(*pair, by_null_space=by_null_space) for pair in pairs], samples.values
            )
            for by_null_space in (False, *([True] if self._order else []))
        }

    def _trials(self) -> np.ndarray:
        # Matrices of all samples in turn, so that what is left out is left out of all robots.
        robots: list[Any] = list(self._samples.robots)
        for each in () if self._samples.attachments is None else self._samples.attachments:
            robots.append(dataclasses.replace(robots[0], platform_points=np.asarray(robots[0].platform_points)[each]))
        parts = [self._trials_of(robot) for robot in robots]
        choices = [choices_of(part[: self._few]) for part in parts]
        self._has_all_components = all(choice.counts is None for choice in choices)
        self._few = max(self._few, len(parts))
        count = min(map(len, parts))
        return np.stack([part[:count] for part in parts], axis=1).reshape(-1, *parts[0].shape[1:])

    def _stage(self, dtype: type, by_null_space: bool) -> Stage:
        margins = self._margins(dtype, by_null_space=by_null_space)
        family = cast(self._families[by_null_space], dtype)

        def compiled(batch: Any) -> Array:
            (positions, quaternions), robots = batch
            return margins(constants_of_lanes(family, *robots), positions, quaternions, None)

        def stage(poses: Poses) -> np.ndarray:
            return in_batches(compiled, self._lanes(poses, dtype), batch_size=self._batch(poses, dtype))

        return stage

    def _lanes(self, poses: Poses, dtype: type) -> Any:
        def lanes(array: np.ndarray, kind: type) -> tuple[np.ndarray, ...]:
            return tuple(np.ascontiguousarray(column, kind) for column in array.T)

        quaternions = lanes(poses.quaternions, dtype) if PATTERNS[self.robot.pattern].is_body else None
        values, attachments = poses.robots
        chosen = None if attachments is None else lanes(attachments, np.int32)
        return (lanes(poses.positions, dtype), quaternions), (lanes(values, dtype), chosen)

    def facets(self, poses: Poses) -> tuple[Float[np.ndarray, "f n"], Float[np.ndarray, "k f n"]]:
        """Margins along each facet normal, of which the margin is the smallest, and derivatives by the parameters."""
        lanes = self._lanes(poses, np.float64)
        values, derivatives = in_batches(self._facet_kernel, lanes, batch_size=FACET_BATCH, axis=-1)
        return values, derivatives

    @functools.cached_property
    def _facet_kernel(self) -> Callable[..., Any]:
        table = self._choices.table

        def compiled(batch: Any) -> tuple[Array, Array]:
            poses, (values, attachments) = batch

            def margins(values: Sequence[Array]) -> Array:
                return self._along(poses, (values, attachments), table)

            ones, zeros = jnp.ones_like(poses[0][0]), jnp.zeros_like(poses[0][0])
            tangents = [tuple(ones if i == k else zeros for i in range(len(values))) for k in range(len(values))]
            parts = [jax.jvp(margins, (values,), (tangent,))[1] for tangent in tangents]
            result = margins(values)
            return result, jnp.stack(parts) if parts else jnp.zeros((0, *result.shape))

        return jax.jit(compiled)

    @property
    def _facet_error(self) -> float:
        magnitude = self._boundary / BOUNDARY
        return FACET_ERROR * magnitude * (1.0 if np.isfinite(self.requirement.high).all() else OF_VERY_LARGE)

    def _along(self, poses: Any, robots: Any, table: Any, changes: Any = (0.0, 0.0)) -> Array:
        # Margins (f, n) along the facet normals of a table, with changed limits of tensions.
        (positions, quaternions), length = poses, as_float64(self._length)
        constants = constants_of_lanes(self._families[False], *robots)
        columns, loss = geometry.wrench_columns(constants.robot, positions, quaternions, length)
        low, high, measure = constants.limits
        # Products of derivatives with an infinite limit have no value; with a very large one they have.
        very_large = self._boundary / BOUNDARY * VERY_LARGE
        low, high = (x.reshape(len(x), -1) + change for x, change in zip((low, high), changes, strict=True))
        limits = TensionLimits(low, jnp.where(jnp.isinf(high), very_large, high), measure)

        def along(row: Array) -> Array:
            facet: Any = row[None]
            bounds = kernels.by_normals(
                columns,
                loss,
                constants.wrenches,
                limits,
                CableSubsets(facet, None),
                measure=self._measure,
                is_bounded=True,
            )
            lower, upper = jnp.real(bounds), jnp.imag(bounds)
            # Cables that depend on each other have no normal but rounding; other cables have all facets.
            return jnp.where(upper - lower <= self._facet_error, 0.5 * (lower + upper), jnp.inf)

        return jax.vmap(along)(table)

    @property
    def facet_count(self) -> int:
        """Number of facet normals."""
        return len(self._choices.table)

    def by_limits(self, poses: Poses, facet: int) -> tuple[Float[np.ndarray, "c n"], Float[np.ndarray, "c n"]]:
        """Derivatives of the margin along a facet normal by the smallest and by the largest tension of each cable."""
        table = self._choices.table[facet][None]
        inner, robots = self._lanes(poses, np.float64)
        zeros = jnp.zeros((self.robot.n_cables, len(poses.positions)))

        def margin(low: Array, high: Array) -> Array:
            return self._along(inner, robots, table, (low, high))[0]

        tangents = [zeros.at[cable].set(1.0) for cable in range(self.robot.n_cables)]
        low = [jax.jvp(margin, (zeros, zeros), (tangent, zeros))[1] for tangent in tangents]
        high = [jax.jvp(margin, (zeros, zeros), (zeros, tangent))[1] for tangent in tangents]
        return np.stack(low), np.stack(high)

    def _problems(self, poses: Poses) -> Iterator[tuple[np.ndarray, RequiredWrenches, np.ndarray, np.ndarray]]:
        lanes = self._lanes(poses, np.float64)
        length = as_float64(self._length)
        family = self._families[False]
        columns, constants = in_batches(
            lambda batch: _matrices(family, batch, length), lanes, batch_size=BATCH, axis=-1
        )
        for i in range(len(poses.positions)):
            (low, high, _), (points, box, ellipsoids) = jax.tree.map(lambda x, i=i: x[..., i], constants)
            yield columns[..., i], RequiredWrenches(np.array(points), box, tuple(ellipsoids)), low, high


def _matrices(family: AffineConstants, batch: Any, length: Array) -> Any:
    (positions, quaternions), robots = batch
    constants = constants_of_lanes(family, *robots)
    columns, _ = geometry.wrench_columns(constants.robot, positions, quaternions, length)
    shape = positions[0].shape

    def of_lanes(array: Array, first: Array) -> Array:
        return jnp.broadcast_to(array if array.ndim > np.ndim(first) else array[..., None], np.shape(first) + shape)

    numbers, first = (constants.limits, constants.wrenches), (family.first.limits, family.first.wrenches)
    return jnp.stack(columns), jax.tree.map(of_lanes, numbers, first)


def _largest(pair: tuple[AnyRobot, Requirement]) -> float:
    # The largest of the limits and of the required wrenches, N.
    robot, demanded = pair
    sizes = demanded.wrenches.magnitude, float(robot.mass * robot.gravity)
    return float(np.abs([*demanded.low, *demanded.high[np.isfinite(demanded.high)], *sizes]).max())


def _without_words(robot: AnyRobot) -> AnyRobot:
    # Without name, and without the record of attachment points that fall together, which differ between robots.
    if isinstance(robot, PlatformRobot):
        return dataclasses.replace(robot, name="", joints=tuple(range(robot.n_cables)))
    return dataclasses.replace(robot, name="")
