"""Pairs of poses at zero velocity: the seven of Table 2.1, and random ones of ten robots, the same for a seed.

Table 2.1: Dion-Gauvin's thesis, section 2.9; a = 0.26 m, m = 0.198 kg. The limits are what its hypocycloids need.
"""

import dataclasses
import math

import numpy as np

from . import any_motion_cases, free_motions, least_time_cases, least_time_forms, path_rows

KINDS = least_time_cases.KINDS
PROTOTYPE = {
    **least_time_forms.ring_robot(3, 0.26, 0.198),
    "base_points": any_motion_cases.ring(3, 0.26, -math.pi / 6.0),
}
LIMITS = {"tension_min": np.zeros(3), "tension_max": np.full(3, 1.6017), "cable_speed_max": np.full(3, 3.85)}
# From rest to the seven poses and to rest: segments 0 to 7.
REST = [0.0, 0.0, 1.7]
TARGETS = [[0.7, 0.7, 3.0], [-1.1, -1.1, 0.5], [-1.1, -0.9, 1.5], [0.8, 0.5, 1.5], [-0.6, 0.1, 1.9], [0.1, -0.6, 1.8]]
STATIONS = np.array([REST, *TARGETS, [0.0, -1.1, 1.7], REST])


@dataclasses.dataclass(frozen=True)
class Case:
    """A robot, its limits, and the poses between which it moves, in the axes of its base points."""

    robot: dict
    limits: dict
    start: free_motions.Pose
    end: free_motions.Pose


def segment(number):
    """Segment of Table 2.1 to its pose of that number, the first one from rest, 0; or from the last one to rest, 7."""
    return Case(PROTOTYPE, LIMITS, *(free_motions.Pose(p) for p in STATIONS[number : number + 2]))


def random_pose(rng, robot, reference, ranges, size, outside):
    """A pose; outside: beyond the spools, of a robot that is not planar to any side."""
    position = reference + rng.uniform(0.3, 0.8) * ranges * rng.uniform(-1.0, 1.0, 3)
    turn = np.append(1.0, np.zeros(3))
    if outside:
        away = rng.normal(size=3) * (ranges > 0.0) * (1.0, 1.0, 0.0)
        position += (
            size * rng.uniform(0.3, 1.1 if robot["platform_points"] is None else 0.6) * away / np.linalg.norm(away)
        )
    if robot["platform_points"] is not None:
        turn[1:] = least_time_cases.TILT * rng.uniform(-1.0, 1.0, 3)
        if robot["pattern"] == "1R2T":
            turn[[1, 3]] = 0.0
    return free_motions.Pose(position, turn / np.linalg.norm(turn))


def case(kind, seed, outside=False):
    """The case of a kind and a seed; outside: one of the poses, or both, are beyond the spools."""
    rng = np.random.default_rng([seed, KINDS.index(kind), int(outside), 49])
    robot, reference, ranges, size = any_motion_cases.random_robot(rng, kind)
    which = [outside and (k == 0 or rng.random() < 0.5) for k in range(2)]
    start, end = (random_pose(rng, robot, reference, ranges, size, is_out) for is_out in rng.permutation(which))
    weight, n, g = robot["mass"] * robot["gravity"], len(robot["base_points"]), robot["gravity"]
    rest = path_rows.balance(robot, path_rows.line(reference, reference * (1.0 + 1e-3)).at([0.0]))
    low = rng.choice([0.0, 0.02])
    need = least_time_cases.largest_tension(rest.matrix[0], rest.c[0] / weight, low)
    high = rng.uniform(1.3, 3.0) * (need if np.isfinite(need) else 1.0)
    limits = {"tension_min": np.full(n, weight * low), "tension_max": weight * high * (1.0 + 0.02 * rng.random(n))}
    depth = np.linalg.norm(reference - np.mean(robot["base_points"], axis=0))
    units = {"speed_max": math.sqrt(g * depth), "acceleration_max": 2.0 * g}
    for name in free_motions.BOUNDED:
        fraction, is_drawn = rng.uniform(0.4, 1.0), rng.random() < 0.3
        if is_drawn:
            limits[name] = float(fraction * units[name.removeprefix("cable_")])
    return Case(robot, limits, start, end)
