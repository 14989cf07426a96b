"""NumPy reference for the rigid platform on six cables (Dion-Gauvin, chapter 3): printed formulas, float64.

Axes: z down, gravity (0, 0, g).  Equation numbers are the thesis's.  Quaternions are (w, x, y, z).  A position is that
of the platform frame's origin; the thesis puts this origin at the mass centre (`centred` moves it there).
A jet is a function of tau with its derivatives in tau stacked along the first axis.

Readings chosen where the text errs, is silent or allows two:
- (3.71), (3.80): no factor 2, the angle is gamma beta.  (3.92): eta / 6, not eta.  (3.91) is right as printed.
- Tilt and torsion: Rz(phi) Rx(theta) Rz(sigma - phi); in the cylindrical frame phi counts from X_c, so delta (3.98) is
  added to it and the torsion is untouched (conjugation by Rz(delta): no rotation stays no rotation).
- gamma in [-pi, pi] below (3.57): the quaternion with w >= 0 is used at both ends, also when their product is negative.
- Rest ends: psi = 0 (even arcs) or pi (odd), as in `point_mass.frame`; the orientation there is the reference one.
- Spools off the origin (c_B): P0 is c_B + (0, 0, z0).  Mass centre off the frame's origin, or platform points not
  centred on it (c_A): the motion is unchanged, the wrench exact; (3.13) is `ideal_wrench`, no motion is fitted to it.
- det J is that of (3.5) as printed (m^9), divided by its value at P0 in the reference orientation (which is negative).
- (3.94) twice: with the text's d (on the two lines, each end then slid onto its own segment) and with the true shortest
  vector.  Pairs that share a spool or a platform point are left out.
- Platform test: cable directions in the platform frame, touching counts; edges from the angular order of the distinct
  platform points.
"""

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray

from .point_mass import frame, plotting_range

Array = NDArray[np.float64]
Vec = ArrayLike
Amplitude = Callable[[Vec], Array]
Betas = tuple[float, float]

ZERO = np.zeros(3)
SINGULAR = 1e-9  # relative det J below this counts as singular: exact singularities give rounding of either sign


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
    """Samples in SI units: (n, 3) each, quaternion (n, 4), rotation (n, 3, 3), angular vectors in fixed axes."""

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
    b1, b3, b5 = (0.0, 1.0, 0.0), (-h, -0.5, 0.0), (h, -0.5, 0.0)
    a1, a2, a4 = (h, 0.5, 0.0), (-h, 0.5, 0.0), (0.0, -1.0, 0.0)
    inertia = mass * 3 * a**2 * np.diag([1 / 24, 1 / 24, 1 / 12])
    return Robot(b * np.array([b1, b1, b3, b3, b5, b5]), a * np.array([a1, a2, a2, a4, a4, a1]), mass, inertia)


def centred(robot: Robot) -> Robot:
    """Return the same body with the platform frame's origin moved to the mass centre, as in section 3.4.1."""
    return replace(robot, platform=robot.platform - robot.com, com=np.zeros(3))


def quintic(tau: Vec) -> Array:
    """Amplitude (3.53) and its first three derivatives, (4, n)."""
    return np.array([Polynomial([0, 0, 0, 10, -15, 6]).deriv(i)(np.asarray(tau, dtype=float)) for i in range(4)])


def effective(epsilon: float) -> Amplitude:
    """A_eff (1.110), from its A'' (1.105), 0 < epsilon <= 1/2; the third derivative jumps at epsilon, 1 - epsilon."""
    k = 6 / (1 - epsilon) / epsilon**3
    return _piecewise(Polynomial([0, k * epsilon, -k]), 1 / (1 - epsilon), epsilon)


def effective_c3(epsilon: float) -> Amplitude:
    """C3 relative of A_eff (errata): A'' = 12 m / epsilon^4 tau (epsilon - tau)^2, slope m = 1 / (1 - 0.8 epsilon)."""
    m = 1 / (1 - 0.8 * epsilon)
    return _piecewise(12 * m / epsilon**4 * Polynomial([0, epsilon**2, -2 * epsilon, 1]), m, epsilon)


def _piecewise(second_derivative: Polynomial, slope: float, epsilon: float) -> Amplitude:
    """A'' = bend up to epsilon, a straight middle, the end mirrored; at a knot the outer piece is taken."""

    def amplitude(tau: Vec) -> Array:
        s = np.asarray(tau, dtype=float)
        start = np.array([second_derivative.integ(2).deriv(i)(s) for i in range(4)])
        end = np.array([second_derivative.integ(2).deriv(i)(1 - s) * (-1) ** (i + 1) for i in range(4)])
        end[0] += 1  # (1.108)
        middle = np.array([0.5 + slope * (s - 0.5), slope + 0 * s, 0 * s, 0 * s])
        return np.where(s <= epsilon, start, np.where(s >= 1 - epsilon, end, middle))

    return amplitude


def product(q: Array, r: Array) -> Array:
    """Quaternion product (3.18) of (..., 4) arrays."""
    scalar = q[..., :1] * r[..., :1] - np.sum(q[..., 1:] * r[..., 1:], axis=-1, keepdims=True)
    vector = q[..., :1] * r[..., 1:] + r[..., :1] * q[..., 1:] + np.cross(q[..., 1:], r[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def conjugate(q: Array) -> Array:
    """Conjugate (3.24) of (..., 4), the inverse of a unit quaternion (3.28)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def matrix(q: Array) -> Array:
    """Rotation matrix (..., 3, 3) of a unit quaternion (..., 4): its columns are the rotated axes (3.30)."""
    axes = np.eye(4)[1:]
    return np.stack([product(product(q, axis), conjugate(q))[..., 1:] for axis in axes], axis=-1)


def rotation_vector(q: Array) -> Array:
    """Angle times axis, gamma e (3,), of a unit quaternion (3.31), rad."""
    size = float(np.linalg.norm(q[1:]))
    return 2 * math.atan2(size, q[0]) / size * q[1:] if size > 0 else np.zeros(3)


def tilt_torsion_matrix(phi: float, theta: float, sigma: float) -> Array:
    """Rz(phi) Rx(theta) Rz(sigma - phi) (section 3.10.2), (3, 3); angles in rad, phi from the fixed x axis."""
    (c1, s1), (c2, s2), (c3, s3) = ((math.cos(x), math.sin(x)) for x in (phi, theta, sigma - phi))
    first, last = (np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) for c, s in ((c1, s1), (c3, s3)))
    return first @ np.array([[1, 0, 0], [0, c2, -s2], [0, s2, c2]]) @ last


def tilt_torsion_quaternion(phi: float, theta: float, sigma: float) -> Array:
    """Quaternion (4,) of the same rotation, with w >= 0 (gamma in [-pi, pi])."""
    (c1, s1), (c2, s2), (c3, s3) = ((math.cos(x / 2), math.sin(x / 2)) for x in (phi, theta, sigma - phi))
    q = product(product(np.array([c1, 0, 0, s1]), np.array([c2, s2, 0, 0])), np.array([c3, 0, 0, s3]))
    return -q if q[0] < 0 else q


def pose_quaternion(position: Vec, angles: Sequence[float], centre: Vec = (0.0, 0.0, 0.0)) -> Array:
    """Quaternion (4,) of (phi, theta, sigma) given in the cylindrical frame at a position (3.98), rad and m."""
    x, y, _ = np.asarray(position, dtype=float) - np.asarray(centre)
    return tilt_torsion_quaternion(angles[0] + math.atan2(y, x), angles[1], angles[2])


@dataclass(frozen=True)
class Segment:
    """Ends p1, p2 (3,) m and q1, q2 (4,); z0 m below the spools' centroid; standard=True: chapter 2's curve (2.38)."""

    p1: Vec
    p2: Vec
    z0: float
    q1: Vec = (1.0, 0.0, 0.0, 0.0)
    q2: Vec = (1.0, 0.0, 0.0, 0.0)
    amplitude: Amplitude = quintic
    gravity: float = 9.81
    standard: bool = False


def rest_point(robot: Robot, z0: float) -> Array:
    """P0 (3,): z0 below the centroid of the spools."""
    return robot.base.mean(axis=0) + np.array([0.0, 0.0, z0])


def plan(robot: Robot, segment: Segment, arcs: int) -> tuple[float, float, float]:
    """theta_h (3.54), n_h (3.55) and the duration T (3.77), s; n_h is infinite and T zero when theta_h = 0."""
    psi = frame(segment.p1, segment.p2, rest_point(robot, segment.z0), arcs)[2]
    theta, cusps = plotting_range(psi, arcs)
    rate = theta**2 * (cusps - 1) if math.isfinite(cusps) else 0.0
    return theta, cusps, math.sqrt(rate * segment.z0 / segment.gravity)


def plane_curve(theta: float, cusps: float, radius: Array, tau: Array, *, standard: bool = False) -> Array:
    """Jet (3, n, 2) of the curve (3.44), or (2.38) if standard; radius (4, n) is the jet of r."""

    def waves(order: int) -> tuple[Array, Array]:
        k, turn = cusps - 1, order * math.pi / 2  # each derivative turns the phase by pi/2
        cos1, sin1 = (theta**order * f(theta * tau + turn) for f in (np.cos, np.sin))
        cos2, sin2 = ((k * theta) ** order * f(k * theta * tau + turn) for f in (np.cos, np.sin))
        with_r = np.stack([k * cos1 + cos2, k * sin1 - sin2], axis=-1) / cusps
        with_slope = np.stack([-(sin1 + sin2), cos1 - cos2], axis=-1) / (cusps * theta)
        return with_r, (0.0 if standard else 1.0) * with_slope

    w, v = (np.array(x) for x in zip(*(waves(order) for order in range(3)), strict=True))
    r = radius[:, :, None]
    return _mul(r[:3], w) + _mul(r[1:], v)


def _mul(a: Array, b: Array) -> Array:
    """Jet of a product."""
    return np.array([a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2 * a[1] * b[1] + a[0] * b[2]])


def translation(robot: Robot, segment: Segment, arcs: int, tau: Array) -> Array:
    """Jet (3, n, 3) of the position (3.43) in tau, m."""
    p0 = rest_point(robot, segment.z0)
    x, y, _, r1, r2 = frame(segment.p1, segment.p2, p0, arcs)
    theta, cusps, _ = plan(robot, segment, arcs)
    radius = (r2 - r1) * segment.amplitude(tau) + np.array([r1, 0, 0, 0])[:, None]  # (3.51)
    jet = plane_curve(theta, cusps, radius, tau, standard=segment.standard) @ np.stack([x, y])
    jet[0] += p0
    return jet


def beta_1(tau: Array, arcs: int) -> Array:
    """Jet (3, n) of the oscillating function (3.66)."""
    k = arcs * math.pi
    return np.array([np.cos(k * tau), -k * np.sin(k * tau), -(k**2) * np.cos(k * tau)])


def beta_0(tau: Array, arcs: int) -> Array:
    """Jet (3, n) of (3.67): no second derivative at the ends."""
    return (9 * beta_1(tau, arcs) - beta_1(tau, 3 * arcs)) / 8


def beta_f(tau: Array, arcs: int, second: float) -> Array:
    """Jet (3, n) of (3.68); second is beta-double-dot, the second derivative in tau at tau = 0."""
    x = second / (arcs * math.pi) ** 2
    return ((9 + x) * beta_1(tau, arcs) - (1 + x) * beta_1(tau, 3 * arcs)) / 8


def beta_ff(tau: Array, arcs: int, seconds: Betas) -> Array:
    """Jet (3, n) of (3.93), from beta-double-dot of the first and of the last pose."""
    end = np.array([tau, np.ones_like(tau), np.zeros_like(tau)])
    start = np.array([1 - tau, -np.ones_like(tau), np.zeros_like(tau)])
    return _mul(start, beta_f(tau, arcs, seconds[0])) + _mul(end, beta_f(tau, arcs, seconds[1]))


def envelope(segment: Segment, arcs: int, tau: Array) -> Array:
    """Jet (3, n, 4) of the envelope q_env (3.58)-(3.60); both ends with w >= 0."""
    start, end = (np.asarray(q, dtype=float) / np.linalg.norm(q) for q in (segment.q1, segment.q2))
    start, end = (-q if q[0] < 0 else q for q in (start, end))
    end = end if arcs % 2 == 0 else conjugate(end)  # (3.58)
    angle = 2 * math.atan2(np.linalg.norm(start - end), np.linalg.norm(start + end))  # (3.60)
    if angle > math.pi - 1e-9:
        raise ValueError("the envelope's ends are opposite quaternions: (3.59) is not defined")
    a, slope, second_derivative = segment.amplitude(tau)[:3, :, None]
    if angle < 1e-12:
        return np.array([start * (1 - a) + end * a, (end - start) * slope, (end - start) * second_derivative])
    value = (start * np.sin(angle * (1 - a)) + end * np.sin(angle * a)) / math.sin(angle)  # (3.59)
    by_a = angle * (end * np.cos(angle * a) - start * np.cos(angle * (1 - a))) / math.sin(angle)
    return np.array([value, by_a * slope, by_a * second_derivative - angle**2 * value * slope**2])


def orientation(env: Array, beta: Array) -> Array:
    """Oscillating SLERP (3.64)-(3.65) as printed: unit quaternions (n, 4) from q_env (n, 4) and beta (n,)."""
    angle = np.arctan2(np.linalg.norm(env[:, 1:], axis=1), env[:, 0])  # (3.65)
    near = angle < 1e-9
    sine = np.where(near, 1.0, np.sin(angle))
    first = np.where(near, 1 - beta, np.sin(angle * (1 - beta)) / sine)
    second = np.where(near, beta, np.sin(angle * beta) / sine)
    return np.array([1.0, 0, 0, 0]) * first[:, None] + env * second[:, None]


def orientation_jet(env: Array, beta: Array) -> Array:
    """Jet (3, n, 4) of (3.64), exact, from the jets of q_env (3, n, 4) and of beta (3, n).

    With w = (1 - cos Theta) / 2 <= 1/2, (3.64) is [cos(beta Theta); sin(beta Theta) / sin(Theta) vec(q_env)], where
    cos(beta Theta) = 2F1(-beta, beta; 1/2; w), the ratio = beta 2F1(1 - beta, 1 + beta; 3/2; w): no 0/0 at rest.
    """
    one = np.zeros_like(beta)
    one[0] = 1
    w, square = (one - env[:, :, 0]) / 2, _mul(beta, beta)
    sums = []
    for shift, term in ((0, one), (1, beta)):
        total = term
        for k in range(100):
            term = _mul(_mul(term, (k + shift) ** 2 * one - square), w) / ((k + 0.5 + shift) * (k + 1))
            total = total + term
        sums.append(total[:, :, None])
    return np.concatenate([sums[0], _mul(sums[1], env[:, :, 1:])], axis=2)


def motion(robot: Robot, segment: Segment, arcs: int, beta_hat: Betas, tau: Vec, differences: bool = False) -> Motion:
    """Whole motion at tau (n,), with beta_hat (3.81) of both ends and beta_ff (3.93).

    Default: analytic derivatives, and (3.32)-(3.33) for the angular ones.  differences=True: sixth-order central
    differences of position and of Q, angular ones from Q' Q^T and Q'' Q^T (not within 0.003/arcs of a knot of A).
    """
    s = np.atleast_1d(np.asarray(tau, dtype=float))
    theta, cusps, duration = plan(robot, segment, arcs)
    seconds = beta_hat[0] * theta**2 * (cusps - 1), beta_hat[1] * theta**2 * (cusps - 1)
    q, dq, ddq = orientation_jet(envelope(segment, arcs, s), beta_ff(s, arcs, seconds))
    p, dp, ddp = translation(robot, segment, arcs, s)
    omega, omega_dot = 2 * product(dq, conjugate(q))[:, 1:], 2 * product(ddq, conjugate(q))[:, 1:]
    if differences:
        step = 0.001 / arcs
        near = [s + j * step for j in range(-3, 4)]
        quaternions = [orientation(envelope(segment, arcs, x)[0], beta_ff(x, arcs, seconds)[0]) for x in near]
        turns = matrix(np.array(quaternions))
        places = np.array([translation(robot, segment, arcs, x)[0] for x in near])
        once, twice = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60, np.array([2, -27, 270, -490, 270, -27, 2]) / 180
        dp, ddp = np.tensordot(once / step, places, 1), np.tensordot(twice / step**2, places, 1)
        products = [np.tensordot(c, turns, 1) @ np.swapaxes(turns[3], 1, 2) for c in (once / step, twice / step**2)]
        skews = [(x - np.swapaxes(x, 1, 2)) / 2 for x in products]
        omega, omega_dot = (np.stack([x[:, 2, 1], x[:, 0, 2], x[:, 1, 0]], axis=-1) for x in skews)
    first, second = 1 / duration, 1 / duration**2
    return Motion(duration, p, dp * first, ddp * second, q, matrix(q), omega * first, omega_dot * second)


def cables(robot: Robot, position: Vec, rotation: Vec) -> Array:
    """Vectors rho_k (3.1) from spool to platform point, (n, 6, 3), m."""
    p, turn = np.asarray(position).reshape(-1, 1, 3), np.asarray(rotation).reshape(-1, 3, 3)
    return p + robot.platform @ np.swapaxes(turn, 1, 2) - robot.base


def jacobian(robot: Robot, position: Vec, rotation: Vec) -> Array:
    """J (3.5), (n, 6, 6), rows [rho_k, arm_k x rho_k], arms from the mass centre; m and m2."""
    rho, turn = cables(robot, position, rotation), np.asarray(rotation).reshape(-1, 3, 3)
    arms = (robot.platform - robot.com) @ np.swapaxes(turn, 1, 2)
    return np.concatenate([rho, np.cross(arms, rho)], axis=2)


def relative_determinant(robot: Robot, position: Vec, rotation: Vec, z0: float) -> Array:
    """Return det J (3.5) over its value at P0 in the reference orientation, (n,); section 3.11.4 wants it positive."""
    reference = np.linalg.det(jacobian(robot, rest_point(robot, z0), np.eye(3)))[0]
    return np.linalg.det(jacobian(robot, position, rotation)) / reference


def wrench(robot: Robot, rotation: Vec, a: Vec = ZERO, w: Vec = ZERO, dw: Vec = ZERO, gravity: float = 9.81) -> Array:
    """Right side of (3.11) with (3.8), (n, 6), over the mass; at rest by default.

    a is the acceleration of the platform frame's origin, w and dw the angular velocity and acceleration, (n, 3) each.
    """
    turn = np.asarray(rotation).reshape(-1, 3, 3)
    a, w, dw = (np.asarray(x, dtype=float).reshape(-1, 3) for x in (a, w, dw))
    offset, inertia = turn @ robot.com, turn @ robot.inertia @ np.swapaxes(turn, 1, 2)
    force = a + np.cross(dw, offset) + np.cross(w, np.cross(w, offset)) - np.array([0.0, 0.0, gravity])
    moment = (inertia @ dw[:, :, None])[:, :, 0] + np.cross(w, (inertia @ w[:, :, None])[:, :, 0])
    return np.concatenate([force, moment / robot.mass], axis=1)


def force_ratios(robot: Robot, position: Vec, rotation: Vec, right: Array | None = None) -> Array:
    """mu = f / (m rho) (3.10), (n, 6) in 1/s2, by (3.11) at each instant with `wrench`; None: at rest, g = 9.81.

    NaN where J is exactly singular.  The MSSM at rest at P0 has g / (6 z0) in every cable.
    """
    sides = wrench(robot, rotation) if right is None else right
    result = np.full((len(sides), 6), np.nan)
    for i, (j, b) in enumerate(zip(jacobian(robot, position, rotation), sides, strict=True)):
        with contextlib.suppress(np.linalg.LinAlgError):
            result[i] = np.linalg.solve(-j.T, b)
    return result


def tensions(robot: Robot, position: Vec, rotation: Vec, ratios: Array) -> Array:
    """Return the actual cable tensions f = m rho mu (3.10), (n, 6), N."""
    return robot.mass * np.linalg.norm(cables(robot, position, rotation), axis=2) * ratios


def ideal_wrench(robot: Robot, position: Vec, rotation: Vec) -> Array:
    """Left side of (3.13) over eta, (6,), for any c_A and c_B: what mu = 1/6 in each cable applies; gives (3.14)."""
    turn, p = np.asarray(rotation), np.asarray(position) + np.asarray(rotation) @ robot.com
    arms = (robot.platform - robot.com) @ turn.T
    c_a, c_b = arms.mean(axis=0), robot.base.mean(axis=0)
    return -np.concatenate([p + c_a - c_b, np.cross(c_a, p) - np.cross(arms, robot.base).mean(axis=0)])


def deviations(robot: Robot, position: Vec, q: Vec, z0: float, gravity: float = 9.81) -> Array:
    """u and v, (2, 6), of mu = eta/6 + u + beta_hat v at an end pose (3.82), (3.89), by solving (3.69) twice.

    The acceleration is (3.70) with (3.77), the angular one beta_hat (g/z0) gamma e: (3.71) without its 2.  Any robot.
    """
    eta, unit = gravity / z0, np.asarray(q, dtype=float)
    acceleration, spin = -eta * (np.asarray(position) - rest_point(robot, z0)), eta * rotation_vector(unit)
    sides = [wrench(robot, matrix(unit), acceleration, ZERO, x * spin, gravity) for x in (0, 1)]
    mu = [force_ratios(robot, position, matrix(unit), side)[0] for side in sides]
    return np.array([mu[0] - eta / 6, mu[1] - mu[0]])


def preferred_beta_hat(u: Array, v: Array) -> float:
    """Best beta_hat (3.91); -1, which turns beta_f into beta_1, where the rotation is nil and any value does."""
    return -float(u @ v) / float(v @ v) if np.linalg.norm(v) > 0 else -1.0


def beta_hat_interval(u: Array, v: Array, eta: float) -> Betas:
    """Interval (3.92), with eta / 6, of the beta_hat that keep mu >= 0; (inf, -inf) when empty."""
    slack = eta / 6 + u
    low = max((-s / x for s, x in zip(slack, v, strict=True) if x > 0), default=-math.inf)
    high = min((-s / x for s, x in zip(slack, v, strict=True) if x < 0), default=math.inf)
    empty = low > high or bool(np.any(slack[v == 0] < 0))
    return (math.inf, -math.inf) if empty else (low, high)


def colliding_pairs(robot: Robot) -> list[tuple[int, int]]:
    """Pairs of cables that share neither spool nor platform point: nine for the MSSM."""
    pairs = [(i, j) for i in range(len(robot.base)) for j in range(i)]
    ends = robot.base, robot.platform
    return [(j, i) for i, j in pairs if all(np.abs(x[i] - x[j]).max() > 1e-9 * np.abs(x).max() for x in ends)]


def between(a: Array, u: Array, b: Array, v: Array) -> tuple[Array, Array]:
    """Vectors d (..., 3) from segment a + s u to b + t v, s and t in [0, 1]: the shortest, and the text's (3.10.2).

    Shortest: the best of the common perpendicular, where both its feet are inside, and of each end with the other
    segment.  The text's: the perpendicular's feet, each slid onto its own segment; parallel segments take the shortest.
    """
    normal = np.cross(u, v)
    parallel = _dot(normal, normal) <= 1e-24 * _dot(u, u) * _dot(v, v)
    squared = np.where(parallel, 1.0, _dot(normal, normal))
    s, t = _dot(np.cross(b - a, v), normal) / squared, _dot(np.cross(b - a, u), normal) / squared
    text = b + np.clip(t, 0, 1) * v - a - np.clip(s, 0, 1) * u
    inside = ~parallel & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    found = [b + np.clip(_dot(a + x * u - b, v) / _dot(v, v), 0, 1) * v - a - x * u for x in (0, 1)]
    found += [b + x * v - a - np.clip(_dot(b + x * v - a, u) / _dot(u, u), 0, 1) * u for x in (0, 1)]
    found.append(np.where(inside, text, np.inf))
    best = np.argmin(np.linalg.norm(found, axis=-1, keepdims=True), axis=0)
    shortest = np.take_along_axis(np.array(found), best[None], axis=0)[0]
    return shortest, np.where(parallel, shortest, text)


def _dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1, keepdims=True)


def cable_vectors(robot: Robot, position: Array, rotation: Array) -> tuple[Array, Array]:
    """`between` for every pair of `colliding_pairs` at n instants, each (n, pairs, 3), m: the shortest, the text's."""
    i, j = np.array(colliding_pairs(robot)).T
    rho = cables(robot, position, rotation)
    return between(robot.base[i], rho[:, i], robot.base[j], rho[:, j])


def cables_cross(vectors: Array) -> Array:
    """Whether (3.94) fails between successive samples, (n - 1, pairs), from vectors d (n, pairs, 3)."""
    return np.sum(vectors[1:] * vectors[:-1], axis=2) <= 0


def platform_edges(robot: Robot) -> Array:
    """s_k1 and s_k2, (2, 6, 3), m: from each platform point to its two neighbours round a flat convex platform."""
    size = np.abs(robot.platform).max()
    gaps = np.linalg.norm(robot.platform[:, None] - robot.platform, axis=2)
    points = robot.platform[[k for k in range(len(gaps)) if np.all(gaps[k, :k] > 1e-9 * size)]]
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0))
    if len(points) < 3 or spread[2] > 1e-9 * size:
        raise ValueError("the platform points must span a plane")
    flat = (points - points.mean(axis=0)) @ axes[:2].T
    ring = points[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))]
    at = [int(np.argmin(np.linalg.norm(ring - p, axis=1))) for p in robot.platform]
    return np.array([[ring[(k + turn) % len(ring)] for k in at] for turn in (-1, 1)]) - robot.platform


def platform_hit(robot: Robot, position: Array, rotation: Array) -> Array:
    """Whether cable k strikes the platform between successive samples (section 3.10.2), (n - 1, 6).

    In the platform frame, nu = -Q^T rho: the line common to the planes of (nu_{i-1}, nu_i) and (s_1, s_2) must be a
    combination of each couple with positive weights, alpha nu_{i-1} + beta nu_i = c s_1 + d s_2, found by Cramer up to
    one factor.  A cable that lies exactly in the platform's plane at one sample counts (alpha or beta zero).
    """
    nu, (s1, s2) = -cables(robot, position, rotation) @ rotation, platform_edges(robot)
    normal = np.cross(s1, s2)
    height = np.sum(nu * normal, axis=2)
    alpha, beta = height[1:], -height[:-1]
    line = alpha[..., None] * nu[:-1] + beta[..., None] * nu[1:]
    c, d = np.sum(np.cross(line, s2) * normal, axis=2), np.sum(np.cross(s1, line) * normal, axis=2)
    ahead = (alpha >= 0) & (beta >= 0) & (c > 0) & (d > 0)
    return ahead | ((alpha <= 0) & (beta <= 0) & (c < 0) & (d < 0))


def end_beta_hats(robot: Robot, segment: Segment) -> Betas:
    """Return the preferred beta_hat (3.91) of both ends."""
    ends = ((segment.p1, segment.q1), (segment.p2, segment.q2))
    first, last = (preferred_beta_hat(*deviations(robot, p, q, segment.z0, segment.gravity)) for p, q in ends)
    return first, last


def check_motion(robot: Robot, segment: Segment, p: int, beta_hat: Betas | None = None, samples: int = 2001) -> dict:
    """The four tests of section 3.11 at evenly spaced samples of one segment with p arcs, SI units.

    beta_hat None takes (3.91).  mu_hat_min is mu over g / (6 z0); det_min the smallest relative det J (negative:
    crossed); cable_distance_min is true; cable_cable is (3.94) as printed, cable_cable_true with the shortest vector.
    """
    tau, duration = np.linspace(0.0, 1.0, samples), plan(robot, segment, p)[2]
    if duration == 0:
        return {"feasible": False, "duration": 0.0}
    m = motion(robot, segment, p, beta_hat or end_beta_hats(robot, segment), tau)
    right = wrench(robot, m.rotation, m.acceleration, m.omega, m.omega_dot, segment.gravity)
    mu = force_ratios(robot, m.position, m.rotation, right)
    force = tensions(robot, m.position, m.rotation, mu)
    shortest, printed = cable_vectors(robot, m.position, m.rotation)
    crossed, hit = bool(cables_cross(printed).any()), bool(platform_hit(robot, m.position, m.rotation).any())
    det_min = float(relative_determinant(robot, m.position, m.rotation, segment.z0).min())
    return {
        "feasible": bool(mu.min() > 0) and det_min > SINGULAR and not crossed and not hit,
        "duration": duration,
        "mu_min": float(mu.min()),
        "mu_hat_min": 6 * segment.z0 / segment.gravity * float(mu.min()),
        "mu_min_tau": float(tau[np.argmin(mu.min(axis=1))]),
        "tension_min": float(force.min()),
        "tension_max": float(force.max()),
        "det_min": det_min,
        "cable_distance_min": float(np.linalg.norm(shortest, axis=2).min()),
        "cable_cable": crossed,
        "cable_cable_true": bool(cables_cross(shortest).any()),
        "cable_platform": hit,
        "z_min": float(m.position[:, 2].min()),
    }


def smallest_arcs(robot: Robot, segment: Segment, max_arcs: int, beta_hat: Betas | None = None, n: int = 1001) -> int:
    """First number of arcs that passes the four tests (section 3.11.1) at n samples, 0 when none up to max_arcs."""
    arcs = range(1, max_arcs + 1)
    return next((p for p in arcs if check_motion(robot, segment, p, beta_hat, n)["feasible"]), 0)
