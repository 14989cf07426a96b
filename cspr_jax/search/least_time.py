"""Least durations along straight lines from rest to rest: arrays of ends in, arrays out.

What the S-model's formulas give is feasible by proof: the bounds of every face are met all along (see
`feasibility.point_mass.least_time`), with a margin above rounding, but where p / T is so near to 0 or 1 that the digits
of the shorter part are lost: that is undecided.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Literal

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.arithmetic.batches import in_batches
from cspr_jax.feasibility.point_mass import least_time as fastest
from cspr_jax.feasibility.point_mass.line_faces import line_faces, sides
from cspr_jax.robots.point_mass import PointMassRobot, plane_normal
from cspr_jax.robots.wrench_sets import spanning
from cspr_jax.schema import labelled
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.trajectories.timed_lines import fixed_law

if TYPE_CHECKING:
    import xarray

BATCH = 4096
Rule = Literal["optimum", "thesis"]
# Over gravity: margins nearer to zero are undecided, and rest with a smaller margin is none.
TOLERANCE = 1e-12
# Over the size of a robot: ends nearer to each other are one place.
SAME_PLACE = 1e-12
# Parts of a duration below which their digits are lost.
SHORT = 1e-6


@dataclasses.dataclass(frozen=True)
class LeastTimes:
    """Least durations along n lines; NumPy arrays, (n,) each.

    Fields:
        verdict: flags of `Verdict`; 0 where there is a feasible motion.
        duration: T, s; NaN where there is none, 0 where both ends are one place.
        acceleration_time: p, s.
        least_duration: no motion along the line is faster, s.
        duration_ratio: of the two.
        rest_margin: smaller one of the margins of rest at both ends, m/s^2; NaN where an end is not below the spools.
        active_up: number of the bound that holds back the acceleration, from 1 on in the order of `names_of`; 0: none.
        active_down: likewise of the braking.
        names: of the bounds, the first one's first.
    """

    verdict: np.ndarray
    duration: np.ndarray
    acceleration_time: np.ndarray
    least_duration: np.ndarray
    duration_ratio: np.ndarray
    rest_margin: np.ndarray
    active_up: np.ndarray
    active_down: np.ndarray
    names: tuple[str, ...]

    def arrays(self) -> dict[str, np.ndarray]:
        """The fields that have a value a line.

        Returns:
            (n,) each, by name.
        """
        return {name: values for name, values in vars(self).items() if isinstance(values, np.ndarray)}

    def to_xarray(self, dims: Mapping[str, np.ndarray] | None = None) -> "xarray.Dataset":
        """The answers for xarray, with units and long names.

        Args:
            dims: names and coordinates of the dimensions whose product the n answers are, the last one varying fastest;
                None: one dimension "target".

        Returns:
            the fields over these dimensions.

        Raises:
            InputError: dimensions of another number of points.
            ConfigError: xarray is not installed.
        """
        return labelled.over(self.arrays(), dims)


def names_of(robot: PointMassRobot) -> tuple[str, ...]:
    """Names of the bounds along a line.

    Args:
        robot: the robot.

    Returns:
        such as "cables 3, 4", one for each choice of cables, and "max_acceleration".
    """
    chosen = spanning(robot.n_cables, robot.dof) + 1
    return (*("cables " + ", ".join(map(str, row)) for row in chosen.tolist()), "max_acceleration")


@partial(jax.jit, static_argnames=("rule", "law"))
def _solved(robot: PointMassRobot, arguments, *, law: str, rule: str):
    def one(start, end, largest):
        faces = line_faces(robot, start, end)
        bounds = sides(faces, largest / jnp.linalg.norm(end - start))
        if law != "s-curve":
            least = fastest.least_of_law(fixed_law(law), bounds)
        elif rule == "optimum":
            least = fastest.least_s_curve(bounds)
        else:
            least = fastest.thesis_s_curve(bounds)
        sizes = jnp.stack([jnp.linalg.norm(faces.normal + t * faces.turn, axis=1) for t in (0.0, 1.0)])
        resting = -jnp.stack([faces.offset, faces.offset + faces.slope]) / jnp.where(sizes > 0.0, sizes, 1.0)
        rest = jnp.min(jnp.where(faces.bounds[None], resting, jnp.inf))
        depth = jnp.minimum(plane_normal(robot) @ start, plane_normal(robot) @ end)
        is_bounded = jnp.isfinite(bounds.up).any() & jnp.isfinite(bounds.down).any() & faces.bounds.any()
        return least, fastest.least_time(bounds), rest, depth, is_bounded

    return jax.vmap(one)(*arguments)


def least_times(
    robot: PointMassRobot,
    starts: np.ndarray,
    ends: np.ndarray,
    *,
    law: str = "s-curve",
    rule: Rule = "optimum",
    max_acceleration: float = np.inf,
    has_limits: bool = False,
) -> LeastTimes:
    """Least durations along straight lines.

    Args:
        robot: a point mass on spools in one plane, centred, z down.
        starts: (n, 3) m; at rest.
        ends: (n, 3) m; at rest.
        law: one of `trajectories.timed_lines.LAWS`.
        rule: of the S-model.
        max_acceleration: largest size of the acceleration, m/s^2.
        has_limits: whether there are limits, not looked at here: what is feasible but for them is undecided.

    Returns:
        the durations.
    """
    largest = np.full(len(starts), float(max_acceleration))
    kernel = partial(_solved, robot, law=law, rule=rule)
    least, bound, rest, depth, is_bounded = in_batches(kernel, (starts, ends, largest), size=BATCH)
    gravity, size = float(np.asarray(robot.gravity)), float(np.abs(np.asarray(robot.base_points)).max())
    is_same = np.linalg.norm(ends - starts, axis=1) <= SAME_PLACE * size
    rest = np.where(depth > 0.0, rest, np.nan)
    rests = rest > TOLERANCE * gravity
    possible = rests & ~is_same & is_bounded & np.isfinite(least.duration)
    nothing = np.where(rests & is_same, 0.0, np.nan)
    duration = np.where(possible, least.duration * (1.0 + fastest.LONGER), nothing)
    bound = np.where(possible, bound, nothing)
    verdict = _verdicts(possible | (rests & is_same), rest, depth, is_bounded, TOLERANCE * gravity)
    is_short = (np.minimum(least.ratio, 1.0 - least.ratio) < SHORT) & (law == "s-curve")
    doubtful = (verdict == 0) & ~is_same & (is_short | has_limits)
    verdict = np.where(doubtful, Verdict.UNDECIDED.value, verdict).astype(np.uint16)
    with np.errstate(invalid="ignore"):
        relative = duration / bound
    return LeastTimes(
        verdict=verdict,
        duration=duration,
        acceleration_time=np.where(possible, least.ratio, 0.5) * duration,
        least_duration=bound,
        duration_ratio=relative,
        rest_margin=rest,
        active_up=np.where(possible, least.up + 1, 0).astype(np.int16),
        active_down=np.where(possible, least.down + 1, 0).astype(np.int16),
        names=names_of(robot),
    )


def _verdicts(
    possible: np.ndarray, rest: np.ndarray, depth: np.ndarray, is_bounded: np.ndarray, doubt: float
) -> np.ndarray:
    # Why there is no motion at all: no rest at an end, or an acceleration without bounds.
    above, slack = ~(depth > 0.0), rest < -doubt
    flags = np.where(above, Verdict.ABOVE_SPOOLS.value, 0) | np.where(above | slack, Verdict.SLACK_CABLE.value, 0)
    open_ended = np.where(is_bounded, Verdict.UNDECIDED.value, Verdict.NOT_FINITE.value)
    return np.where(possible, 0, np.where(flags > 0, flags, open_ended)).astype(np.uint16)
