"""Points of a plan that straight lines join."""

import itertools

import numpy as np

from cspr_jax.motion.leg import Leg
from cspr_jax.verification.proved_answers import proved_answers
from straight_lines.motion import Line


class Lines(Leg):
    """Consecutive points, joined by straight lines."""

    def join(self, problem, z0):
        """Return answers and motions; samples refute, and prove nothing."""
        points = self.waypoints.points(z0)
        motions = [Line(start, end, np.asarray(z0)) for start, end in itertools.pairwise(points)]
        return proved_answers(problem, motions), motions
