"""NumPy reference for the point mass on three cables (Dion-Gauvin, chapter 2): printed formulas, float64.

Axes: z points down and gravity is (0, 0, g).  Spools are the rows of a (3, 3) array, in any order, plane and origin.
c0 is their mean, P0 = c0 + (0, 0, z0) the rest point and lambda = g / z0 (2.26).  Equation numbers are the thesis's.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Vec = ArrayLike
Triple = tuple[Array, Array, Array]
Amplitude = Callable[[Vec], Triple]
Motion = tuple[float, Array, Array, Array]
Frame = tuple[Array, Array, float, float, float]

COLLINEAR = 1e-12  # sin(psi) below this: the three points lie on one line
REST = 1e-12  # a radius below this times the coordinates' size: the end is P0 itself


def _array(values: Vec) -> Array:
    return np.asarray(values, dtype=np.float64)


def _rows(values: Vec) -> Array:
    return np.atleast_2d(_array(values))


def _unit(vector: Array) -> Array:
    return _array(vector / np.linalg.norm(vector))


def quintic(tau: Vec) -> Triple:
    """Amplitude (2.50) and its first two derivatives."""
    s = _array(tau)
    return 6 * s**5 - 15 * s**4 + 10 * s**3, 30 * s**4 - 60 * s**3 + 30 * s**2, 120 * s**3 - 180 * s**2 + 60 * s


def effective(tau: Vec, epsilon: float) -> Triple:
    """Amplitude A_eff (1.110), 0 < epsilon <= 1/2, and its first two derivatives."""
    s = _array(tau)
    scale = epsilon**3 * (1 - epsilon)

    def start(x: Array) -> Triple:
        value, slope = x**3 * (2 * epsilon - x) / (2 * scale), x**2 * (3 * epsilon - 2 * x) / scale
        return value, slope, 6 * x * (epsilon - x) / scale

    first, last = start(s), start(1 - s)
    middle = (2 * s - epsilon) / (2 * (1 - epsilon)), np.full_like(s, 1 / (1 - epsilon)), np.zeros_like(s)
    mirrored = 1 - last[0], last[1], -last[2]
    before, after = s <= epsilon, s >= 1 - epsilon
    parts = zip(first, middle, mirrored, strict=True)
    value, slope, second_derivative = (np.where(before, a, np.where(after, c, b)) for a, b, c in parts)
    return value, slope, second_derivative


def frame(p1: Vec, p2: Vec, p0: Vec, arcs: int, *, normal: Vec = (0.0, 0.0, 1.0)) -> Frame:
    """Plane of the trajectory (2.29-2.30), psi (2.36) by atan2, radii (2.39), with the degenerate cases.

    At a rest end psi is 0 (even arcs) or pi (odd arcs); both ends at rest: the line is taken along x.
    Where the points leave the plane free, q_h2 is along normal x q_h1, or along x when that product vanishes
    (along the part of x orthogonal to q_h1 when the normal is tilted).
    """
    a, b, origin, up = _array(p1), _array(p2), _array(p0), _array(normal)
    d1, d2 = a - origin, b - origin
    r1, r2 = float(np.linalg.norm(d1)), float(np.linalg.norm(d2))
    small = REST * max(float(np.abs([a, b, origin]).max()), r1, r2)
    r1, r2 = (0.0 if r1 <= small else r1), (0.0 if r2 <= small else r2)
    if r1 == 0 or r2 == 0:
        psi = 0.0 if arcs % 2 == 0 else math.pi
        q1 = d1 / r1 if r1 > 0 else (-1) ** arcs * d2 / r2 if r2 > 0 else np.array([1.0, 0.0, 0.0])
        return q1, _free_direction(q1, up), psi, r1, r2
    q1 = d1 / r1
    across = d2 - q1 * (q1 @ d2)
    across = across - q1 * (q1 @ across)  # once more: the first pass cancels when the points are nearly in line
    sine, cosine = float(np.linalg.norm(across)) / r2, float(q1 @ d2) / r2
    if sine < COLLINEAR:
        return q1, _free_direction(q1, up), (0.0 if cosine > 0 else math.pi), r1, r2
    return q1, _unit(across), math.atan2(sine, cosine), r1, r2


def _free_direction(q1: Array, normal: Array) -> Array:
    """Second axis of a plane that the three points do not determine."""
    across = np.cross(normal, q1)
    if float(np.linalg.norm(across)) > COLLINEAR * float(np.linalg.norm(normal)):
        return _unit(across)
    return _unit(np.array([1.0, 0.0, 0.0]) - q1 * q1[0])


def plotting_range(psi: float, arcs: int) -> tuple[float, float]:
    """theta_h (2.34) and n_h (2.35), infinite when theta_h = 0."""
    theta = psi + (-1) ** (arcs - 1) * 2 * math.pi * math.ceil((arcs - 1) / 2)
    return theta, (2 * math.pi * arcs / abs(theta) if theta != 0 else math.inf)


def hypocycloid(theta: float, cusps: float, tau: Vec) -> Triple:
    """Curve (2.32-2.33) and its two derivatives with respect to tau, each (n, 2)."""
    s = np.atleast_1d(_array(tau))
    k, n = cusps - 1, cusps
    slow, fast = theta * s, k * theta * s
    u, v = (k * np.cos(slow) + np.cos(fast)) / n, (k * np.sin(slow) - np.sin(fast)) / n
    du = -theta * k * (np.sin(slow) + np.sin(fast)) / n
    dv = theta * k * (np.cos(slow) - np.cos(fast)) / n
    ddu = -(theta**2) * k * (np.cos(slow) + k * np.cos(fast)) / n
    ddv = -(theta**2) * k * (np.sin(slow) - k * np.sin(fast)) / n
    return np.stack([u, v], axis=-1), np.stack([du, dv], axis=-1), np.stack([ddu, ddv], axis=-1)


def motion(
    p1: Vec,
    p2: Vec,
    p0: Vec,
    g: float,
    arcs: int,
    tau: Vec,
    amplitude: Amplitude = quintic,
    *,
    z0: float | None = None,
    normal: Vec = (0.0, 0.0, 1.0),
) -> Motion:
    """Duration (2.47) and position, velocity, acceleration (2.38, 2.42-2.43 through 2.31, 2.48) at tau.

    z0 is the height of P0 below c0; None takes p0's z, which is right when the origin is c0.
    Without a positive duration (one arc, psi = 0) T is 0 and the three arrays are NaN.
    """
    origin = _array(p0)
    rate = g / (float(origin[2]) if z0 is None else z0)
    q1, q2, psi, r1, r2 = frame(p1, p2, origin, arcs, normal=normal)
    theta, cusps = plotting_range(psi, arcs)
    s = np.atleast_1d(_array(tau))
    if not math.isfinite(cusps):
        blank = np.full((s.size, 3), np.nan)
        return 0.0, blank, blank.copy(), blank.copy()
    duration = math.sqrt(theta**2 * (cusps - 1) / rate)
    w, dw, ddw = hypocycloid(theta, cusps, s)
    shape, dshape, ddshape = (np.atleast_1d(values)[:, None] for values in amplitude(s))
    r, dr, ddr = (r2 - r1) * shape + r1, (r2 - r1) * dshape, (r2 - r1) * ddshape
    plane = np.stack([q1, q2])
    position = (r * w) @ plane + origin
    velocity = (dr * w + r * dw) @ plane / duration
    acceleration = (ddr * w + 2 * dr * dw + r * ddw) @ plane / duration**2
    return duration, position, velocity, acceleration


def _net(acceleration: Vec, g: float) -> Array:
    return _array(_rows(acceleration) - np.array([0.0, 0.0, g]))


def pseudotensions(base_points: Vec, position: Vec, acceleration: Vec, g: float) -> Array:
    """Pseudotensions as printed (2.12-2.14)."""
    (a1, a2, a3), p, net = _array(base_points), _rows(position), _net(acceleration, g)
    first = np.sum((np.cross(p, a2 - a3) + np.cross(a2, a3)) * net, axis=1)
    second = np.sum((np.cross(p, a3 - a1) + np.cross(a3, a1)) * net, axis=1)
    third = np.sum((np.cross(p, a1 - a2) + np.cross(a1, a2)) * net, axis=1)
    return np.stack([first, second, third], axis=1)


def normalised_pseudotensions(base_points: Vec, p0: Vec, position: Vec, acceleration: Vec, g: float) -> Array:
    """(2.12-2.14) divided by their values at rest at P0, from the spools' centre (less rounding)."""
    base = _array(base_points)
    centre = base.mean(axis=0)
    rest = pseudotensions(base - centre, _array(p0) - centre, np.zeros(3), g)
    return pseudotensions(base - centre, _rows(position) - centre, acceleration, g) / rest


def _to_spools(base_points: Vec, position: Vec) -> Array:
    """Vectors a_k - p (2.6) as (n, cable, axis)."""
    return _array(base_points)[None, :, :] - _rows(position)[:, None, :]


def force_ratios(base_points: Vec, position: Vec, acceleration: Vec, g: float) -> Array:
    """Force over length, mu = f / (m rho) (2.4) by a direct solve of (2.3)."""
    columns = np.swapaxes(_to_spools(base_points, position), 1, 2)
    return _array(np.linalg.solve(columns, _net(acceleration, g)[:, :, None])[:, :, 0])


def tensions(base_points: Vec, mass: float, position: Vec, acceleration: Vec, g: float) -> Array:
    """Cable tensions in N by a direct solve of the force balance (2.2)."""
    rays = _to_spools(base_points, position)
    columns = np.swapaxes(rays / np.linalg.norm(rays, axis=2, keepdims=True), 1, 2)
    return _array(np.linalg.solve(columns, mass * _net(acceleration, g)[:, :, None])[:, :, 0])


def cable_lengths(base_points: Vec, position: Vec) -> Array:
    """rho_k (2.1)."""
    return _array(np.linalg.norm(_to_spools(base_points, position), axis=2))


def cable_rates(base_points: Vec, position: Vec, velocity: Vec) -> Array:
    """First time derivative of (2.1)."""
    rays = _to_spools(base_points, position)
    return _array(-np.sum(rays * _rows(velocity)[:, None, :], axis=2) / np.linalg.norm(rays, axis=2))


def cable_accelerations(base_points: Vec, position: Vec, velocity: Vec, acceleration: Vec) -> Array:
    """Second time derivative of (2.1)."""
    rays, v, a = _to_spools(base_points, position), _rows(velocity), _rows(acceleration)
    lengths, rates = np.linalg.norm(rays, axis=2), cable_rates(base_points, position, velocity)
    return _array((np.sum(v * v, axis=1)[:, None] - np.sum(rays * a[:, None, :], axis=2) - rates**2) / lengths)


def plane_normal(base_points: Vec) -> Array:
    """Return the normal of the spools' plane, scaled to a z component of 1."""
    a1, a2, a3 = _array(base_points)
    across = np.cross(a2 - a1, a3 - a1)
    return _array(across / across[2])


def height_ratio(base_points: Vec, position: Vec, p0: Vec) -> Array:
    """Distance below the spools' plane over that of P0: also det(M) over its value at P0 (2.9)."""
    normal, centre = plane_normal(base_points), _array(base_points).mean(axis=0)
    return _array((_rows(position) - centre) @ normal / float((_array(p0) - centre) @ normal))


def _rest_point(base_points: Vec, z0: float) -> Array:
    return _array(_array(base_points).mean(axis=0) + np.array([0.0, 0.0, z0]))


def _sampled(base: Vec, p1: Vec, p2: Vec, z0: float, g: float, arcs: int, amp: Amplitude, samples: int) -> Motion:
    tau, p0 = np.linspace(0.0, 1.0, samples), _rest_point(base, z0)
    return motion(p1, p2, p0, g, arcs, tau, amp, z0=z0, normal=plane_normal(base))


def margin(
    base_points: Vec,
    p1: Vec,
    p2: Vec,
    z0: float,
    g: float,
    arcs: int,
    amplitude: Amplitude = quintic,
    samples: int = 20001,
) -> float:
    """Smallest normalised pseudotension or height ratio over the samples; -inf without a positive duration."""
    duration, position, _, acceleration = _sampled(base_points, p1, p2, z0, g, arcs, amplitude, samples)
    if not (math.isfinite(duration) and duration > 0):
        return -math.inf
    p0 = _rest_point(base_points, z0)
    kappa = normalised_pseudotensions(base_points, p0, position, acceleration, g)
    return float(min(kappa.min(), height_ratio(base_points, position, p0).min()))


def smallest_arcs(
    base_points: Vec,
    p1: Vec,
    p2: Vec,
    z0: float,
    g: float,
    max_arcs: int,
    amplitude: Amplitude = quintic,
    samples: int = 20001,
) -> int:
    """First number of arcs with a positive margin (section 2.8), 0 when none up to max_arcs has one."""
    for arcs in range(1, max_arcs + 1):
        if margin(base_points, p1, p2, z0, g, arcs, amplitude, samples) > 0:
            return arcs
    return 0


def feasibility_at_infinity(base_points: Vec, p1: Vec, p2: Vec, z0: float, arcs: int = 2) -> float:
    """Left-hand side of (2.55) for any spool plane.

    With many arcs the acceleration tends to -lambda (p - P0), every normalised pseudotension to the height ratio
    1 + n . (p - P0) / z0 (n the plane's normal with z component 1), and its lowest value on a circle of radius r in
    the trajectory plane is 1 - r |(n . q_h1, n . q_h2)| / z0.  A level plane gives n = (0, 0, 1): (2.55) as printed.
    """
    normal = plane_normal(base_points)
    q1, q2, _, r1, r2 = frame(p1, p2, _rest_point(base_points, z0), arcs, normal=normal)
    return 1.0 - max(r1, r2) * math.hypot(float(normal @ q1), float(normal @ q2)) / z0


def limits(
    base_points: Vec,
    mass: float,
    p1: Vec,
    p2: Vec,
    z0: float,
    g: float,
    arcs: int,
    amplitude: Amplitude = quintic,
    samples: int = 20001,
) -> dict[str, float]:
    """Extremes along the motion at the samples, in SI units; z_max is the largest z coordinate."""
    duration, position, velocity, acceleration = _sampled(base_points, p1, p2, z0, g, arcs, amplitude, samples)
    if not duration > 0:
        raise ValueError("the motion has no positive duration")
    forces = tensions(base_points, mass, position, acceleration, g)
    second = cable_accelerations(base_points, position, velocity, acceleration)
    return {
        "tension_min": float(forces.min()),
        "tension_max": float(forces.max()),
        "z_max": float(position[:, 2].max()),
        "length_max": float(cable_lengths(base_points, position).max()),
        "speed_max": float(np.abs(cable_rates(base_points, position, velocity)).max()),
        "cable_acceleration_max": float(np.abs(second).max()),
        "mass_centre_speed": float(np.linalg.norm(velocity, axis=1).max()),
        "mass_centre_acceleration": float(np.linalg.norm(acceleration, axis=1).max()),
        "mu_min": float(force_ratios(base_points, position, acceleration, g).min()),
    }
