"""How tests ask the package for free motions: one function, which knows the package's names and axes."""

from math import comb

import numpy as np
from oracles.sampled_motion import State
from scipy.interpolate import PPoly

from cspr_jax.families.free.free_motion import free_motion
from cspr_jax.families.free.poses import FreePoses
from cspr_jax.families.free.problem import FreeSettings
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred
from support.least_time import robot_of

# Quick tests look at few intervals.
QUICK = FreeSettings(intervals=12, samples=3)


class PlacedMotion:
    """A motion as the verifier takes it, in the axes of the robot."""

    def __init__(self, motion, frame):
        self.motion, self.frame, self.times = motion, frame, (0.0, float(motion.knots[-1]))

    def state(self, times):
        """States at times (k,), s, by powers of the pieces."""
        curve = PPoly(*self._powers())
        position, velocity, acceleration = (curve(times, order) for order in range(3))
        count = len(times)
        turning = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), np.zeros((count, 3))
        rotated = self.frame.rotated
        return State(self.frame.outward(position), rotated(velocity), rotated(acceleration), *turning)

    def _powers(self):
        # Coefficients of the pieces, highest power first, from those of Bernstein.
        knots, table = np.asarray(self.motion.knots), np.asarray(self.motion.position)
        degree = table.shape[1] - 1
        rows = []
        for k in range(degree, -1, -1):
            signs = [(-1) ** (k - i) * comb(degree, k) * comb(k, i) for i in range(k + 1)]
            rows.append(np.einsum("i,mid->md", signs, table[:, : k + 1]) / np.diff(knots)[:, None] ** k)
        return np.array(rows), knots


def problem_of(robot, limits):
    """The problem of a robot of the reference, with its limits (a floor from the spools), and the frame of its axes."""
    prepared, frame = centred(robot_of(robot))
    values = {name: value if name == "uncertainty" else as_float64(value) for name, value in limits.items()}
    return Problem(prepared, Limits(**values), named("A1")), frame


def solve(robot, limits, positions, accelerations=None, settings=QUICK):
    """The free motion of a point mass through positions (k, 3), m, with accelerations (k, 3), m/s^2, NaN where free."""
    with double_precision():
        problem, frame = problem_of(robot, limits)
        places = np.asarray(frame.inward(np.asarray(positions, float)))
        free = np.full(places.shape, np.nan) if accelerations is None else frame.rotated(np.asarray(accelerations))
        return free_motion(
            problem, None, FreePoses(places, None, np.zeros(places.shape), free, float(places[:, 2].mean())), settings
        ), frame
