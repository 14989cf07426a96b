"""The table of limits: which verdict each one breaks, and how many slacks it has."""

from cspr_jax.robots.limits import Limits
from cspr_jax.schema.verdicts import Verdict

FLAGS = {
    "tension_min": Verdict.SLACK_CABLE,
    "tension_max": Verdict.OVER_TENSION,
    "floor": Verdict.BELOW_FLOOR,
    "cable_length_max": Verdict.CABLE_TOO_LONG,
    "cable_speed_max": Verdict.CABLE_TOO_FAST,
    "cable_acceleration_max": Verdict.CABLE_OVER_ACCELERATION,
}


def count(name: str, n_cables: int) -> int:
    """How many smooth functions the slack of a limit is the smallest of.

    Args:
        name: of the limit.
        n_cables: of the robot.

    Returns:
        one of the height, one a cable, or two a cable for an absolute value.
    """
    return {"floor": 1, "cable_acceleration_max": 2 * n_cables}.get(name, n_cables)


def given(limits: Limits) -> tuple[str, ...]:
    """Names of the limits that are given, in the order of their slacks.

    Args:
        limits: the limits.

    Returns:
        the names.
    """
    return tuple(name for name in FLAGS if getattr(limits, name) is not None)
