"""From checked files to what the kernels take: robot, limits, amplitude function, axes."""

import numpy as np

from cspr_jax import amplitudes, robots
from cspr_jax.amplitudes import Amplitude, boundary_errors
from cspr_jax.config.robot import LimitKeys, RobotFile
from cspr_jax.config.trajectory import NamedAmplitude, PolynomialAmplitude, TrajectoryKeys
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.feasibility.limits import Limits
from cspr_jax.numerics import leaf
from cspr_jax.platforms import PlatformRobot, platform_robot
from cspr_jax.reference_pose import reference_pose
from cspr_jax.robots import STANDARD_GRAVITY, PointMassRobot
from cspr_jax.rotations import UNIT_TOLERANCE, from_tilt_torsion
from cspr_jax.trajectories.pose_segment import Kind

# A z-up file is turned by half a turn about x: a rotation, so that nothing is mirrored.
_TURN = {"down": np.array([1.0, 1.0, 1.0]), "up": np.array([1.0, -1.0, -1.0])}


def axis_signs(spec: RobotFile) -> np.ndarray:
    """Factors between a file's axes and the kernels' (z down); the same both ways.

    Args:
        spec: the robot, whose z_axis holds for the whole file.

    Returns:
        (3,) of +1 and -1.
    """
    return _TURN[spec.z_axis]


def gravity_of(spec: RobotFile, keys: TrajectoryKeys) -> float:
    """Gravity: the plan's or sweep's, else the robot's, else 9.81 m/s^2.

    Args:
        spec: the robot.
        keys: of the plan or sweep.

    Returns:
        m/s^2.
    """
    return keys.gravity or spec.gravity or STANDARD_GRAVITY


def build_robot(spec: RobotFile, keys: TrajectoryKeys, file: object) -> PointMassRobot:
    """A point-mass robot, in the kernels' axes.

    Args:
        spec: the robot file's content.
        keys: of the plan or sweep.
        file: named in errors.

    Returns:
        the robot.

    Raises:
        ConfigError: its geometry cannot be used, or it is a rigid platform.
    """
    if spec.is_platform:
        raise ConfigError(file, f'robot "{spec.name}" is a rigid platform: must be a point mass here')
    try:
        points = np.asarray(spec.base_points) * axis_signs(spec)
        make = robots.planar_robot if spec.planar else robots.point_mass_robot
        return make(points, mass=spec.mass, gravity=gravity_of(spec, keys), name=spec.name)
    except InputError as error:
        raise ConfigError(file, spec.typed(error)) from error


def build_platform(spec: RobotFile, keys: TrajectoryKeys, file: object) -> PlatformRobot:
    """A six-cable robot, in the kernels' axes; its platform axes are still those of the file.

    Args:
        spec: the robot file's content.
        keys: of the plan or sweep.
        file: named in errors.

    Returns:
        the robot.

    Raises:
        ConfigError: its geometry or inertia cannot be used.
    """
    signs = axis_signs(spec)
    try:
        return platform_robot(
            np.asarray(spec.base_points) * signs,
            np.asarray(spec.platform_points) * signs,
            mass=spec.mass,
            inertia=np.asarray(spec.inertia) * np.outer(signs, signs),
            centre_of_mass=np.asarray(spec.centre_of_mass or [0.0, 0.0, 0.0]) * signs,
            gravity=gravity_of(spec, keys),
            name=spec.name,
        )
    except InputError as error:
        raise ConfigError(file, spec.typed(error)) from error


def fault_at_rest(spec: RobotFile) -> str | None:
    """Why a robot cannot hang still in its reference orientation, if it cannot.

    Args:
        spec: the robot; a platform is tried as deep below the centroid of its spools as these are away from it.

    Returns:
        the reason; None if it hangs with every cable taut.
    """
    try:
        if spec.is_platform:
            robot = build_platform(spec, TrajectoryKeys(), spec.name)
            base = np.asarray(robot.base_points)
            reference_pose(robot, float(np.linalg.norm(base - base.mean(0), axis=1).mean()))
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
    free_end = keys.family == "transition"
    broken = [] if key == "ideal" and for_bounds else boundary_errors(amplitude, free_end=free_end)
    if broken:
        conditions = "(1.27) and (1.28)" if free_end else "(2.49)"
        raise ConfigError(file, f"{at}amplitude = {given}: must meet {conditions}, but " + "; ".join(broken))
    return amplitude


def build_limits(spec: RobotFile, keys: LimitKeys, floor: float | None, file: object) -> Limits:
    """Limits of the file over those of the robot.

    Args:
        spec: the robot.
        keys: of the plan or sweep.
        floor: z of the floor in the file's axes, or None.
        file: named in errors.

    Returns:
        the limits.

    Raises:
        ConfigError: a smallest tension that is not below the largest, or a list of another length.
    """
    found = {}
    for name in LimitKeys.model_fields:
        value = getattr(keys, name) if getattr(keys, name) is not None else getattr(spec, name)
        if isinstance(value, list) and len(value) != len(spec.base_points):
            raise ConfigError(
                file, f"{name} = {shown(value)}: must be one number, or {len(spec.base_points)}: one a cable"
            )
        found[name] = None if value is None else leaf(np.broadcast_to(np.asarray(value, float), len(spec.base_points)))
    low, high = found["tension_min"], found["tension_max"]
    if low is not None and high is not None and not (np.asarray(low) < np.asarray(high)).all():
        raise ConfigError(file, f"tension_min = {np.asarray(low).tolist()}: must be below tension_max for every cable")
    depth = None if floor is None else leaf(floor * axis_signs(spec)[2])
    return Limits(floor=depth, **found)


def motion_kind(keys: TrajectoryKeys, *, from_rest: bool = False) -> Kind:
    """What the motions of a platform are.

    Args:
        keys: of the plan or sweep.
        from_rest: whether all start at rest in P0.

    Returns:
        the kind.
    """
    return Kind(keys.family == "hypocycloid", keys.beat == "beta_1", from_rest)


def orientations(spec: RobotFile, centre: np.ndarray, points: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Orientations of tilt and torsion in the cylindrical frame of their places, (3.98), in the kernels' axes.

    Args:
        spec: gives the file's axes, which the angles are of.
        centre: (3,) centroid of the spools, kernels' axes, m.
        points: (n, 3) kernels' axes, m.
        angles: (n, 3) phi, theta, sigma, rad.

    Returns:
        (n, 4) unit quaternions.
    """
    signs = axis_signs(spec)
    own = (points - centre) * signs
    towards = np.arctan2(own[:, 1], own[:, 0])
    return from_tilt_torsion(angles + towards[:, None] * np.array([1.0, 0.0, 0.0])) * np.append(1.0, signs)


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
