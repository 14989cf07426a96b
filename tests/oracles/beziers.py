"""Bezier segments in plain NumPy, by the control points and the path variable of (9) to (14), sample by sample.

Nothing of the package is used: forces come from solving the balance of each instant.
"""

import numpy as np

DOWN = np.array([0.0, 0.0, 1.0])


def states(points, time, samples):
    """Positions, velocities and accelerations, (samples + 1, 3) each, of start, middle and end in s."""
    start, middle, end = np.asarray(points, float)
    t = np.linspace(0.0, time, samples + 1)[:, None]
    s = 0.5 - 0.5 * np.cos(np.pi * t / time)
    s1 = np.pi / (2.0 * time) * np.sin(np.pi * t / time)
    s2 = np.pi**2 / (2.0 * time**2) * np.cos(np.pi * t / time)
    position = (1.0 - s) ** 2 * start + 2.0 * s * (1.0 - s) * middle + s**2 * end
    slope = 2.0 * ((s - 1.0) * start + (1.0 - 2.0 * s) * middle + s * end)
    second_derivative = 2.0 * (start - 2.0 * middle + end)
    return position, slope * s1, second_derivative * s1**2 + slope * s2


def tensions(spools, mass, gravity, position, acceleration):
    """Tensions of three cables, or of two in the plane y = 0, z down: (n, n_cables) N."""
    rays = np.asarray(spools, float)[None] - position[:, None]
    units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    wanted = mass * (acceleration - gravity * DOWN)
    axes = [0, 2] if len(spools) == 2 else [0, 1, 2]
    return np.linalg.solve(np.swapaxes(units, 1, 2)[:, axes], wanted[:, axes, None])[..., 0]


def cable_states(spools, position, velocity, acceleration):
    """Lengths of the cables with both derivatives, (n, n_cables) each."""
    rays = position[:, None] - np.asarray(spools, float)[None]
    length = np.linalg.norm(rays, axis=2)
    rate = (rays * velocity[:, None]).sum(2) / length
    second_derivative = ((velocity**2).sum(1)[:, None] + (rays * acceleration[:, None]).sum(2) - rate**2) / length
    return length, rate, second_derivative


def depth(spools, points):
    """Depths below the plane of three spools along the vertical, of points (..., 3), z down; m."""
    a = np.asarray(spools, float)
    normal = np.cross(a[1] - a[0], a[2] - a[0])
    return (np.asarray(points) - a[0]) @ (normal / normal[2])


def least_slack(spools, gravity, points, time, samples):
    """Smallest product of a tension per length and the depth below the spools, and that depth, along a segment.

    Three spools, z down. The product does not grow without end where the robot comes to the plane of its spools.
    """
    a = np.asarray(spools, float)
    position, _, acceleration = states(points, time, samples)
    rays = a[None] - position[:, None]
    # Cramer's rule, over the determinant at depth 1.
    unit = abs(np.linalg.det(a - (a.mean(0) + DOWN)))
    sign = np.sign(np.linalg.det(a - (a.mean(0) + DOWN)))
    products = []
    for k in range(3):
        matrix = np.swapaxes(rays, 1, 2).copy()
        matrix[:, :, k] = acceleration - gravity * DOWN
        products.append(sign * np.linalg.det(matrix) / unit)
    return np.min(products), depth(a, position).min()


def printed_rule(spools, gravity, points, time):
    """Whether (22) and (25) as printed, with their "max", accept a segment below level spools; z down."""
    a = np.asarray(spools, float)
    position, _, acceleration = states(points, time, 3)
    c = np.cos(np.pi * np.arange(4) / 3.0)
    accepted = True
    for k in range(3):
        rays = np.swapaxes(a[None] - position[:, None], 1, 2).copy()
        sign = np.sign(np.linalg.det(a - (a.mean(0) + DOWN)))
        rays[:, :, k] = acceleration - gravity * DOWN
        cubic = np.polynomial.polynomial.Polynomial.fit(c, sign * np.linalg.det(rays), 3).convert(domain=[-1, 1])
        roots = cubic.deriv().roots()
        inner = roots.real[(np.abs(roots.imag) < 1e-12) & (np.abs(roots.real) <= 1.0)]
        accepted &= cubic(1.0) > 0.0 and cubic(-1.0) > 0.0 and (len(inner) == 0 or cubic(inner).max() > 0.0)
    return bool(accepted)
