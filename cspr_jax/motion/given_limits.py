"""Limits of a file or a caller, checked, in the kernels' axes."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from jax import Array

from cspr_jax.errors import InputError
from cspr_jax.errors.given_numbers import SMALLEST, numbers
from cspr_jax.motion.limits import without_motors
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.robots.model.limits import NO_LIMITS, Limits, Uncertainty
from cspr_jax.robots.model.parallel_pairs import ParallelPairs
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.robots.model.point_mass import PointMassRobot
from cspr_jax.robots.model.winch_numbers import LINE, LOAD
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.limits import LIMITS, UNCERTAINTIES, Limit

TORQUES = ("motor_torque_max", "motor_torque_rms_max")


def limits_of(
    robot: Any, limits: Mapping[str, Any], defaults: Mapping[str, Any], at: str, n_cables: int | None = None
) -> Limits:
    """Limits, with those of a robot where none are given."""
    n_cables, values = n_cables or len(robot.base_points), dict[str, Any]()
    for row in LIMITS:
        value = limits.get(row.name)
        value = defaults.get(row.name) if value is None else value
        if row.of_winch and value is not None:
            _check_winch(robot, row, value, at)
        values[row.name] = None if value is None else _limit(row, value, n_cables, at)
    low, high = values["tension_min"], values["tension_max"]
    if low is not None and high is not None and not (low < high).all():
        raise InputError(f"{at}tension_min", low.tolist(), "below tension_max for every cable")
    if values["floor"] is not None:
        values["floor"] = as_float64(frame_of(robot.base_points, robot.z_axis).depth(values["floor"]))
    values |= _narrowed(values, limits.get("tension_margin"), n_cables, at)
    uncertain = limits.get("uncertainty")
    uncertain = defaults.get("uncertainty") if uncertain is None else uncertain
    return Limits(**values, uncertainty=None if uncertain is None else _uncertainty(uncertain, f"{at}uncertainty."))


def _check_winch(robot: Any, row: Limit, value: Any, at: str) -> None:
    # Robots of kernels have `winches`, those of files `winch`, with the same numbers.
    winch = getattr(robot, "winches", None) or getattr(robot, "winch", None)
    if winch is None:
        raise InputError(f"{at}{row.name}", value, "absent: the robot has no winches ([winch] in its file)")
    if row.name == LOAD and getattr(winch, LINE, None) is None and getattr(winch, "stall_torque", None) is None:
        raise InputError(f"{at}{row.name}", value, f"absent: the robot's winches have no {LINE}")


def _narrowed(values: Mapping[str, Any], margin: float | None, n_cables: int, at: str) -> dict[str, Any]:
    # Tension limits, narrowed by a margin at both ends of their range.
    if margin is None:
        return {}
    low, high = values["tension_min"], values["tension_max"]
    low = np.full(n_cables, margin) if low is None else low + margin
    high = None if high is None else high - margin
    if high is not None and not (low < high).all():
        raise InputError(f"{at}tension_margin", margin, "less than half of the range of tensions of every cable")
    return {"tension_min": as_float64(low), "tension_max": None if high is None else as_float64(high)}


def _uncertainty(uncertainty: Any, at: str) -> Uncertainty:
    values = {}
    for row in UNCERTAINTIES:
        value = getattr(uncertainty, row.name, None)
        number = numbers(f"{at}{row.name}", value, row.allowed)
        if number.shape != () or not row.smallest <= number <= row.largest:
            raise InputError(f"{at}{row.name}", value, row.allowed)
        values[row.name] = as_float64(number)
    return Uncertainty(**values)


def check_bounded(limits: Limits) -> None:
    """Refuse infinite largest tensions."""
    high = limits.tension_max
    if high is not None and not np.isfinite(high).all():
        raise InputError(
            "tension_max",
            np.asarray(high).tolist(),
            "finite, or absent (only workspaces and platforms on more than six cables take infinite ones)",
        )


def check_of_motion(limits: Limits) -> None:
    """Refuse limits of the mass centre's speed and acceleration in functions that do not check them."""
    for row in LIMITS:
        value = getattr(limits, row.name)
        if row.of_mass_centre and value is not None:
            raise InputError(row.name, float(value), "absent where no motion is checked")


def check_no_motors(limits: Limits, at: str = "") -> None:
    """Refuse limits of winches where no proof takes them into account."""
    for row in LIMITS:
        value = getattr(limits, row.name)
        if row.of_winch and value is not None:
            why = "absent (what is asked for does not exist yet for limits of winches: plans, checks and some maps do"
            raise InputError(f"{at}{row.name}", _shown(value), f"{why}{_of_line(row.name, value)})")


def _shown(value: Any) -> Any:
    # One number where all cables have the same.
    values = np.unique(np.asarray(value)).tolist()
    return values if len(values) > 1 else values[0]


def _of_line(name: str, value: Any) -> str:
    # Users may not know a limit that the line of a motor sets.
    return f"; it follows from winch.{LINE}" if name == LOAD and (np.asarray(value) == 1.0).all() else ""


def check_no_means(
    limits: Limits, at: str = "", allowed: str = "absent: only plans, checks, and maps of arcs take it"
) -> None:
    """Refuse limits of full motions where single motions are parts of no plan."""
    if limits.motor_torque_rms_max is not None:
        raise InputError(f"{at}motor_torque_rms_max", _shown(limits.motor_torque_rms_max), allowed)


def _refuse_of_motion(robot: Any, limits: Limits, accelerates: bool, moves: bool) -> None:
    # Refuse limits of winches that depend on speeds or accelerations of motors, which poses at rest do not have.
    winches, reasons = robot.winches, dict[str, str]()
    if winches is None:
        return
    if accelerates and np.asarray(winches.motor_inertia).any():
        reasons |= dict.fromkeys((*TORQUES, LOAD, "motor_power_max"), "accelerations: motor_inertia takes torque")
    if moves and (np.asarray(winches.viscous_friction).any() or np.asarray(winches.motor_inertia).any()):
        reasons |= dict.fromkeys(TORQUES, "speeds: viscous_friction and motor_inertia take torque")
    if moves:
        reasons |= dict.fromkeys(("motor_power_max", LOAD), "speeds, on which it depends")
        reasons |= {"motor_speed_max": "speeds, on drums with layers"} if winches.layers is not None else {}
    for name, reason in reasons.items():
        value = getattr(limits, name)
        if value is not None:
            raise InputError(name, _shown(value), f"absent beside {reason}{_of_line(name, value)}")


def static_limits(robot: Any, limits: Limits, *, accelerates: bool = False, moves: bool = False) -> Limits:
    """Limits of poses at rest, where limits of torque, in the worse direction of friction, are limits of tensions."""
    _refuse_of_motion(robot, limits, accelerates, moves)
    largest = {"motor_torque_max": limits.motor_torque_max, "motor_torque_rms_max": limits.motor_torque_rms_max}
    if limits.motor_load_max is not None:
        largest["motor_load_max"] = limits.motor_load_max * robot.winches.stall_torque
    torques = {name: np.asarray(torque) for name, torque in largest.items() if torque is not None}
    high = np.full(robot.n_cables, np.inf) if limits.tension_max is None else np.asarray(limits.tension_max)
    low = np.zeros(robot.n_cables) if limits.tension_min is None else np.asarray(limits.tension_min)
    for name, torque in torques.items():
        if robot.winches.layers is not None:
            allowed = "absent at rest on drums with layers, whose torques depend on lengths"
            raise InputError(name, _shown(getattr(limits, name)), allowed + _of_line(name, getattr(limits, name)))
        winches = robot.winches
        arm = np.asarray(winches.drum_radius / (winches.gear_ratio * winches.efficiency))
        high = np.minimum(high, (torque - np.asarray(winches.friction)) / arm)
        if not (high > low).all():
            allowed = "enough for the friction of each winch and for its cable's smallest tension"
            raise InputError(name, _shown(getattr(limits, name)), allowed + _of_line(name, getattr(limits, name)))
    limits = without_motors(limits)
    return dataclasses.replace(limits, tension_max=as_float64(high)) if torques else limits


def check_motors(robot: PointMassRobot | PlatformRobot, limits: Limits) -> None:
    """Refuse limits of winches that cannot be proved."""
    names = [row.name for row in LIMITS if row.of_winch and getattr(limits, row.name) is not None]
    if names and limits.uncertainty is not None:
        raise InputError("uncertainty", None, f"absent beside {names[0]}, a limit of winches", problem="given")
    if limits.motor_torque_rms_max is not None and robot.n_cables > robot.dof:
        value = np.asarray(limits.motor_torque_rms_max).tolist()
        allowed = "absent on more cables than degrees of freedom, since a motion does not determine their torques"
        raise InputError("motor_torque_rms_max", value, allowed)


def check_certain(
    robot: PointMassRobot | PlatformRobot, limits: Limits, families: tuple[str, ...], *, in_pairs: bool = False
) -> None:
    """Refuse an uncertainty where no proof takes it into account."""
    uncertainty = limits.uncertainty
    if uncertainty is None:
        return
    names = [row.name for row in FAMILIES.values() if row.proof != "own"]
    if not families or not set(families) <= set(names):
        raise InputError(
            "uncertainty", None, f"must be absent but for the families {', '.join(names)}", problem="given"
        )
    is_redundant = robot.n_cables != robot.dof and any(FAMILIES[name].proof != "any" for name in families)
    if is_redundant or in_pairs or robot.pulleys is not None:
        allowed = "must be absent on redundant cables (but for splines), on pairs of cables, and with pulleys"
        raise InputError("uncertainty", None, allowed, problem="given")
    if not isinstance(robot, PlatformRobot) and float(uncertainty.mass_centre) > 0.0:
        raise InputError(
            "uncertainty.mass_centre", float(uncertainty.mass_centre), "absent: a point mass has no other one"
        )


def _limit(row: Limit, value: Any, n_cables: int, at: str) -> Array:
    allowed = row.allowed + f", or {n_cables}: one a cable" * row.per_cable
    values = numbers(f"{at}{row.name}", value, allowed)
    minimum = -np.inf if row.is_height else 0.0 if row.from_zero else np.nextafter(0.0, 1.0)
    shapes = [(), (n_cables,)] if row.per_cable else [()]
    is_number = np.isfinite(values) | ((values == np.inf) & (row.name == "tension_max") & (values.ndim > 0))
    if values.shape not in shapes or not ((values >= minimum) & is_number).all():
        raise InputError(f"{at}{row.name}", value, allowed)
    if not row.is_height and ((values > 0.0) & (values < SMALLEST)).any():
        raise InputError(f"{at}{row.name}", value, f"{allowed}, at least {SMALLEST:g}")
    return as_float64(np.broadcast_to(values, (n_cables,) if row.per_cable else ()))


def pair_limits(limits: Limits, pairs: ParallelPairs) -> Limits:
    """Limits of the equivalent's three cables, from those of the pairs of six cables."""
    values: dict[str, Any] = {
        row.name: _on_winches(row, value, pairs)
        if row.of_winch
        else as_float64(pairs.bound(value, is_tension=row.quantity == "tension", is_least=row.sense == "least"))
        for row in LIMITS
        if row.per_cable and (value := getattr(limits, row.name)) is not None
    }
    low, high = values.get("tension_min"), values.get("tension_max")
    if low is not None and high is not None and not (low < high).all():
        pair = int(np.argmin(high - low))
        allowed = "must be below tension_max, each over the cable's share of it"
        first, second = (pairs.cables[pair] + 1).tolist()
        raise InputError(
            "tension_min", None, allowed, problem=f"{low[pair]:.6g} N of the pair of cables {first} and {second}"
        )
    return dataclasses.replace(limits, **values)


def _on_winches(row: Limit, value: Any, pairs: ParallelPairs) -> Array:
    # One winch drives a pair of cables, so that both have its limits.
    each = np.asarray(value)[pairs.cables]
    if (each[:, 0] != each[:, 1]).any():
        problem = "cables of a pair are on one winch, but their limits differ"
        raise InputError(row.name, None, "equal for both", problem=problem)
    return as_float64(each[:, 0])


def limits_over(
    robot: PointMassRobot | PlatformRobot,
    limits: Limits | None,
    *,
    any_tensions: bool = False,
    families: tuple[str, ...] = (),
    motors: bool = False,
) -> Limits:
    """Limits in the kernels' axes, with those of a robot where none are given; without `motors` those are refused."""
    merged = limits_of(robot, vars(limits or NO_LIMITS), vars(robot.limits), "limits.")
    if not any_tensions:
        check_bounded(merged)
    if not families:
        check_of_motion(merged)
    check_certain(robot, merged, families)
    (check_motors(robot, merged) if motors else check_no_motors(merged))
    return merged
