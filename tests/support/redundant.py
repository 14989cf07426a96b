"""Point masses on more cables than degrees of freedom, checked at instants by the oracle of any motion."""

import numpy as np
from oracles import any_motion
from oracles.sampled_motion import State

GRAVITY = 9.81
# Robots of the catalogue, retyped: spools in m, z up, of a mass of 10 kg.
RECTANGLE = [[0.0, 0.0, 30.0], [45.0, 0.0, 30.0], [45.0, 30.0, 30.0], [0.0, 30.0, 30.0]]
PLANAR_THREE = [[0.0, 0.0, 30.0], [15.0, 0.0, 30.0], [45.0, 0.0, 30.0]]
MASS = 10.0


def largest_distances(base_points, positions, accelerations, low=0.0, high=np.inf, mass=MASS):
    """How far all tensions can be from their limits at k instants, by HiGHS: (k,) N; accelerations (k, 3), z up."""
    base, positions = np.asarray(base_points, float), np.asarray(positions, float)
    is_planar = not base[:, 1].any()
    robot = {"base_points": base, "platform_points": None, "mass": mass, "gravity": GRAVITY, "z_axis": "up"}
    robot["pattern"] = "2T" if is_planar else "3T"
    count, still = len(positions), np.zeros_like(positions)
    state = State(positions, still, np.asarray(accelerations, float), np.tile(np.eye(3), (count, 1, 1)), still, still)
    matrix, wrench = any_motion.balance(robot, state, any_motion.cables(robot, state))
    limits = (np.broadcast_to(np.asarray(side, float), len(base)) for side in (low, high))
    return any_motion.Centring(*limits).largest(matrix, wrench)


def least_distances(base_points, planned, samples, **limits):
    """The least of them over the rows of each segment of a plan, N."""
    table = planned.rows()
    each = largest_distances(base_points, table["position"], table["acceleration"], **limits)
    return [float(each[i : i + samples].min()) for i in range(0, len(each), samples)]
