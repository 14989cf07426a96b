"""How tests ask the package for least times along paths: one function, which knows the package's names and axes."""

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np
from oracles.sampled_motion import State

import cspr_jax
from cspr_jax.curves.spline import Spline
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.least_time import least_time_motion
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds.piecewise_bounds import bernstein_of_powers
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.proved_answers import proved_answers
from support.motions import states_along


@dataclasses.dataclass(frozen=True)
class Answer:
    """What the package says of a path.

    verdict: "feasible" if the motion is proved, "undecided", or a reason why there is none. time, s: infinite without a
    motion. lower: lower bound of the least time, s. motion: motion(times) gives, for times (k,) from 0 to `time`, an
    `oracles.sampled_motion.State` of the mass centre in the axes of the robot's base points; None without a motion.
    """

    verdict: str
    time: float
    lower: float
    motion: Callable | None


def solve(robot, path, limits, grid=500, ramp_time=0.0):
    """Answer of the package."""
    with double_precision():
        prepared, frame = centred(robot_of(robot))
        sizes = {name: np.ones(prepared.n_cables) for name in limits if name not in ("speed_max", "acceleration_max")}
        problem = Problem(
            prepared, Limits(**{k: as_float64(v * sizes.get(k, 1.0)) for k, v in limits.items()}), named("A1")
        )
        section = section_of(path, frame)
        least = least_time_motion(problem, section, SectionSettings(grid, ramp_time))
        # The reference knows no bodies.
        flags = Verdict(int(proved_answers(problem, [least.motion], None).verdict[0]))
        verdict = flags & ~(Verdict.CABLE_CABLE | Verdict.CABLE_PLATFORM)
    if least.failure is not None:
        return Answer(verdict.text, np.inf, np.inf, None)
    motion = partial(sampled_states, Placed(least.motion, frame))
    return Answer(verdict.text if verdict else "feasible", least.duration, least.lower_bound, motion)


def section_of(path, frame):
    """The section of a path of the reference, in the axes of the kernels."""
    knots = np.asarray(path.positions.knots) - path.positions.knots[0]
    width = np.diff(knots)[:, None, None]

    def table(spline):
        powers = np.asarray(spline.coefficients)
        return bernstein_of_powers(powers * width ** np.arange(powers.shape[1])[:, None])

    quaternion = None
    if path.quaternions is not None:
        quaternion = as_float64(table(path.quaternions) * np.concatenate([[1.0], frame.signs]))
    curve = Spline(as_float64(knots), as_float64(frame.inward(table(path.positions))), quaternion)
    return Section(curve, np.full(len(knots) - 1, np.inf), knots)


def sampled_states(motion, times):
    # The last instant belongs to the motion.
    with double_precision():
        tau = np.clip(np.asarray(times) / float(motion.duration()), 0.0, 1.0)
        states = states_along(motion, tau)
    count = len(tau)
    if states.rotation is None:
        eye, none = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
        return State(states.position, states.velocity, states.acceleration, eye, none, none)
    return State(*states[:3], states.rotation, states.angular_velocity, states.angular_acceleration)


def robot_of(robot):
    """The robot of the reference's dict."""
    numbers = {name: robot[name] for name in ("mass", "gravity", "z_axis") if name in robot}
    if robot["platform_points"] is None:
        return cspr_jax.point_mass(robot["base_points"], planar=robot["pattern"] == "2T", **numbers)
    numbers |= {"inertia": robot["inertia"], "centre_of_mass": robot["centre_of_mass"]}
    return cspr_jax.platform(robot["base_points"], robot["platform_points"], pattern=robot["pattern"], **numbers)
