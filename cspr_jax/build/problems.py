"""Problems for the kernels, built from checked files: robot, limits, amplitude function."""

from cspr_jax.build.robots import build_limits, is_redundant_platform, kernel_robot
from cspr_jax.config.keys.limits import LimitTable
from cspr_jax.config.keys.trajectory import NamedAmplitude, PolynomialAmplitude, TrajectoryKeys
from cspr_jax.config.robot import RobotFile
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.motion import amplitudes
from cspr_jax.motion.amplitudes import Amplitude, boundary_errors
from cspr_jax.motion.given_limits import check_bounded, check_certain, check_motors
from cspr_jax.motion.platform_kind import PlatformMotionKind
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.statics.reference_pose import aligned
from cspr_jax.schema.families import FAMILIES


def build_amplitude(
    spec: TrajectoryKeys, file: object, *, epsilon: float | None = None, at: str = "", for_bounds: bool = False
) -> Amplitude:
    """The amplitude function, its boundary conditions checked."""
    key = spec.amplitude
    if isinstance(key, PolynomialAmplitude):
        amplitude, text = amplitudes.from_polynomial(key.polynomial), shown(list(key.polynomial))
    elif isinstance(key, NamedAmplitude):
        value = key.epsilon if isinstance(key.epsilon, float) else epsilon
        if value is None:
            raise ConfigError(file, f'{at}amplitude.epsilon = "best": must be a number in ]0, 0.5] (a plan can choose)')
        amplitude, text = amplitudes.named(key.name, value), shown(key.name)
    else:
        amplitude, text = amplitudes.named(key), shown(key)
    free_end = all(FAMILIES[name].free_end for name in spec.families)
    broken = [] if key == "ideal" and for_bounds else boundary_errors(amplitude, free_end=free_end)
    if broken:
        conditions = "(1.27) and (1.28)" if free_end else "(2.49)"
        raise ConfigError(file, f"{at}amplitude = {text}: must meet {conditions}, but " + "; ".join(broken))
    return amplitude


def build_problem(
    robot_file: RobotFile,
    spec: TrajectoryKeys,
    limits: LimitTable,
    file: object,
    *,
    epsilon: float | None = None,
    at: str = "",
    for_bounds: bool = False,
    any_cables: bool = False,
    pulleys: bool = False,
) -> Problem:
    """Robot, limits and amplitude function of a plan or sweep, as the kernels take them."""
    amplitude = build_amplitude(spec, file, epsilon=epsilon, at=at, for_bounds=for_bounds)
    limit_values = build_limits(robot_file, limits, file)
    pulleys = pulleys or all(FAMILIES[name].proof == "any" for name in spec.families)
    robot = kernel_robot(robot_file, spec, file, any_cables=any_cables, pulleys=pulleys)
    try:
        if not is_redundant_platform(robot):
            check_bounded(limit_values)
        check_certain(robot, limit_values, spec.families, in_pairs=robot_file.pairs is not None)
        check_motors(robot, limit_values)
    except InputError as error:
        raise ConfigError(file, str(error)) from error
    return Problem(aligned(robot)[0] if isinstance(robot, PlatformRobot) else robot, limit_values, amplitude)


def motion_kind(spec: TrajectoryKeys, *, from_rest: bool = False) -> PlatformMotionKind:
    """Kind of the motions of a platform."""
    return PlatformMotionKind(variable=spec.family == "hypocycloid", plain=spec.beat == "beta_1", from_rest=from_rest)
