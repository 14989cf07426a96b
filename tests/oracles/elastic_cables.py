"""Elastic cables by the textbook, with long doubles: potential energy, and its second derivatives by differences.

A body hangs on linear springs of fixed unstretched lengths; its pose is a displacement and a rotation vector about the
point that does not move with the rotation.  z down, SI units; nothing of the package is used.
"""

from dataclasses import dataclass, field

import numpy as np

LONG = np.longdouble
# Weights of the second difference of fourth order, and of the first one, which is squared for mixed derivatives.
STEP = LONG("1e-3")
FIRST = {-2: LONG(1) / 12, -1: -LONG(2) / 3, 1: LONG(2) / 3, 2: -LONG(1) / 12}


def rotated(vector, points):
    """Points after a rotation by a vector, by Rodrigues' formula."""
    vector, points = np.asarray(vector, LONG), np.asarray(points, LONG)
    square = vector @ vector
    angle = np.sqrt(square)
    if angle < LONG("1e-2"):
        one = 1 - square / 6 + square**2 / 120 - square**3 / 5040
        two = LONG("0.5") - square / 24 + square**2 / 720 - square**3 / 40320
    else:
        one, two = np.sin(angle) / angle, (1 - np.cos(angle)) / square
    once = np.cross(vector, points)
    return points + one * once + two * np.cross(vector, once)


def straight(entry, target):
    """Length of a cable from a point."""
    return np.sqrt(((target - entry) ** 2).sum())


def over_pulley(entry, target, axis, radius):
    """Length of a cable over a pulley, with the arc from its entry: the tangent from the target to a circle."""
    high = (target - entry) @ axis
    wide = np.sqrt((((target - entry) - high * axis) ** 2).sum()) - radius  # from the centre of the wheel
    far = np.sqrt(wide**2 + high**2)
    free = np.sqrt(far**2 - radius**2)
    # The entry is at the angle pi, seen from the centre; the cable winds over the top towards the target.
    seen = np.arctan2(high, wide)
    seen = seen if seen <= np.pi else seen - 2 * np.pi
    return radius * (LONG(np.pi) - seen - np.arccos(radius / far)) + free


@dataclass
class Hanging:
    """base: (n, 3); points: (n, 3) from the mass centre (or joint) in fixed axes; stiffness, tensions: (n,)."""

    base: np.ndarray
    points: np.ndarray
    stiffness: np.ndarray
    tensions: np.ndarray
    mass: float
    gravity: float
    position: np.ndarray
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))
    radius: np.ndarray | None = None
    axes: np.ndarray | None = None

    def lengths(self, twist):
        """Lengths after a displacement and a rotation (6,)."""
        twist = np.asarray(twist, LONG)
        ends = np.asarray(self.position, LONG) + twist[:3] + rotated(twist[3:], self.points)
        base = np.asarray(self.base, LONG)
        if self.radius is None:
            return np.array([straight(a, b) for a, b in zip(base, ends, strict=True)])
        axes, radius = np.asarray(self.axes, LONG), np.asarray(self.radius, LONG)
        return np.array([over_pulley(*row) for row in zip(base, ends, axes, radius, strict=True)])

    def unstretched(self):
        """Unstretched lengths that give the tensions in the pose itself."""
        return self.lengths(np.zeros(6)) / (1 + np.asarray(self.tensions, LONG) / self.stiffness)

    def energy(self, twist, unstretched):
        """Potential energy of springs and weight."""
        strain = (self.lengths(twist) - unstretched) ** 2 / (2 * unstretched)
        lowered = np.asarray(twist, LONG)[2] + rotated(np.asarray(twist, LONG)[3:], self.centre)[2]
        return (self.stiffness * strain).sum() - self.mass * self.gravity * lowered

    def stiffness_matrix(self, directions):
        """Second derivatives of the energy along directions (k, 6)."""
        unstretched, count = self.unstretched(), len(directions)
        directions = np.asarray(directions, LONG)
        matrix = np.zeros((count, count), LONG)
        for i in range(count):
            for j in range(i, count):
                for a, weight in FIRST.items():
                    for b, other in FIRST.items():
                        twist = STEP * (a * directions[i] + b * directions[j])
                        matrix[i, j] += weight * other * self.energy(twist, unstretched)
                matrix[j, i] = matrix[i, j]
        return (matrix / STEP**2).astype(float)
