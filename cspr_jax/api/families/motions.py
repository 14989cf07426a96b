"""Single motions from Python: pure jax, in the axes of the robot, to be jitted, vmapped and differentiated.

Motions and margins have the precision that jax is set to: call `jax.config.update("jax_enable_x64", True)` for float64.
Searches use float64 in any case.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.arguments.kernel_arguments import amplitude_of, check_rule, kernel_problem, warn_of_rest
from cspr_jax.curves.files import kept_to, placed_inward, reference_of, samples_of, source_spline
from cspr_jax.curves.interpolation import linear_maps
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import InputError
from cspr_jax.errors.arguments import (
    Arcs,
    BetaHats,
    Depth,
    Point,
    Points,
    Quaternions,
    QuaternionsAtEnds,
    Samples,
    Tau,
    Times,
    Turns,
)
from cspr_jax.families.platforms.end_acceleration import AT_REST
from cspr_jax.families.platforms.platform_segment import PlatformMotion, pose_segment
from cspr_jax.families.swings.hypocycloid import Hypocycloid, segment
from cspr_jax.families.swings.transitions import transition as transitions
from cspr_jax.motion import slacks as motion_slacks
from cspr_jax.motion.amplitudes import Amplitude, named
from cspr_jax.motion.motion import Motion, Placed, inward
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import IDENTITY, Frame
from cspr_jax.robots import cables
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot, rest_point
from cspr_jax.robots.model.state import State
from cspr_jax.robots.model.tension_rule_table import CENTRED
from cspr_jax.robots.statics.kernel_axes import centred, prepared

amplitude = checked(name="amplitude", module=__name__)(named)
# Compile all operations together: XLA would compile each of them by itself.
_SLACKS = jax.jit(motion_slacks.slacks)
_MARGIN = jax.jit(motion_slacks.sampled_margin, static_argnames="samples")


@checked(traced=True)
def make_problem(
    robot: AnyRobot, *, amplitude: str | Amplitude = "quintic", limits: Limits | None = None
) -> Problem[Any]:
    """Problem for `slacks` and `sampled_margin`: robot, limits and amplitude function.

    Args:
        robot: robot on as many cables as degrees of freedom.
        amplitude: name of an amplitude function, or the function itself.
        limits: replace those of the robot, one by one; the floor is z in the robot's axes. None: those of the robot.

    Returns:
        the problem.

    Raises:
        InputError: limits that contradict each other, an unknown amplitude function, or too many cables.
    """
    return kernel_problem(robot, amplitude, limits, free_end=None)[0]


@checked(traced=True)
def hypocycloid(
    robot: PointMassRobot,
    start: Point | None,
    end: Point,
    *,
    z0: Depth,
    arcs: Arcs,
    amplitude: str | Amplitude = "quintic",
) -> Placed[Hypocycloid]:
    """Standard hypocycloid of a point mass between two points, thesis chapter 2.

    Args:
        robot: point mass on three cables.
        start: (3,) start point in the robot's axes, m; None: at rest in P0. Near P0 the motion depends on the direction
            from P0, and gradients grow as the inverse of the distance: a start within 1e-3 m or 1e-3 z0 of P0, but not
            at rest, gives a warning unless jax traces it.
        end: (3,) end point in the robot's axes, m.
        z0: () depth of P0 below the centroid of the spools, m.
        arcs: () number of arcs.
        amplitude: name of an amplitude function, or the function itself; it must satisfy (2.49).

    Returns:
        the motion, in the robot's axes.

    Raises:
        InputError: the wrong kind of robot, or an amplitude function that breaks (2.49).
    """
    prepared_robot, frame = _prepared(robot, ("3T",), "a point mass on three cables")
    function, p = amplitude_of(amplitude, free_end=False), jnp.asarray(arcs, float)
    first, last = _inward_positions(robot, frame, start, end, z0)
    geometry = segment(prepared_robot, first, last, jnp.asarray(z0, float), odd=jnp.mod(p, 2.0) == 1.0)
    return Placed(Hypocycloid(geometry, function, p), frame)


@checked(traced=True)
def transition(
    robot: PointMassRobot,
    target: Point,
    *,
    z0: Depth,
    oscillations: Turns,
    amplitude: str | Amplitude = "quintic",
) -> Placed[Hypocycloid]:
    """Transition of a point mass from rest in P0 to a target, thesis chapter 1.

    Args:
        robot: point mass on three cables, or on two in a plane.
        target: (3,) target in the robot's axes, m.
        z0: () depth of P0 below the centroid of the spools, m.
        oscillations: () number n of oscillations.
        amplitude: name of an amplitude function, or the function itself; it must satisfy (1.27) and (1.28).

    Returns:
        the motion, in the robot's axes.

    Raises:
        InputError: the wrong kind of robot, or an amplitude function that breaks (1.27) or (1.28).
    """
    prepared_robot, frame = _prepared(robot, ("2T", "3T"), "a point mass")
    function = amplitude_of(amplitude, free_end=True)
    end = jnp.asarray(frame.inward(target), float)
    geometry = transitions.transition(prepared_robot, function, end, jnp.asarray(z0, float))
    return Placed(Hypocycloid(geometry, function, 2.0 * jnp.asarray(oscillations, float)), frame)


@checked(traced=True)
def platform_motion(
    robot: PlatformRobot,
    start: Point | None,
    end: Point,
    *,
    z0: Depth,
    arcs: Arcs,
    orientations: QuaternionsAtEnds = (IDENTITY, IDENTITY),
    beta_hat: BetaHats = (AT_REST, AT_REST),
    amplitude: str | Amplitude = "quintic",
    variable: bool = True,
) -> Placed[PlatformMotion]:
    """Motion of a platform between two poses, thesis chapter 3.

    Args:
        robot: platform on six cables or more; jax may trace its spools, but not its platform points.
        start: (3,) start of the mass centre in the robot's axes, m; None: P0. For a start near P0 see `hypocycloid`.
        end: (3,) end of the mass centre in the robot's axes, m.
        z0: () depth of P0 below the centroid of the spools, m.
        arcs: () number of arcs.
        orientations: (2, 4) unit quaternions at start and end, scalar first, relative to the reference orientation.
        beta_hat: (2,) beta-hat at start and end, (3.81); -1 at rest.
        amplitude: name of an amplitude function, or the function itself; it must satisfy (2.49).
        variable: whether the position is a hypocycloid of variable amplitude (3.44), or a standard one.

    Returns:
        the motion, in the robot's axes.

    Raises:
        InputError: the wrong kind of robot, or an amplitude function that breaks (2.49).
    """
    prepared_robot, frame = _prepared(robot, ("3R3T",), "a platform on six cables or more", any_cables=True)
    function, p = amplitude_of(amplitude, free_end=False), jnp.asarray(arcs, float)
    positions = _inward_positions(robot, frame, start, end, z0)
    quaternions = [jnp.asarray(frame.rotated_quaternions(as_float64(one)), float) for one in orientations]
    beta_hats = (jnp.asarray(beta_hat[0], float), jnp.asarray(beta_hat[1], float))
    first, last = zip(positions, quaternions, strict=True)
    geometry = pose_segment(prepared_robot, first, last, jnp.asarray(z0, float), beta_hats, odd=jnp.mod(p, 2.0) == 1.0)
    return Placed(PlatformMotion(geometry, function, p, PlatformMotionKind(variable=variable)), frame)


@checked(traced=True)
def spline(
    robot: AnyRobot,
    times: Times,
    positions: Points,
    quaternions: Quaternions | None = None,
    *,
    velocities: Points | None = None,
    accelerations: Points | None = None,
    interpolation: Literal["cubic", "quintic", "hermite"] | None = None,
    ends: Literal["rest", "natural", "periodic"] | None = None,
) -> Placed[Spline]:
    """Motion through samples, as a piecewise polynomial in time.

    Args:
        robot: robot of any pattern, on any number of cables.
        times: (n,) increasing, s; jax may trace positions, velocities and accelerations, but no other argument.
        positions: (n, 3) positions of the mass centre, in the robot's axes, m.
        quaternions: (n, 4) orientations of the platform, scalar first; None: its own axes.
        velocities: (n, 3) m/s, for Hermite pieces.
        accelerations: (n, 3) m/s^2, for Hermite pieces.
        interpolation: "cubic", "quintic" or "hermite"; None: "hermite" if there are velocities, else "cubic".
        ends: "rest", "natural" or "periodic"; None: "rest".

    Returns:
        the motion, in the robot's axes; orientations of its states are relative to the reference orientation.

    Raises:
        InputError: samples that do not define a motion.
    """
    samples = [array for array in (positions, velocities, accelerations) if array is not None]
    options = {"interpolation": interpolation, "ends": ends}
    if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(samples)):
        return _spline(robot, times, quaternions, samples, **options)
    # Orientations and knots do not depend on traced arrays, and coefficients are linear in them.
    arrays = [jnp.asarray(array, float) for array in samples]
    placed = _spline(robot, times, quaternions, [np.zeros(array.shape) for array in arrays], **options)
    kind = interpolation or ("cubic" if velocities is None else "hermite")
    maps = linear_maps(np.asarray(times, float), kind, ends or "rest", len(arrays))
    table = sum(jnp.einsum("pdn,nw->pdw", part, array) for part, array in zip(maps, arrays, strict=False))
    moved = dataclasses.replace(placed.motion, position=jnp.asarray(placed.frame.inward(table)))
    return dataclasses.replace(placed, motion=moved)


def _spline(robot: AnyRobot, times, quaternions, arrays: list, **options: str | None) -> Placed[Spline]:
    samples = samples_of(times, arrays[0], quaternions, *arrays[1:])
    curve = source_spline(samples, z_axis=robot.z_axis, is_platform=isinstance(robot, PlatformRobot), **options)
    curve, frame = kept_to(robot.pattern, curve, is_planar=False), centred(robot)[1]
    return Placed(placed_inward(curve, frame, reference_of(robot)), frame)


@checked(traced=True)
def tensions(robot: AnyRobot, state: State, rule: str = CENTRED) -> Array:
    """Tensions of the cables in a state of motion.

    Args:
        robot: platform or point mass.
        state: state of a motion, in the robot's axes.
        rule: rule that chooses the tensions of redundant cables: "centred", "least-norm", "closed-form",
            "improved-closed-form" or "p-norm".

    Returns:
        (n_cables,) in cable order, N; negative if a cable would have to push. For redundant cables the rule chooses
        tensions within the robot's limits; if it finds none, they are those of least norm.

    Raises:
        InputError: an unknown rule, or a rule that needs a largest tension of every cable on a robot without them.
    """
    prepared_robot, frame = prepared(robot, pulleys=True)
    check_rule(robot, rule)
    return cables.tensions(prepared_robot, inward(frame, state), robot.limits, rule)


@checked(traced=True)
def slacks(problem: Problem, motion: Motion, tau: Tau) -> Array:
    """Slacks of all criteria at one time of a motion: taut cables, determinant, depth, limits.

    Args:
        problem: problem of `make_problem` with the motion's robot.
        motion: motion of `hypocycloid`, `transition`, `platform_motion`, a plan or answers.
        tau: () normalised time in [0, 1].

    Returns:
        (n_slacks,) dimensionless, in the order of `motion.slacks`; all are positive while the motion is feasible.
    """
    return _SLACKS(problem, _inner(motion), jnp.asarray(tau, float))


@checked(traced=True)
def sampled_margin(problem: Problem, motion: Motion, samples: Samples = 64) -> Array:
    """Smallest slack at equidistant times of a motion; it can be differentiated.

    If it is positive, no sample refutes the motion, but nothing is proved: searches prove feasibility.

    Args:
        problem: problem of `make_problem` with the motion's robot.
        motion: as in `slacks`.
        samples: number of intervals between the times, which include both ends.

    Returns:
        () dimensionless.
    """
    return _MARGIN(problem, _inner(motion), samples=samples)


def _inward_positions(robot: Any, frame: Frame, start, end, z0) -> tuple[Array, Array]:
    # Arguments are in the kernels' axes. Do not warn of positions that jax traces, since they have no values yet.
    if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves((robot, start, end, z0))):
        if start is not None:
            warn_of_rest(robot, "start", start, z0, "start = None")
        warn_of_rest(robot, "end", end, z0, "its coordinates in full")
    first = rest_point(jnp.asarray(z0, float)) if start is None else jnp.asarray(frame.inward(start), float)
    return first, jnp.asarray(frame.inward(end), float)


def _inner(motion: Motion) -> Motion:
    return motion.motion if isinstance(motion, Placed) else motion


def _prepared(robot: Any, patterns: tuple[str, ...], allowed: str, *, any_cables: bool = False) -> tuple[Any, Any]:
    if getattr(robot, "pattern", None) not in patterns or not (any_cables or robot.n_cables == robot.dof):
        raise InputError("robot", getattr(robot, "name", robot), allowed)
    return prepared(robot)
