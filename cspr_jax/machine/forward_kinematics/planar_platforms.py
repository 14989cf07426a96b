"""All poses of a platform in the plane y = 0 whose three cables have given lengths.

With the position p, the rotation R(phi), and attachment points a_i and base points b_i, |p + R a_i - b_i| = l_i.
Differences of the squares are linear in p: M(phi) p = c(phi), so that D p = P with D = det M and P = adj(M) c, and the
first equation times D^2 is F(phi) = |P + D (R a_1 - b_1)|^2 - D^2 l_1^2 = 0. F is a trigonometric polynomial of degree
3 (its six zeros are those of the known polynomial in tan(phi / 2)), so seven samples give its coefficients exactly.

Its zeros are found by halving intervals of phi. |F| >= |F(m)| - |F'(m)| h - K h^2 / 2 with K = sum k^2 |c_k| discards
an interval, |F'(m)| > K h makes F monotonic in it, and then the signs at its ends decide. So no zero is lost: an
interval that stays open to the end, some 1e-7 rad wide, holds a double zero as far as rounding can tell, and is kept.

At each zero p lies on the line of the better determined row of M and on the first circle: at two points at most, which
also finds poses where M is singular, as where all points lie on two lines. Newton's method on the lengths then verifies
them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Float

DEGREE = 3
# Number of intervals of a full rotation to begin with, and how often those that stay undecided are halved.
INTERVALS, HALVINGS = 16, 22
# Rounding errors of F, over the sum of the absolute values of its coefficients.
ROUNDING = 64.0 * float(np.finfo(float).eps)
BISECTIONS = 12  # steps of the safeguarded Newton method within an interval in which F is monotonic
NEWTON_STEPS = 10  # on the lengths, from a point on the line and the circle
# Squares of distances from a line to a circle, over l^2, by which it may miss and still count as touching.
MISSES = 1e-4
# Intervals of one polynomial that may stay open: where there are more, its zeros are no points as far as rounding can
# tell, and all its intervals are kept as they are.
MOST_OPEN = 48


class Cables(NamedTuple):
    """Three cables in the plane: base (3, 2) and platform points (3, 2), m, in x and z."""

    base: np.ndarray
    platform: np.ndarray


def rotated(angles: Float[np.ndarray, "k"], points: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "k m 2"]:
    """Points in x and z, rotated about y: the matrix of such a rotation takes (x, z) to (cx + sz, cz - sx)."""
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x, z = points[:, 0], points[:, 1]
    return np.stack([cosine * x + sine * z, cosine * z - sine * x], axis=-1)


def candidates(
    cables: Cables, lengths: Float[np.ndarray, "n 3"]
) -> tuple[np.ndarray, Float[np.ndarray, "k 2"], Float[np.ndarray, "k"]]:
    """Poses near all solutions, and others: the index of the lengths of each, its position and its angle."""
    index, angles = _zeros(_coefficients(cables, lengths))
    singular = _singular_angles(cables)
    of_singular = np.repeat(np.arange(len(lengths)), len(singular))
    index = np.concatenate([index, of_singular])
    angles = np.concatenate([angles, np.tile(singular, len(lengths))])
    index, points, angles = _on_lines(cables, lengths, index, angles)
    return index, *_refined(cables, lengths[index], points, angles)


def _linear_system(
    cables: Cables, lengths: np.ndarray, arms: np.ndarray
) -> tuple[Float[np.ndarray, "k 2 2"], Float[np.ndarray, "k 2"], Float[np.ndarray, "k 2"]]:
    # M, c and v = R a_1 - b_1; with u_i = R a_i - b_i the differences are 2 p . (u_i - u_1) = l_i^2 - l_1^2 - ...
    offsets = arms - cables.base
    squares = (offsets**2).sum(2)
    matrix = 2.0 * (offsets[:, 1:] - offsets[:, :1])
    right = (lengths[:, 1:] ** 2 - lengths[:, :1] ** 2) - (squares[:, 1:] - squares[:, :1])
    return matrix, right, offsets[:, 0]


def _coefficients(cables: Cables, lengths: np.ndarray) -> Float[np.ndarray, "n 7"]:
    # Complex coefficients of F for e^(-3 i phi) to e^(3 i phi), from samples at as many angles.
    count = 2 * DEGREE + 1
    angles = 2.0 * np.pi * np.arange(count) / count
    samples = np.stack([_value(cables, lengths, angle) for angle in angles], axis=1)
    orders = np.arange(-DEGREE, DEGREE + 1)
    return samples @ np.exp(-1j * angles[:, None] * orders) / count


def _value(cables: Cables, lengths: np.ndarray, angle: float) -> Float[np.ndarray, "n"]:
    arms = np.broadcast_to(rotated(np.array([angle]), cables.platform), (len(lengths), 3, 2))
    ((a, b), (c, d)), (right, other), (v, w) = (np.moveaxis(x, 0, -1) for x in _linear_system(cables, lengths, arms))
    determinant = a * d - b * c
    x, z = d * right - b * other + determinant * v, a * other - c * right + determinant * w
    return x**2 + z**2 - (determinant * lengths[:, 0]) ** 2


def _evaluated(coefficients: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # F and its derivative.
    value, derivative = coefficients[:, DEGREE].real.copy(), np.zeros(len(angles))
    for k in range(1, DEGREE + 1):
        term = 2.0 * coefficients[:, DEGREE + k] * np.exp(1j * k * angles)
        value += term.real
        derivative -= k * term.imag
    return value, derivative


def _zeros(coefficients: Float[np.ndarray, "n 7"]) -> tuple[np.ndarray, Float[np.ndarray, "k"]]:
    # Zeros of all polynomials: index of the polynomial, and angle.
    sizes = np.abs(coefficients)
    noise = ROUNDING * sizes.sum(1)
    curvature = sizes @ (np.arange(-DEGREE, DEGREE + 1.0) ** 2)
    index = np.repeat(np.arange(len(coefficients)), INTERVALS)
    half = np.pi / INTERVALS
    middle = np.tile(half * (2.0 * np.arange(INTERVALS) + 1.0), len(coefficients))
    found_index, zeros = [], []
    for halving in range(HALVINGS + 1):
        value, derivative = _evaluated(coefficients[index], middle)
        value, derivative = np.abs(value), np.abs(derivative)
        derivative_change = curvature[index] * half
        is_open = value - derivative * half - 0.5 * derivative_change * half <= noise[index]
        is_monotonic = is_open & (derivative > derivative_change)
        if is_monotonic.any():
            of, angles = _bracketed(coefficients, index[is_monotonic], middle[is_monotonic], half, noise)
            found_index.append(of)
            zeros.append(angles)
        is_left = is_open & ~is_monotonic
        index, middle = index[is_left], middle[is_left]
        is_crowded = np.bincount(index, minlength=len(coefficients))[index] > MOST_OPEN
        found_index.append(index[is_crowded])
        zeros.append(middle[is_crowded])
        index, middle = index[~is_crowded], middle[~is_crowded]
        if halving < HALVINGS:
            half *= 0.5
            index, middle = np.repeat(index, 2), np.repeat(middle, 2) + np.tile([-half, half], len(middle))
    return np.concatenate([*found_index, index]), np.concatenate([*zeros, middle])


def _bracketed(
    coefficients: np.ndarray, index: np.ndarray, middle: np.ndarray, half: float, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    # Zeros in intervals in which F is monotonic, by Newton's method within a bracket; an end within rounding counts.
    low, high = middle - half, middle + half
    at_low, at_high = (_evaluated(coefficients[index], ends)[0] for ends in (low, high))
    limit = noise[index]
    has_zero = (np.minimum(at_low, at_high) <= limit) & (np.maximum(at_low, at_high) >= -limit)
    index, low, high, middle = index[has_zero], low[has_zero], high[has_zero], middle[has_zero]
    grows = (at_high > at_low)[has_zero]
    for _ in range(BISECTIONS):
        value, derivative = _evaluated(coefficients[index], middle)
        is_beyond = (value > 0.0) == grows
        high, low = np.where(is_beyond, middle, high), np.where(is_beyond, low, middle)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = middle - value / derivative
        is_inside = (newton >= low) & (newton <= high)
        middle = np.where(is_inside, newton, 0.5 * (low + high))
    return index, middle


def _singular_angles(cables: Cables) -> Float[np.ndarray, "k"]:
    # Angles at which det M = 0, a trigonometric polynomial of degree 1: two at most.
    angles = 2.0 * np.pi * np.arange(3) / 3.0
    offsets = rotated(angles, cables.platform) - cables.base
    (a, b), (c, d) = np.moveaxis(offsets[:, 1:] - offsets[:, :1], 0, -1)
    samples = a * d - b * c
    mean, across = samples.mean(), samples @ np.exp(-1j * angles) * (2.0 / 3.0)
    magnitude = abs(across)
    if magnitude == 0.0 or abs(mean) > magnitude * (1.0 + 1e-9):
        return np.zeros(0)
    half = np.arccos(np.clip(-mean / magnitude, -1.0, 1.0))
    return np.array([half, -half]) - np.angle(across)


def _on_lines(
    cables: Cables, lengths: np.ndarray, index: np.ndarray, angles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # Points of the better determined line on the first circle, whose centre is -v.
    matrix, right, first = _linear_system(cables, lengths[index], rotated(angles, cables.platform))
    norms = np.linalg.norm(matrix, axis=2)
    row, each = norms.argmax(1), np.arange(len(index))
    norm = np.where(norms[each, row] > 0.0, norms[each, row], 1.0)
    normal, distance = matrix[each, row] / norm[:, None], right[each, row] / norm
    distance = distance + (normal * first).sum(1)
    radius = lengths[index, 0]
    square = radius**2 - distance**2
    is_near = (square >= -MISSES * radius**2) & (norms[each, row] > 0.0)
    along = np.stack([-normal[:, 1], normal[:, 0]], axis=1) * np.sqrt(np.maximum(square, 0.0))[:, None]
    foot = distance[:, None] * normal - first
    points = np.concatenate([(foot + along)[is_near], (foot - along)[is_near]])
    return np.tile(index[is_near], 2), points, np.tile(angles[is_near], 2)


def _refined(
    cables: Cables, lengths: np.ndarray, points: np.ndarray, angles: np.ndarray
) -> tuple[Float[np.ndarray, "k 2"], Float[np.ndarray, "k"]]:
    # Newton's method on half the squares of the lengths.
    for _ in range(NEWTON_STEPS):
        arms = rotated(angles, cables.platform)
        rays = points[:, None] + arms - cables.base
        errors = 0.5 * ((rays**2).sum(2) - lengths**2)
        moments = rays[..., 0] * arms[..., 1] - rays[..., 1] * arms[..., 0]
        columns = rays[..., 0], rays[..., 1], moments
        across = [np.cross(columns[(i + 1) % 3], columns[(i + 2) % 3]) for i in range(3)]
        determinant = (columns[0] * across[0]).sum(1)
        safe = np.where(determinant == 0.0, 1.0, determinant)
        steps = [np.where(determinant == 0.0, 0.0, (errors * side).sum(1) / safe) for side in across]
        points, angles = points - np.stack(steps[:2], axis=1), angles - steps[2]
    return points, angles
