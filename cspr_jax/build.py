"""Problems for the kernels, built from checked files: robot, limits, amplitude function, axes."""

import dataclasses
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cspr_jax.arithmetic.elementary import leaf
from cspr_jax.arithmetic.frames import Frame, frame_of
from cspr_jax.arithmetic.rotations import UNIT_TOLERANCE, cylindrical_frames, from_tilt_torsion
from cspr_jax.config.limits import LimitKeys, LimitTable
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.config.trajectory import NamedAmplitude, PolynomialAmplitude, TrajectoryKeys
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.motions import amplitudes
from cspr_jax.motions.amplitudes import Amplitude, boundary_errors
from cspr_jax.motions.given_limits import check_bounded, check_certain, limits_of
from cspr_jax.motions.platform_kind import Kind
from cspr_jax.motions.problem import Problem
from cspr_jax.robots import point_mass
from cspr_jax.robots.cables import with_cables
from cspr_jax.robots.limits import NO_LIMITS, Limits
from cspr_jax.robots.parallel_pairs import ParallelPairs
from cspr_jax.robots.platform import PlatformRobot, platform_robot
from cspr_jax.robots.point_mass import STANDARD_GRAVITY, PointMassRobot
from cspr_jax.robots.pulleys import Pulleys
from cspr_jax.robots.reference_pose import aligned, reference_pose
from cspr_jax.robots.robot import MOVED, check_moved
from cspr_jax.robots.static_equilibrium import slack_at_rest
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.limits import LIMITS

MAKERS = {"1T": point_mass.guided_robot, "2T": point_mass.planar_robot, "3T": point_mass.point_mass_robot}

RobotKind = TypeVar("RobotKind", bound=PointMassRobot | PlatformRobot)


def centred(robot: RobotKind) -> tuple[RobotKind, Frame]:
    """A robot as the kernels take it: from the centroid of its spools, z down, without limits.

    Args:
        robot: in its own axes.

    Returns:
        the robot, and the frame that takes points to it and back.
    """
    frame = frame_of(robot.base_points, robot.z_axis)
    changes: dict[str, Any] = {"base_points": leaf(frame.inward(robot.base_points)), "z_axis": "down"}
    if isinstance(robot, PlatformRobot):
        changes["platform_points"] = leaf(frame.turned(robot.platform_points))
        changes["inertia"] = frame.turned_tensor(leaf(robot.inertia))
        if robot.centre_of_mass is not None:
            changes["centre_of_mass"] = leaf(frame.turned(robot.centre_of_mass))
    if robot.pulleys is not None:
        changes["pulleys"] = Pulleys(robot.pulleys.radius, leaf(frame.turned(robot.pulleys.axes)))
    return dataclasses.replace(robot, limits=NO_LIMITS, **changes), frame


def prepared(robot: RobotKind) -> tuple[RobotKind, Frame]:
    """A robot as the kernels take it, a platform also in its reference axes.

    Args:
        robot: in its own axes.

    Returns:
        the robot, and the frame that takes points to it and back.

    Raises:
        InputError: a robot that no trajectory moves, as `robots.robot.check_moved` says.
    """
    check_moved(robot)
    own, frame = centred(robot)
    return (aligned(own)[0] if isinstance(own, PlatformRobot) else own), frame  # type: ignore[return-value]


def gravity_of(spec: RobotFile, keys: TrajectoryKeys) -> float:
    """Gravity: the plan's or sweep's, else the robot's, else 9.81 m/s^2.

    Args:
        spec: the robot.
        keys: of the plan or sweep.

    Returns:
        m/s^2.
    """
    return keys.gravity or spec.gravity or STANDARD_GRAVITY


def build_robot(spec: RobotFile, keys: TrajectoryKeys, file: object) -> PointMassRobot | PlatformRobot:
    """The robot of a file, in its own axes and with its own limits.

    Args:
        spec: the robot file's content.
        keys: of the plan or sweep.
        file: named in errors.

    Returns:
        the robot.

    Raises:
        ConfigError: its geometry, inertia or limits cannot be used.
    """
    given: dict[str, Any] = {"mass": spec.mass, "gravity": gravity_of(spec, keys), "name": spec.name}
    given |= {"z_axis": spec.z_axis, "limits": build_limits(spec, LimitKeys(), file)}
    try:
        if not spec.is_platform:
            return with_cables(MAKERS[spec.own_pattern](spec.base_points, **given), **_of_cables(spec))
        given |= {"inertia": spec.inertia, "centre_of_mass": spec.centre_of_mass or [0.0, 0.0, 0.0]}
        robot = platform_robot(spec.base_points, spec.platform_points, pattern=spec.own_pattern, **given)
        return with_cables(robot, **_of_cables(spec))
    except InputError as error:
        raise ConfigError(file, spec.typed(error)) from error


def _of_cables(spec: RobotFile) -> dict[str, Any]:
    return {name: getattr(spec, name) for name in ("cable_diameter", "pulley_radius", "pulley_axes")}


def load_robot(reference: str | Path) -> PointMassRobot | PlatformRobot:
    """A robot of the catalogue, or of a file, with its axes and its limits.

    Args:
        reference: a catalogue name, or the path of a robot file.

    Returns:
        the robot: a point mass or a platform.

    Raises:
        ConfigError: no such robot, or a mistake in its file.
    """
    spec = resolve_robot(str(reference), reference, Path.cwd())
    return build_robot(spec, TrajectoryKeys(), reference)


def kernel_robot(spec: RobotFile, keys: TrajectoryKeys, file: object, *, any_cables: bool = False) -> Any:
    """The robot of a file, as the kernels take it; a platform's axes are still those of the file.

    Args:
        spec: the robot file's content.
        keys: of the plan or sweep.
        file: named in errors.
        any_cables: whether there may be more cables than degrees of freedom.

    Returns:
        the robot, centred.

    Raises:
        ConfigError: its geometry or inertia cannot be used, it has more cables than degrees of freedom, or no
            trajectory moves such a robot.
    """
    robot: Any = build_robot(spec, keys, file)
    place, key = spec.placed("base_points", file)
    try:
        check_moved(robot)
        if not _is_redundant_platform(robot):
            check_bounded(robot.limits)
    except InputError as error:
        raise ConfigError(place, key.removesuffix("base_points") + str(error)) from error
    if robot.n_cables != robot.dof and not any_cables:
        raise ConfigError(
            place,
            f'{key}: {robot.n_cables} points: must be {robot.dof} for family "{keys.family}" '
            "(it does not exist yet for more cables than degrees of freedom)",
        )
    return centred(robot)[0]


def fault_at_rest(spec: RobotFile) -> str | None:
    """Reason why a robot cannot hang still in its reference orientation, if it cannot.

    Args:
        spec: the robot; a platform is tried as deep below the centroid of its spools as these are away from it, one
            on more cables at many depths, `robots.static_equilibrium`.

    Returns:
        the reason; None if it hangs with every cable taut.
    """
    spec = spec.equivalent() if spec.translation_only else spec
    try:
        if len(spec.base_points) > spec.dof or spec.own_pattern not in MOVED:
            return slack_at_rest(centred(shared := build_robot(spec, TrajectoryKeys(), spec.name))[0], shared.limits)
        if spec.is_platform:
            robot = kernel_robot(spec, TrajectoryKeys(), spec.name)
            reference_pose(robot, float(np.linalg.norm(np.asarray(robot.base_points), axis=1).mean()))
        else:
            build_robot(spec, TrajectoryKeys(), spec.name)
    except (ConfigError, InputError) as error:
        return str(error)
    return None


def build_amplitude(
    keys: TrajectoryKeys, file: object, *, epsilon: float | None = None, at: str = "", for_bounds: bool = False
) -> Amplitude:
    """The amplitude function, its boundary conditions checked.

    Args:
        keys: of the plan or sweep.
        file: named in errors.
        epsilon: stands in for "best".
        at: prefix of the key in errors.
        for_bounds: whether "ideal" will do, which is no motion.

    Returns:
        the function.

    Raises:
        ConfigError: it breaks (2.49), of a transition (1.27) or (1.28); epsilon = "best" where a value must be given.
    """
    key = keys.amplitude
    if isinstance(key, PolynomialAmplitude):
        amplitude, given = amplitudes.from_polynomial(key.polynomial), shown(list(key.polynomial))
    elif isinstance(key, NamedAmplitude):
        value = key.epsilon if isinstance(key.epsilon, float) else epsilon
        if value is None:
            raise ConfigError(file, f'{at}amplitude.epsilon = "best": must be a number in ]0, 0.5] (a plan can choose)')
        amplitude, given = amplitudes.named(key.name, value), shown(key.name)
    else:
        amplitude, given = amplitudes.named(key), shown(key)
    free_end = all(FAMILIES[name].free_end for name in keys.families)
    broken = [] if key == "ideal" and for_bounds else boundary_errors(amplitude, free_end=free_end)
    if broken:
        conditions = "(1.27) and (1.28)" if free_end else "(2.49)"
        raise ConfigError(file, f"{at}amplitude = {given}: must meet {conditions}, but " + "; ".join(broken))
    return amplitude


def build_limits(spec: RobotFile, keys: LimitKeys, file: object) -> Limits:
    """Limits of the file over those of the robot.

    Args:
        spec: the robot.
        keys: of the plan or sweep.
        file: named in errors.

    Returns:
        the limits.

    Raises:
        ConfigError: a smallest tension that is not below the largest, or a list of another length.
    """
    pairs = spec.pairs
    try:
        limits = limits_of(spec, vars(keys), vars(spec), "", len(spec.as_written.base_points))
        return limits if pairs is None else pair_limits(limits, pairs)
    except InputError as error:
        raise ConfigError(file, str(error)) from error


def pair_limits(limits: Limits, pairs: ParallelPairs) -> Limits:
    """Limits of the three cables that stand for pairs of six.

    Args:
        limits: of the six cables; the floor is that of the effector.
        pairs: the pairs.

    Returns:
        the limits, (3,) each.

    Raises:
        InputError: of some pair no tension is within the limits of both cables.
    """
    values: dict[str, Any] = {
        row.name: leaf(pairs.bound(value, is_tension=row.quantity == "tension", is_least=row.sense == "least"))
        for row in LIMITS
        if row.per_cable and (value := getattr(limits, row.name)) is not None
    }
    low, high = values.get("tension_min"), values.get("tension_max")
    if low is not None and high is not None and not (low < high).all():
        pair = int(np.argmin(high - low))
        allowed = "must be below tension_max, each over the cable's share of it"
        first, second = (pairs.cables[pair] + 1).tolist()
        raise InputError(
            "tension_min", None, allowed, fault=f"{low[pair]:.6g} N of the pair of cables {first} and {second}"
        )
    return dataclasses.replace(limits, **values)


def limits_over(
    robot: PointMassRobot | PlatformRobot,
    limits: Limits | None,
    *,
    any_tensions: bool = False,
    families: tuple[str, ...] = (),
) -> Limits:
    """Limits that are given over those of a robot, as the kernels take them.

    Args:
        robot: in its own axes.
        limits: one number or one a cable each, in the robot's axes; None: those of the robot.
        any_tensions: whether some of the largest tensions may be infinite.
        families: of the trajectories that are judged by all of an uncertainty; none: there may be none.

    Returns:
        the limits.

    Raises:
        InputError: numbers of another count, or no limits at all: not finite, a length or speed that is not positive,
            a smallest tension that is not below the largest.
    """
    found = limits_of(robot, vars(limits or NO_LIMITS), vars(robot.limits), "limits.")
    if not any_tensions:
        check_bounded(found)
    check_certain(robot, found, families)
    return found


def build_problem(
    spec: RobotFile,
    keys: TrajectoryKeys,
    limits: LimitTable,
    file: object,
    *,
    epsilon: float | None = None,
    at: str = "",
    for_bounds: bool = False,
    any_cables: bool = False,
) -> Problem:
    """Robot, limits and amplitude function of a plan or sweep, as the kernels take them.

    Args:
        spec: the robot file's content.
        keys: of the trajectory.
        limits: keys of the limits.
        file: named in errors.
        epsilon: stands in for an amplitude function's "best".
        at: prefix of keys of the trajectory in errors.
        for_bounds: whether the amplitude function may be "ideal", which is no motion.
        any_cables: whether there may be more cables than degrees of freedom.

    Returns:
        the problem: its robot is centred; a platform in its reference axes.

    Raises:
        ConfigError: the robot, the amplitude function or the limits cannot be used.
    """
    amplitude = build_amplitude(keys, file, epsilon=epsilon, at=at, for_bounds=for_bounds)
    given = build_limits(spec, limits, file)
    robot = kernel_robot(spec, keys, file, any_cables=any_cables)
    try:
        if not _is_redundant_platform(robot):
            check_bounded(given)
        check_certain(robot, given, keys.families, in_pairs=spec.pairs is not None)
    except InputError as error:
        raise ConfigError(file, str(error)) from error
    return Problem(aligned(robot)[0] if isinstance(robot, PlatformRobot) else robot, given, amplitude)


def _is_redundant_platform(robot: PointMassRobot | PlatformRobot) -> bool:
    # Judged by margins of its tensions, which know cables without a largest one.
    return isinstance(robot, PlatformRobot) and robot.n_cables > robot.dof


def motion_kind(keys: TrajectoryKeys, *, from_rest: bool = False) -> Kind:
    """Kind of the motions of a platform.

    Args:
        keys: of the plan or sweep.
        from_rest: whether all start at rest in P0.

    Returns:
        the kind.
    """
    return Kind(keys.family == "hypocycloid", keys.beat == "beta_1", from_rest)


def orientations(frame: Frame, points: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Orientations of tilt and torsion in the cylindrical frame of their places, (3.98), in the kernels' axes.

    Args:
        frame: of the file, whose axes the angles are of.
        points: (n, 3) from the centroid of the spools, z down, m.
        angles: (n, 3) phi, theta, sigma, rad.

    Returns:
        (n, 4) unit quaternions.
    """
    return frame.turned_quaternions(from_tilt_torsion(angles + cylindrical_frames(frame.turned(points))))


def given_quaternion(quaternion: list[float] | None, key: str, file: object) -> np.ndarray:
    """An orientation given as a quaternion, which may miss length 1 by rounding.

    Args:
        quaternion: scalar first; None: the reference orientation.
        key: named in errors.
        file: named in errors.

    Returns:
        (4,) of unit length.

    Raises:
        ConfigError: not of unit length.
    """
    given = np.asarray([1.0, 0.0, 0.0, 0.0] if quaternion is None else quaternion)
    size = float(np.linalg.norm(given))
    if abs(size - 1.0) > UNIT_TOLERANCE:
        raise ConfigError(file, f"{key} = {shown(quaternion)}: must have length 1 (it has {size:.7g})")
    return given / size
