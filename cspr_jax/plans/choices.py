"""Choices that a plan leaves open: z0, by a rule or from an inclination, and the epsilon of its amplitude function."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from cspr_jax.build.problems import build_amplitude
from cspr_jax.config.hints import plan_hints
from cspr_jax.config.near_rest import almost_at_rest
from cspr_jax.config.plan import DepthRule
from cspr_jax.errors import ConfigError, shown
from cspr_jax.families.swings import depths
from cspr_jax.families.swings.transitions.envelope_oscillations import best_inclination
from cspr_jax.families.swings.transitions.transition import depth_for, transition, weights
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.plans.sequence import PlanLegs
from cspr_jax.robots.model.point_mass import AT_P0, LARGEST_LENGTH, rest_point, spool_radius
from cspr_jax.robots.model.robot import Robot
from cspr_jax.runtime.stages import within
from cspr_jax.schema.families import FAMILIES

# A conservative z0 lies above its bound by this relative distance.
ABOVE_BOUND = 1e-6
EPSILONS = np.linspace(0.02, 0.5, 49)
DEPTHS = 200


def chosen_depth(problem: Any, sequence: PlanLegs) -> float:
    """The z0 of the plan, as given or chosen."""
    waypoints = sequence.waypoints
    plan_file, path, targets = waypoints.plan_file, waypoints.path, waypoints.targets
    if plan_file.z0 is None and not _needs_depth(waypoints):
        return float("nan")
    _check_depth_keys(waypoints)
    if isinstance(plan_file.z0, float):
        if plan_file.z0 > LARGEST_LENGTH:
            raise ConfigError(path, f"z0 = {shown(plan_file.z0)}: must be at most 1e6 m")
        _check_rest(problem.robot, waypoints, plan_file.z0)
        return plan_file.z0
    for i, pose in enumerate(plan_file.pose):
        if pose.rest and pose.position is not None:
            raise ConfigError(path, f"pose[{i}].position = {shown(pose.position)}: must be absent where z0 is chosen")
    if not len(targets):
        raise ConfigError(path, "z0 = { choose = ... }: must be a number where every pose is at rest")
    if not isinstance(plan_file.z0, DepthRule):
        return _depth_of_inclination(problem, waypoints)
    if plan_file.z0.choose == "mean":
        z0 = depths.mean_depth(problem.robot, targets)
    elif plan_file.z0.choose == "conservative":
        z0 = depths.conservative_depth(problem.robot, targets) * (1.0 + ABOVE_BOUND)
    else:
        with within("fastest z0"):
            z0 = _fastest_depth(problem, sequence)
    if not 0.0 < z0 <= LARGEST_LENGTH:
        hint = "".join(f" ({line})" for line in plan_hints(plan_file, waypoints.robot_file))
        why = f"since no z0 in ]0, 1e6] m follows from the poses{hint}"
        raise ConfigError(path, f'z0.choose = "{plan_file.z0.choose}": must be a number here, {why}')
    return z0


def _needs_depth(waypoints: Waypoints) -> bool:
    # Motions whose rests need not be at P0 need no depth of P0.
    plan_file = waypoints.plan_file
    anywhere = all(FAMILIES[name].rests_anywhere for name in plan_file.families)
    return (
        not anywhere
        or plan_file.inclination is not None
        or any(pose.position is None and pose.rest for pose in plan_file.pose)
    )


def _check_depth_keys(waypoints: Waypoints) -> None:
    plan_file, path = waypoints.plan_file, waypoints.path
    if plan_file.z0 is None and plan_file.inclination is None:
        other = ", or inclination" if set(plan_file.families) == {"transition"} else ""
        raise ConfigError(
            path, f'z0 is missing: depth of P0, m, or {{ choose = "mean" | "conservative" | "fastest" }}{other}'
        )
    if plan_file.z0 is not None and plan_file.inclination is not None:
        raise ConfigError(path, "z0, inclination: must be one of them")


def _check_rest(robot: Robot, waypoints: Waypoints, z0: float) -> None:
    at_rest, near = rest_point(np.asarray(z0)), AT_P0 * float(spool_radius(robot))
    for i, pose in enumerate(waypoints.poses):
        if not pose.rest or pose.position is None or _rests_anywhere(waypoints, i):
            continue
        if np.linalg.norm(waypoints.frame.inward(pose.position) - at_rest) > near:
            position = [float(f"{value:.12g}") for value in waypoints.frame.outward(at_rest)]
            raise ConfigError(
                waypoints.path,
                f"pose[{i}].position = {shown(pose.position)}: must be P0 = {position} at rest, or absent",
            )


def nearly_resting(waypoints: Waypoints, z0: float) -> list[str]:
    """Hints about poses that differ from P0 only in their last digits."""
    lines = [
        almost_at_rest(f"{waypoints.name(i)}.position", pose.position, z0, waypoints.robot_file)
        for i, pose in enumerate(waypoints.poses)
        if not pose.rest and pose.position is not None and not _rests_anywhere(waypoints, i)
    ]
    return [f"hint: {line}" for line in lines if line]


def _rests_anywhere(waypoints: Waypoints, i: int) -> bool:
    segments = range(max(i - 1, 0), min(i + 1, len(waypoints)))
    return all(FAMILIES[waypoints.plan_file.family_of(segment)].rests_anywhere for segment in segments)


def _depth_of_inclination(problem: Problem, waypoints: Waypoints) -> float:
    targets, path, inclination = waypoints.targets, waypoints.path, waypoints.plan_file.inclination
    if inclination == "best":
        if (targets != targets[0]).any():
            raise ConfigError(path, 'inclination = "best": must be a number in a plan with more than one target')
        v = _best_inclination(problem, waypoints)
    else:
        v = float(inclination or 0.0)
    levels = [float(depth_for(problem.robot, jnp.asarray(target), jnp.asarray(v))) for target in targets]
    if max(levels) - min(levels) > AT_P0 * float(spool_radius(problem.robot)):
        raise ConfigError(
            path, f"inclination = {v:g}: must be replaced by z0, since the targets lie at different depths"
        )
    if not levels[0] > 0.0:
        hint = "".join(f" ({line})" for line in plan_hints(waypoints.plan_file, waypoints.robot_file))
        why = f"since the targets are not below the spool plane{hint}"
        raise ConfigError(path, f"inclination: must be replaced by z0, {why}")
    return levels[0]


def _best_inclination(problem: Problem, waypoints: Waypoints) -> float:
    target = waypoints.targets[0]
    if problem.robot.n_cables > problem.robot.dof:
        from cspr_jax.families.swings.transitions.oscillations import best_inclinations

        return float(best_inclinations(problem, target[None], max_arcs=waypoints.max_arcs)[0])
    # The weights do not depend on the depth of P0, so any depth does.
    one = transition(problem.robot, problem.amplitude, jnp.asarray(target), jnp.asarray(1.0))
    return float(best_inclination(problem.amplitude, weights(one))[0])


def _fastest_depth(problem: Problem, sequence: PlanLegs) -> float:
    # While the arcs stay the same, the duration grows with the root of z0: search coarsely, then finely near the best.
    minimum = max(depths.least_depth(problem.robot, sequence.waypoints.targets), 1e-3)
    safe = depths.conservative_depth(problem.robot, sequence.waypoints.targets)
    trial = np.linspace(0.5 * minimum, max(1.5 * minimum, safe if np.isfinite(safe) else 0.0), DEPTHS)
    for _ in range(2):
        table = sequence.table(problem, trial)
        cost = np.where(table["feasible"], table["duration"], np.inf).sum(1)
        best = int(np.argmin(cost))
        if not np.isfinite(cost[best]):
            worst = np.nan_to_num(table["margin"], nan=-np.inf).min(1)
            best = int(np.argmax(worst))
        chosen = float(trial[best])
        trial = np.linspace(trial[max(best - 1, 0)], chosen, DEPTHS)
    return chosen


def best_amplitude(problem: Any, sequence: PlanLegs, z0: float) -> tuple[Amplitude, float]:
    """The amplitude function with the epsilon of the shortest plan, and z0; among equals, that of largest margin."""
    ranked: list[tuple[float, float, int, Amplitude, float]] = []
    for epsilon in EPSILONS:
        amplitude = build_amplitude(sequence.waypoints.plan_file, sequence.waypoints.path, epsilon=float(epsilon))
        trial = problem._replace(amplitude=amplitude)
        depth = chosen_depth(trial, sequence) if sequence.waypoints.plan_file.inclination == "best" else z0
        with within(f"epsilon {epsilon:.2f} of {EPSILONS[-1]:.2f}"):
            table = sequence.table(trial, np.array([depth]))
        cost = np.where(table["feasible"], table["duration"], np.inf).sum()
        ranked.append((round(float(cost), 9), -float(table["margin"].min()), len(ranked), amplitude, depth))
    return min(ranked)[-2:]
