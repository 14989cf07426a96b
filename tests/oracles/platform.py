"""NumPy reference for the rigid platform on six cables (Dion-Gauvin, chapter 3): printed formulas, float64.

Axes: z down, gravity (0, 0, g).  Equation numbers are the thesis's.  Quaternions are (w, x, y, z).  A position is that
of the platform frame's origin; the thesis puts this origin at the mass centre (`centred` moves it there).

Readings chosen where the text errs, is silent or allows two:
- (3.71), (3.80): no factor 2, the angle is gamma beta.  (3.92): eta / 6, not eta.  (3.91) is taken as printed.
- Tilt and torsion: Rz(phi) Rx(theta) Rz(sigma - phi); in the cylindrical frame phi counts from X_c, so delta (3.98) is
  added to it and torsion is untouched (that frame is conjugated, so no rotation stays no rotation).
- gamma in [-pi, pi] below (3.57): the quaternion with w >= 0 is used at both ends, also when their product is negative.
- Rest ends: psi = 0 (even arcs) or pi (odd), as in `point_mass.frame`; the orientation there is the reference one.
- Spools off the origin (c_B): P0 is c_B + (0, 0, z0).  Mass centre off the frame's origin or platform points not
  centred on it (c_A): the motion is unchanged, the wrench is exact; (3.13) is `ideal_wrench`, nothing is fitted to it.
- det J is (3.5) as printed (arms times lengths, m^9), divided by its value at P0 in the reference orientation.
- (3.94) twice: with the text's d (on the two lines, each end then slid onto its segment by itself) and with the
  true shortest vector.  Pairs sharing a spool or a platform point are left out.
- Platform test: the cable's direction in the platform frame; edges from the angular order of the distinct points.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .point_mass import frame, plotting_range

Array = NDArray[np.float64]
Jet = tuple[Array, Array, Array]  # a function of tau and its first two derivatives
Amplitude = Callable[[ArrayLike], tuple[Array, ...]]  # A and its first three derivatives
Betas = tuple[float, float]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
TABLE_3_1 = [  # position (m), (phi, theta, sigma) in the cylindrical frame (rad), as printed
    ((0.0, 0.0, 1.4), (0.0, 0.0, 0.0)),
    ((3.464, 0.0, 1.3), (math.pi / 2, 5 * math.pi / 6, 0.0)),
    ((-0.866, -1.5, 1.3), (math.pi, math.pi / 3, math.pi / 2)),
    ((-1.732, 3.0, 1.7), (3 * math.pi / 4, math.pi / 2, math.pi / 4)),
    ((-3.0, -1.732, 1.0), (math.pi / 4, math.pi / 3, -math.pi / 4)),
    ((1.5, -0.866, 1.0), (0.0, math.pi / 3, -math.pi / 2)),
    ((0.0, 1.732, 1.7), (math.pi / 2, -math.pi / 6, 0.0)),
    ((0.0, 0.0, 1.4), (0.0, 0.0, 0.0)),
]
TABLE_3_2_BETA = [-1.0, -2.9872, -7.5394, -0.1401, -5.1933, -6.5391, -14.6701, -1.0]


@dataclass(frozen=True)
class Robot:
    """Rigid platform: base (6, 3) fixed frame, platform (6, 3) and com (3,) platform frame, m; kg; kg m2 about com."""

    base: Array
    platform: Array
    mass: float
    inertia: Array
    com: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Motion:
    """Samples of a motion in SI units: arrays (n, 3), quaternion (n, 4), rotation (n, 3, 3), angular in fixed axes."""

    duration: float
    position: Array
    velocity: Array
    acceleration: Array
    quaternion: Array
    rotation: Array
    omega: Array
    omega_dot: Array


def mssm(b: float = 0.86, a: float = 0.173, mass: float = 1.0) -> Robot:
    """The MSSM robot (3.95)-(3.97): base radius b and platform radius a in m, mass in kg (the text gives none)."""
    h = math.sqrt(3) / 2
    top, left, right = (0.0, 1.0, 0.0), (-h, -0.5, 0.0), (h, -0.5, 0.0)
    east, west, north = (h, 0.5, 0.0), (-h, 0.5, 0.0), (0.0, -1.0, 0.0)
    base, platform = [top, top, left, left, right, right], [east, west, west, north, north, east]
    inertia = mass * 3 * a**2 * np.diag([1 / 24, 1 / 24, 1 / 12])
    return Robot(b * np.array(base), a * np.array(platform), mass, inertia)


def centred(robot: Robot) -> Robot:
    """Return the same body with the platform frame's origin moved to the mass centre, as in section 3.4.1."""
    return replace(robot, platform=robot.platform - robot.com, com=np.zeros(3))


# Amplitude functions: value and three derivatives


def quintic(tau: ArrayLike) -> tuple[Array, ...]:
    """Amplitude (3.53) at tau (n,) and its first three derivatives, each (n,)."""
    s = np.asarray(tau, dtype=np.float64)
    first = 6 * s**5 - 15 * s**4 + 10 * s**3, 30 * s**4 - 60 * s**3 + 30 * s**2
    return *first, 120 * s**3 - 180 * s**2 + 60 * s, 360 * s**2 - 360 * s + 60


def _piecewise(start: Amplitude, slope: float, epsilon: float) -> Amplitude:
    """Join start on [0, epsilon], a straight middle and the mirrored start; at a knot the outer piece is taken."""

    def amplitude(tau: ArrayLike) -> tuple[Array, ...]:
        s = np.asarray(tau, dtype=np.float64)
        first, last, zero = start(s), start(1 - s), np.zeros_like(s)
        middle = 0.5 + slope * (s - 0.5), zero + slope, zero, zero
        mirrored = 1 - last[0], last[1], -last[2], last[3]
        parts = zip(first, middle, mirrored, strict=True)
        return tuple(np.where(s <= epsilon, a, np.where(s >= 1 - epsilon, c, b)) for a, b, c in parts)

    return amplitude


def effective(epsilon: float) -> Amplitude:
    """Return A_eff (1.110) with three derivatives, 0 < epsilon <= 1/2; the third jumps at epsilon and 1 - epsilon."""
    e, m = epsilon, 1 / (1 - epsilon)
    k = 6 * m / e**3

    def start(x: Array) -> tuple[Array, ...]:
        return k * x**3 * (2 * e - x) / 12, k * x**2 * (3 * e - 2 * x) / 6, k * x * (e - x), k * (e - 2 * x)

    return _piecewise(start, m, e)


def effective_c3(epsilon: float) -> Amplitude:
    """Return the C3 relative of A_eff (errata): A'' = k x (e - x)^2, slope m = 1/(1 - 0.8 e), k = 12 m / e^4."""
    e, m = epsilon, 1 / (1 - 0.8 * epsilon)
    k = 12 * m / e**4

    def start(x: Array) -> tuple[Array, ...]:
        value = k * (e**2 * x**3 / 6 - e * x**4 / 6 + x**5 / 20)
        slope = k * (e**2 * x**2 / 2 - 2 * e * x**3 / 3 + x**4 / 4)
        return value, slope, k * x * (e - x) ** 2, k * (e - x) * (e - 3 * x)

    return _piecewise(start, m, e)


# Quaternions and rotations


def product(q: ArrayLike, r: ArrayLike) -> Array:
    """Quaternion product (3.18) of (..., 4) arrays."""
    a, b = np.asarray(q, dtype=np.float64), np.asarray(r, dtype=np.float64)
    scalar = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    vector = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def conjugate(q: ArrayLike) -> Array:
    """Conjugate (3.24) of (..., 4), the inverse of a unit quaternion (3.28)."""
    return np.asarray(q, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def matrix(q: ArrayLike) -> Array:
    """Rotation matrix (..., 3, 3) of a unit quaternion (..., 4): its columns are the rotated axes (3.30)."""
    unit = np.asarray(q, dtype=np.float64)
    axes = np.concatenate([np.zeros((3, 1)), np.eye(3)], axis=1)
    rotated = [product(product(unit, axis), conjugate(unit))[..., 1:] for axis in axes]
    return np.stack(rotated, axis=-1)


def rotation_vector(q: ArrayLike) -> Array:
    """Angle times axis, gamma e (3,), of a unit quaternion (3.31), rad."""
    w, v = float(np.asarray(q)[0]), np.asarray(q, dtype=np.float64)[1:]
    size = float(np.linalg.norm(v))
    return 2 * math.atan2(size, w) / size * v if size > 0 else np.zeros(3)


def tilt_torsion_matrix(phi: float, theta: float, sigma: float) -> Array:
    """Rz(phi) Rx(theta) Rz(sigma - phi) (section 3.10.2), (3, 3); angles in rad, phi from the fixed x axis."""

    def about_z(x: float) -> Array:
        return np.array([[math.cos(x), -math.sin(x), 0], [math.sin(x), math.cos(x), 0], [0, 0, 1.0]])

    about_x = np.array([[1.0, 0, 0], [0, math.cos(theta), -math.sin(theta)], [0, math.sin(theta), math.cos(theta)]])
    return about_z(phi) @ about_x @ about_z(sigma - phi)


def tilt_torsion_quaternion(phi: float, theta: float, sigma: float) -> Array:
    """Quaternion (4,) of the same rotation, with w >= 0 (gamma in [-pi, pi])."""
    first = np.array([math.cos(phi / 2), 0, 0, math.sin(phi / 2)])
    tilt = np.array([math.cos(theta / 2), math.sin(theta / 2), 0, 0])
    last = np.array([math.cos((sigma - phi) / 2), 0, 0, math.sin((sigma - phi) / 2)])
    q = product(product(first, tilt), last)
    return -q if q[0] < 0 else q


def pose_quaternion(position: ArrayLike, angles: Sequence[float], centre: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Quaternion (4,) of (phi, theta, sigma) given in the cylindrical frame at a position (3.98), rad and m."""
    x, y, _ = np.asarray(position, dtype=np.float64) - np.asarray(centre)
    return tilt_torsion_quaternion(angles[0] + math.atan2(y, x), angles[1], angles[2])


# One segment: translation (3.44), rotation (3.58)-(3.68), (3.93)


@dataclass(frozen=True)
class Segment:
    """Ends p1, p2 (3,) m and q1, q2 (4,); z0 m below the spools' centroid; standard=True: chapter 2's curve (2.38)."""

    p1: ArrayLike
    p2: ArrayLike
    z0: float
    q1: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    q2: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    amplitude: Amplitude = quintic
    gravity: float = 9.81
    standard: bool = False


def rest_point(robot: Robot, z0: float) -> Array:
    """P0 (3,): z0 below the centroid of the spools."""
    return robot.base.mean(axis=0) + np.array([0.0, 0.0, z0])


def plan(robot: Robot, segment: Segment, arcs: int) -> tuple[float, float, float]:
    """theta_h (3.54), n_h (3.55) and the duration T (3.77), s; n_h is infinite and T zero when theta_h = 0."""
    p0 = rest_point(robot, segment.z0)
    theta, cusps = plotting_range(frame(segment.p1, segment.p2, p0, arcs)[2], arcs)
    if not math.isfinite(cusps):
        return theta, cusps, 0.0
    return theta, cusps, math.sqrt(theta**2 * (cusps - 1) * segment.z0 / segment.gravity)


def plane_curve(theta: float, cusps: float, radius: tuple[Array, ...], tau: Array, *, standard: bool = False) -> Jet:
    """Curve (3.44), or (2.38) if standard, and two derivatives in tau, each (n, 2); radius: r, r', r'', r''' (n,)."""
    n, k = cusps, cusps - 1

    def waves(order: int) -> tuple[Array, Array]:
        slow, fast, turn = theta * tau, k * theta * tau, order * math.pi / 2
        a, b = theta**order, (k * theta) ** order
        cos1, cos2 = a * np.cos(slow + turn), b * np.cos(fast + turn)
        sin1, sin2 = a * np.sin(slow + turn), b * np.sin(fast + turn)
        with_r = np.stack([k * cos1 + cos2, k * sin1 - sin2], axis=-1) / n
        with_slope = np.stack([-(sin1 + sin2), cos1 - cos2], axis=-1) / (n * theta)
        return with_r, with_slope * (0.0 if standard else 1.0)

    (w0, v0), (w1, v1), (w2, v2) = waves(0), waves(1), waves(2)
    r0, r1, r2, r3 = (np.asarray(x)[:, None] for x in radius)
    first = r1 * w0 + r0 * w1 + r2 * v0 + r1 * v1
    second = r2 * w0 + 2 * r1 * w1 + r0 * w2 + r3 * v0 + 2 * r2 * v1 + r1 * v2
    return r0 * w0 + r1 * v0, first, second


def translation(robot: Robot, segment: Segment, arcs: int, tau: ArrayLike) -> Jet:
    """Position (3.43), and its first two derivatives in tau (not in time), each (n, 3)."""
    p0, s = rest_point(robot, segment.z0), np.atleast_1d(np.asarray(tau, dtype=np.float64))
    x, y, _, r1, r2 = frame(segment.p1, segment.p2, p0, arcs)
    theta, cusps, _ = plan(robot, segment, arcs)
    a0, a1, a2, a3 = segment.amplitude(s)
    radius = (r2 - r1) * a0 + r1, (r2 - r1) * a1, (r2 - r1) * a2, (r2 - r1) * a3  # (3.51)
    c0, c1, c2 = plane_curve(theta, cusps, radius, s, standard=segment.standard)
    plane = np.stack([x, y])
    return c0 @ plane + p0, c1 @ plane, c2 @ plane


def _mul(a: Jet, b: Jet) -> Jet:
    return a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2 * a[1] * b[1] + a[0] * b[2]


def _column(jet: Jet) -> Jet:
    return jet[0][:, None], jet[1][:, None], jet[2][:, None]


def beta_1(tau: Array, arcs: int) -> Jet:
    """Oscillating function (3.66) and two derivatives in tau, each (n,)."""
    k = arcs * math.pi
    return np.cos(k * tau), -k * np.sin(k * tau), -(k**2) * np.cos(k * tau)


def beta_0(tau: Array, arcs: int) -> Jet:
    """Oscillating function (3.67) and two derivatives in tau, each (n,)."""
    return tuple((9 * a - b) / 8 for a, b in zip(beta_1(tau, arcs), beta_1(tau, 3 * arcs), strict=True))


def beta_f(tau: Array, arcs: int, second: float) -> Jet:
    """Oscillating function (3.68) with second derivative `second` (beta-double-dot) at tau = 0; jet of (n,)."""
    x = second / (arcs * math.pi) ** 2
    pairs = zip(beta_1(tau, arcs), beta_1(tau, 3 * arcs), strict=True)
    return tuple(((9 + x) * a - (1 + x) * b) / 8 for a, b in pairs)


def beta_ff(tau: Array, arcs: int, seconds: Betas) -> Jet:
    """Oscillating function (3.93) with beta-double-dot of the first and of the last pose; jet of (n,)."""
    one, zero = np.ones_like(tau), np.zeros_like(tau)
    start = _mul((1 - tau, -one, zero), beta_f(tau, arcs, seconds[0]))
    end = _mul((tau, one, zero), beta_f(tau, arcs, seconds[1]))
    return start[0] + end[0], start[1] + end[1], start[2] + end[2]


def envelope(segment: Segment, arcs: int, tau: Array) -> Jet:
    """Envelope q_env (3.58)-(3.60) and two derivatives in tau, each (n, 4); ends with w >= 0."""
    start, end = (np.asarray(q, dtype=np.float64) / np.linalg.norm(q) for q in (segment.q1, segment.q2))
    start, end = (-q if q[0] < 0 else q for q in (start, end))
    end = end if arcs % 2 == 0 else conjugate(end)  # (3.58)
    angle = 2 * math.atan2(np.linalg.norm(start - end), np.linalg.norm(start + end))  # (3.60)
    if angle > math.pi - 1e-9:
        raise ValueError("the envelope's ends are opposite quaternions: (3.59) is not defined")
    a, da, dda = (x[:, None] for x in segment.amplitude(tau)[:3])
    if angle < 1e-12:
        value, slope, bend = start * (1 - a) + end * a, end - start + 0 * a, 0 * a
    else:
        value = (start * np.sin(angle * (1 - a)) + end * np.sin(angle * a)) / math.sin(angle)
        slope = angle * (end * np.cos(angle * a) - start * np.cos(angle * (1 - a))) / math.sin(angle)
        bend = -(angle**2) * value
    return value, slope * da, bend * da**2 + slope * dda


def orientation(segment: Segment, arcs: int, beta: Callable[[Array], Jet], tau: Array) -> Array:
    """Oscillating SLERP (3.64)-(3.65) as printed: unit quaternions (n, 4) at tau (n,)."""
    env, b = envelope(segment, arcs, tau)[0], beta(tau)[0]
    angle = np.arctan2(np.linalg.norm(env[:, 1:], axis=1), env[:, 0])  # (3.65)
    near = angle < 1e-9
    sine = np.where(near, 1.0, np.sin(angle))
    first = np.where(near, 1 - b, np.sin(angle * (1 - b)) / sine)
    second = np.where(near, b, np.sin(angle * b) / sine)
    return IDENTITY * first[:, None] + env * second[:, None]


def orientation_jet(segment: Segment, arcs: int, beta: Callable[[Array], Jet], tau: Array) -> Jet:
    """Return q of (3.64) and its exact first two derivatives in tau, each (n, 4).

    With w = (1 - cos Theta) / 2 <= 1/2, (3.64) is [cos(beta Theta); sin(beta Theta) / sin(Theta) vec(q_env)], where
    cos(beta Theta) = 2F1(-beta, beta; 1/2; w), the ratio = beta 2F1(1 - beta, 1 + beta; 3/2; w): no 0/0 at rest.
    """
    env, b = envelope(segment, arcs, tau), beta(tau)
    w = tuple((x - e[:, 0]) / 2 for x, e in zip((1.0, 0.0, 0.0), env, strict=True))
    square, one = _mul(b, b), (np.ones_like(tau), np.zeros_like(tau), np.zeros_like(tau))
    sums: list[Jet] = []
    for shift, term in ((0, one), (1, b)):
        total = term
        for k in range(100):
            scale = 1 / ((k + 0.5 + shift) * (k + 1))
            factor = ((k + shift) ** 2 - square[0]) * scale, -square[1] * scale, -square[2] * scale
            term = _mul(_mul(term, factor), w)
            total = total[0] + term[0], total[1] + term[1], total[2] + term[2]
        sums.append(total)
    vector = _mul(_column(sums[1]), (env[0][:, 1:], env[1][:, 1:], env[2][:, 1:]))
    return tuple(np.concatenate([c[:, None], v], axis=1) for c, v in zip(sums[0], vector, strict=True))


def motion(
    robot: Robot, segment: Segment, arcs: int, beta_hat: Betas, tau: ArrayLike, *, differences: bool = False
) -> Motion:
    """Whole motion at tau (n,), with beta_hat (3.81) of both ends and beta_ff (3.93).

    Default: analytic derivatives, and (3.32)-(3.33) for the angular ones.  differences=True: sixth-order central
    differences of position and of Q, angular from Q' Q^T and Q'' Q^T (not for samples within 0.01/arcs of a knot).
    """
    s = np.atleast_1d(np.asarray(tau, dtype=np.float64))
    theta, cusps, duration = plan(robot, segment, arcs)
    rate = theta**2 * (cusps - 1)

    def beta(x: Array) -> Jet:
        return beta_ff(x, arcs, (beta_hat[0] * rate, beta_hat[1] * rate))

    q, dq, ddq = orientation_jet(segment, arcs, beta, s)
    p, dp, ddp = translation(robot, segment, arcs, s)
    if not differences:
        omega, omega_dot = 2 * product(dq, conjugate(q))[:, 1:], 2 * product(ddq, conjugate(q))[:, 1:]
    else:
        q, step = orientation(segment, arcs, beta, s), 0.003 / arcs
        turns = [matrix(orientation(segment, arcs, beta, s + j * step)) for j in range(-3, 4)]
        places = [translation(robot, segment, arcs, s + j * step)[0] for j in range(-3, 4)]
        dp, ddp = _difference(places, step)
        spins = [x @ np.swapaxes(turns[3], 1, 2) for x in _difference(turns, step)]
        omega, omega_dot = (np.stack([x[:, 2, 1], x[:, 0, 2], x[:, 1, 0]], axis=-1) for x in _skew(spins))
    return Motion(
        duration, p, dp / duration, ddp / duration**2, q, matrix(q), omega / duration, omega_dot / duration**2
    )


def _difference(values: list[Array], step: float) -> tuple[Array, Array]:
    first, second = (-1, 9, -45, 0, 45, -9, 1), (2, -27, 270, -490, 270, -27, 2)
    one = sum(c * v for c, v in zip(first, values, strict=True)) / (60 * step)
    return one, sum(c * v for c, v in zip(second, values, strict=True)) / (180 * step**2)


def _skew(matrices: list[Array]) -> list[Array]:
    return [(x - np.swapaxes(x, 1, 2)) / 2 for x in matrices]


# Statics and dynamics


def cables(robot: Robot, position: ArrayLike, rotation: ArrayLike) -> Array:
    """Vectors rho_k (3.1) from spool to platform point, (n, 6, 3), m."""
    p, turn = np.asarray(position).reshape(-1, 3), np.asarray(rotation).reshape(-1, 3, 3)
    return p[:, None, :] + np.einsum("nij,kj->nki", turn, robot.platform) - robot.base


def jacobian(robot: Robot, position: ArrayLike, rotation: ArrayLike) -> Array:
    """J (3.5), (n, 6, 6), rows [rho_k, arm_k x rho_k], arms from the mass centre; m and m2."""
    rho = cables(robot, position, rotation)
    arms = np.einsum("nij,kj->nki", np.asarray(rotation).reshape(-1, 3, 3), robot.platform - robot.com)
    return np.concatenate([rho, np.cross(arms, rho)], axis=2)


def relative_determinant(robot: Robot, position: ArrayLike, rotation: ArrayLike, z0: float) -> Array:
    """Return det J (3.5) over its value at P0 in the reference orientation, (n,); section 3.11.4 wants it positive."""
    reference = np.linalg.det(jacobian(robot, rest_point(robot, z0), np.eye(3)))[0]
    return np.linalg.det(jacobian(robot, position, rotation)) / reference


def wrench(
    robot: Robot, rotation: ArrayLike, acceleration: ArrayLike, omega: ArrayLike, omega_dot: ArrayLike, gravity: float
) -> Array:
    """Right side of (3.11) with (3.8), (n, 6), over the mass; acceleration is that of the platform frame's origin."""
    turn = np.asarray(rotation).reshape(-1, 3, 3)
    a, w, dw = (np.asarray(x, dtype=np.float64).reshape(-1, 3) for x in (acceleration, omega, omega_dot))
    offset = turn @ robot.com
    force = a + np.cross(dw, offset) + np.cross(w, np.cross(w, offset)) - np.array([0.0, 0.0, gravity])
    inertia = turn @ robot.inertia @ np.swapaxes(turn, 1, 2)
    spin = np.einsum("nij,nj->ni", inertia, w)
    moment = np.einsum("nij,nj->ni", inertia, dw) + np.cross(w, spin)
    return np.concatenate([force, moment / robot.mass], axis=1)


def force_ratios(robot: Robot, position: ArrayLike, rotation: ArrayLike, right_side: Array) -> Array:
    """mu = f / (m rho) (3.10), (n, 6) in 1/s2, solving (3.11) at each instant; NaN where J is exactly singular."""
    result = np.full((len(right_side), 6), np.nan)
    for i, (j, b) in enumerate(zip(jacobian(robot, position, rotation), right_side, strict=True)):
        try:
            result[i] = np.linalg.solve(-j.T, b)
        except np.linalg.LinAlgError:
            continue
    return result


def tensions(robot: Robot, position: ArrayLike, rotation: ArrayLike, ratios: Array) -> Array:
    """Return the actual cable tensions f = m rho mu (3.10), (n, 6), N."""
    return robot.mass * np.linalg.norm(cables(robot, position, rotation), axis=2) * ratios


def static_ratios(robot: Robot, position: ArrayLike, rotation: ArrayLike, gravity: float = 9.81) -> Array:
    """mu (6,) at rest at one pose, 1/s2; g / (6 z0) each at P0 for the MSSM."""
    zero = np.zeros(3)
    return force_ratios(robot, position, rotation, wrench(robot, rotation, zero, zero, zero, gravity))[0]


def ideal_wrench(robot: Robot, position: ArrayLike, rotation: ArrayLike) -> Array:
    """Left side of (3.13) over eta, (6,), for any c_A and c_B: what equal mu of 1/6 each applies; (3.14) is a case."""
    turn, p = np.asarray(rotation), np.asarray(position) + np.asarray(rotation) @ robot.com
    arms = (robot.platform - robot.com) @ turn.T
    c_a, c_b = arms.mean(axis=0), robot.base.mean(axis=0)
    moment = np.cross(c_a, p) - np.cross(arms, robot.base).mean(axis=0)
    return -np.concatenate([p + c_a - c_b, moment])


def deviations(
    robot: Robot, position: ArrayLike, q: ArrayLike, z0: float, gravity: float = 9.81
) -> tuple[Array, Array]:
    """u and v (6,) of mu = eta/6 + u + beta_hat v at an end pose (3.82), (3.89), by solving (3.69) twice.

    The acceleration is (3.70) with (3.77), the angular one beta_hat (g/z0) gamma e, that is (3.71) without its 2.
    """
    eta, turn = gravity / z0, matrix(np.asarray(q))
    acceleration = -eta * (np.asarray(position) - rest_point(robot, z0))
    solved = [
        force_ratios(
            robot, position, turn, wrench(robot, turn, acceleration, np.zeros(3), x * eta * rotation_vector(q), gravity)
        )[0]
        for x in (0.0, 1.0)
    ]
    return solved[0] - eta / 6, solved[1] - solved[0]


def printed_deviations(
    robot: Robot, position: ArrayLike, q: ArrayLike, z0: float, gravity: float = 9.81, *, factor: float = 1.0
) -> tuple[Array, Array]:
    """u and v (6,) by the printed blocks (3.87)-(3.90), for c_A = c_B = 0; factor 2 is (3.80) as printed, 1 is right."""
    eta, turn = gravity / z0, matrix(np.asarray(q))
    left = -jacobian(robot, position, turn)[0].T
    a, b, c, d = left[:3, :3], left[:3, 3:], left[3:, :3], left[3:, 3:]
    e = d - c @ np.linalg.solve(a, b)
    m = np.cross(robot.platform @ turn.T, robot.base).mean(axis=0)  # (3.15)
    phi = factor * eta / robot.mass * turn @ robot.inertia @ rotation_vector(q)  # (3.80)
    from_u, from_v = np.linalg.solve(e, m), np.linalg.solve(e, phi)
    u = eta * np.concatenate([np.linalg.solve(a, b @ from_u), -from_u])
    return u, np.concatenate([-np.linalg.solve(a, b @ from_v), from_v])


def preferred_beta_hat(u: Array, v: Array) -> float:
    """Best beta_hat (3.91); -1, which makes beta_f equal beta_1, where the rotation is nil and any value does."""
    return -float(u @ v) / float(v @ v) if np.linalg.norm(v) > 0 else -1.0


def beta_hat_interval(u: Array, v: Array, eta: float) -> Betas:
    """Interval (3.92), with eta / 6, of beta_hat that keep mu >= 0; (inf, -inf) when empty."""
    low, high = -math.inf, math.inf
    for slack, slope in zip(eta / 6 + u, v, strict=True):
        if slope > 0:
            low = max(low, -slack / slope)
        elif slope < 0:
            high = min(high, -slack / slope)
        elif slack < 0:
            return math.inf, -math.inf
    return (low, high) if low <= high else (math.inf, -math.inf)


# Interference


def colliding_pairs(robot: Robot) -> list[tuple[int, int]]:
    """Pairs of cables that share neither spool nor platform point: nine for the MSSM."""

    def apart(points: Array, i: int, j: int) -> bool:
        return bool(np.linalg.norm(points[i] - points[j]) > 1e-9 * np.abs(points).max())

    count = len(robot.base)
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
    return [(i, j) for i, j in pairs if apart(robot.base, i, j) and apart(robot.platform, i, j)]


def shortest_vector(a: Array, u: Array, b: Array, v: Array) -> Array:
    """Shortest vector (3,) from segment a + s u to segment b + t v, s and t in [0, 1]: the best of five candidates."""
    candidates = []
    normal = np.cross(u, v)
    if np.linalg.norm(normal) > 1e-12 * np.linalg.norm(u) * np.linalg.norm(v):
        s, t = _line_parameters(a, u, b, v, normal)
        if 0 <= s <= 1 and 0 <= t <= 1:
            candidates.append(b + t * v - a - s * u)
    for s in (0.0, 1.0):  # an end of the first with the second
        t = np.clip((a + s * u - b) @ v / (v @ v), 0, 1)
        candidates.append(b + t * v - a - s * u)
    for t in (0.0, 1.0):
        s = np.clip((b + t * v - a) @ u / (u @ u), 0, 1)
        candidates.append(b + t * v - a - s * u)
    return min(candidates, key=np.linalg.norm)


def _line_parameters(a: Array, u: Array, b: Array, v: Array, normal: Array) -> tuple[float, float]:
    squared = normal @ normal
    return float(np.cross(b - a, v) @ normal / squared), float(np.cross(b - a, u) @ normal / squared)


def printed_vector(a: Array, u: Array, b: Array, v: Array) -> Array:
    """Return d (3,) as section 3.10.2 says: between the lines, each end then slid onto its own segment (not shortest)."""
    normal = np.cross(u, v)
    if np.linalg.norm(normal) <= 1e-12 * np.linalg.norm(u) * np.linalg.norm(v):
        return shortest_vector(a, u, b, v)
    s, t = np.clip(_line_parameters(a, u, b, v, normal), 0, 1)
    return b + t * v - a - s * u


def cable_vectors(robot: Robot, position: Array, rotation: Array, rule: Callable[..., Array]) -> Array:
    """Vectors d of every pair of `colliding_pairs`, (n, pairs, 3), m, by shortest_vector or printed_vector."""
    rho, base = cables(robot, position, rotation), robot.base
    return np.array([[rule(base[i], r[i], base[j], r[j]) for i, j in colliding_pairs(robot)] for r in rho])


def cables_cross(vectors: Array) -> Array:
    """Whether (3.94) fails between successive samples, (n - 1, pairs), from vectors d (n, pairs, 3)."""
    return np.sum(vectors[1:] * vectors[:-1], axis=2) <= 0


def platform_edges(robot: Robot) -> Array:
    """s_k1 and s_k2, (6, 2, 3): from each platform point to its two neighbours around a flat convex platform."""
    points = np.array([p for i, p in enumerate(robot.platform) if not _among(p, robot.platform[:i])])
    centre = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - centre)
    if len(points) < 3 or sizes[2] > 1e-9 * sizes[0]:
        raise ValueError("the platform points must span a plane")
    flat = (points - centre) @ axes[:2].T
    ring = points[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))]
    edges = np.empty((len(robot.platform), 2, 3))
    for k, p in enumerate(robot.platform):
        at = int(np.argmin(np.linalg.norm(ring - p, axis=1)))
        edges[k] = ring[at - 1] - p, ring[(at + 1) % len(ring)] - p
    return edges


def _among(point: Array, others: Array) -> bool:
    return any(np.linalg.norm(point - x) <= 1e-9 * np.abs(point).max() for x in others)


def platform_hit(robot: Robot, position: Array, rotation: Array) -> Array:
    """Whether cable k strikes the platform between successive samples (section 3.10.2), (n - 1, 6).

    In the platform frame, with nu = -Q^T rho: the line common to the planes of (nu_{i-1}, nu_i) and (s_1, s_2) must be
    a combination of each couple with positive weights.  alpha nu_{i-1} + beta nu_i = c s_1 + d s_2 fixes them up to one
    factor, by Cramer.  A cable that lies exactly in the platform's plane at a sample is not seen.
    """
    nu = -np.einsum("nji,nkj->nki", rotation, cables(robot, position, rotation))
    s1, s2 = platform_edges(robot).transpose(1, 0, 2)
    normal = np.cross(s1, s2)
    height = np.sum(nu * normal, axis=2)
    alpha, beta = height[1:], -height[:-1]
    line = alpha[..., None] * nu[:-1] + beta[..., None] * nu[1:]
    c = np.sum(np.cross(line, s2) * normal, axis=2)
    d = np.sum(np.cross(s1, line) * normal, axis=2)
    weights = np.stack([alpha, beta, c, d], axis=-1)
    return np.all(weights > 0, axis=-1) | np.all(weights < 0, axis=-1)


# Verdicts


def end_beta_hats(robot: Robot, segment: Segment) -> Betas:
    """Return the preferred beta_hat (3.91) of both ends."""
    ends = ((segment.p1, segment.q1), (segment.p2, segment.q2))
    first, last = (preferred_beta_hat(*deviations(robot, p, q, segment.z0, segment.gravity)) for p, q in ends)
    return first, last


def check_motion(
    robot: Robot, segment: Segment, p: int, beta_hat: Betas | None = None, samples: int = 2001
) -> dict[str, float | bool]:
    """The four tests of section 3.11 at evenly spaced samples of one segment with p arcs, SI units.

    beta_hat None takes (3.91).  mu_hat_min is mu over g / (6 z0); det_min the smallest relative det J (negative:
    crossed); cable_distance_min is true; cable_cable is (3.94) as printed, cable_cable_true with the shortest vector.
    """
    tau = np.linspace(0.0, 1.0, samples)
    duration = plan(robot, segment, p)[2]
    if duration == 0:
        return {"feasible": False, "duration": 0.0}
    m = motion(robot, segment, p, beta_hat or end_beta_hats(robot, segment), tau)
    right = wrench(robot, m.rotation, m.acceleration, m.omega, m.omega_dot, segment.gravity)
    mu = force_ratios(robot, m.position, m.rotation, right)
    det = relative_determinant(robot, m.position, m.rotation, segment.z0)
    true = cable_vectors(robot, m.position, m.rotation, shortest_vector)
    crossed = bool(cables_cross(cable_vectors(robot, m.position, m.rotation, printed_vector)).any())
    hit, mu_min, det_min = bool(platform_hit(robot, m.position, m.rotation).any()), float(mu.min()), float(det.min())
    return {
        "feasible": mu_min > 0 and det_min > 0 and not crossed and not hit,
        "duration": duration,
        "mu_min": mu_min,
        "mu_hat_min": 6 * segment.z0 / segment.gravity * mu_min,
        "mu_min_tau": float(tau[np.argmin(mu.min(axis=1))]),
        "tension_min": float(tensions(robot, m.position, m.rotation, mu).min()),
        "tension_max": float(tensions(robot, m.position, m.rotation, mu).max()),
        "det_min": det_min,
        "cable_distance_min": float(np.linalg.norm(true, axis=2).min()),
        "cable_cable": crossed,
        "cable_cable_true": bool(cables_cross(true).any()),
        "cable_platform": hit,
        "z_min": float(m.position[:, 2].min()),
    }


def smallest_arcs(
    robot: Robot, segment: Segment, max_arcs: int, beta_hat: Betas | None = None, samples: int = 1001
) -> int:
    """First number of arcs that passes the four tests (section 3.11.1), 0 when none up to max_arcs does."""
    for arcs in range(1, max_arcs + 1):
        if check_motion(robot, segment, arcs, beta_hat, samples)["feasible"]:
            return arcs
    return 0
