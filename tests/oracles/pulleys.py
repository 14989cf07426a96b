"""Cables behind swivelling pulleys: the angle of the wrapped arc by a root finder."""

import numpy as np
from scipy.optimize import brentq


def length(base, axis, radius, target):
    """Length of a cable and the direction of its free part: the angle on the pulley by a root finder."""
    high = (target - base) @ axis
    side = target - base - high * axis
    side = side / np.linalg.norm(side)

    def at(angle):
        sine, cosine = np.sin(angle)[..., None], np.cos(angle)[..., None]
        return base + radius * (1.0 - cosine) * side + radius * sine * axis, sine * side + cosine * axis

    def miss(angle):  # of the target from the tangent, outwards
        point, _ = at(angle)
        normal = np.sin(angle)[..., None] * axis - np.cos(angle)[..., None] * side
        return np.sum((target - point) * normal, axis=-1)

    grid = np.linspace(0.0, 2.0 * np.pi, 721)
    missed = miss(grid)
    found = []
    for i in np.flatnonzero(missed[:-1] * missed[1:] <= 0.0):
        angle = brentq(miss, grid[i], grid[i + 1], xtol=1e-14)
        point, along = at(angle)
        if (target - point) @ along > 0.0:
            found.append((radius * angle + np.linalg.norm(target - point), along, point))
    return min(found, key=lambda one: one[0])
