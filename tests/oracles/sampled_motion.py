"""NumPy reference for motions through samples: splines of positions and of quaternions, states with exact derivatives.

A spline is a polynomial a piece, of degree 2 m - 1 with m values of position and derivatives (a jet) at each sample.
Hermite pieces take the jets as they are; splines solve for them, so that derivatives m to 2 m - 2 are continuous.
Ends: "rest" (the solved derivatives are zero there), "natural" (derivatives m to 2 m - 2 are zero), "periodic".
Quaternions are (w, x, y, z); their spline is normalised. Angular vectors are in fixed axes.
"""

import dataclasses
import math

import numpy as np
import scipy.sparse

JETS = {"cubic": 2, "quintic": 3}


def falling(power, order):
    """Factor of the derivative of a power: power (power - 1) ... (power - order + 1)."""
    return float(math.perm(power, order))


def end_rows(jets):
    """Derivatives of powers of u, at u = 0 and at u = 1: two arrays (2 jets, 2 jets), a row an order."""
    powers = range(2 * jets)
    start = np.array([[falling(k, j) if k == j else 0.0 for k in powers] for j in powers])
    return start, np.array([[falling(k, j) for k in powers] for j in powers])


def unit_piece(jets):
    """Coefficients of a piece on 0 <= u <= 1 from the jets of both ends, (2 jets, 2 jets)."""
    start, end = end_rows(jets)
    return np.linalg.inv(np.concatenate([start[:jets], end[:jets]]))


@dataclasses.dataclass(frozen=True)
class Spline:
    """Polynomials of the time since the start of their piece: knots (n,), coefficients (n - 1, degree + 1, d)."""

    knots: np.ndarray
    coefficients: np.ndarray

    def __call__(self, times, order=0, within=None):
        """Derivatives of one order at times, (k, d); one-sided, in the pieces that hold the times `within`."""
        times = np.asarray(times, float)
        within = times if within is None else np.asarray(within, float)
        piece = np.clip(np.searchsorted(self.knots, within, "right") - 1, 0, len(self.knots) - 2)
        since = (times - self.knots[piece])[:, None]
        total = np.zeros((len(times), self.coefficients.shape[2]))
        for power in range(self.coefficients.shape[1] - 1, order - 1, -1):
            total = total * since + falling(power, order) * self.coefficients[piece, power]
        return total


def hermite(times, jets):
    """Hermite pieces from jets at samples, (n, m, d)."""
    step = np.diff(times)[:, None, None]
    orders = np.arange(jets.shape[1])[None, :, None]
    ends = np.concatenate([step**orders * jets[:-1], step**orders * jets[1:]], axis=1)
    powers = np.arange(2 * jets.shape[1])[None, :, None]
    return Spline(np.asarray(times, float), np.einsum("kj,njd->nkd", unit_piece(jets.shape[1]), ends) / step**powers)


def spline(times, values, interpolation="cubic", ends="rest"):
    """Smooth spline through samples (n, d): cubics with two continuous derivatives, or quintics with four."""
    times, values = np.asarray(times, float), np.asarray(values, float)
    jets, count = JETS[interpolation], len(times)
    turn = 1.0
    if ends == "periodic" and np.linalg.norm(values[-1] + values[0]) < np.linalg.norm(values[-1] - values[0]):
        turn = -1.0  # a quaternion after a whole turn
    solved, higher = range(1, jets), range(jets, 2 * jets - 1)
    pieces = [rows @ unit_piece(jets) for rows in end_rows(jets)]
    unknowns = count * (jets - 1)
    matrix, right, row = scipy.sparse.lil_matrix((unknowns, unknowns)), np.zeros((unknowns, values.shape[1])), 0

    def add(piece, side, order, sign):
        """Add a derivative at one end of a piece to the current row."""
        step = times[piece + 1] - times[piece]
        for end in (0, 1):
            node = piece + end
            for j in range(jets):
                factor = sign * pieces[side][order, end * jets + j] * step ** (j - order)
                if j == 0:
                    right[row] -= factor * values[node]
                else:
                    matrix[row, node * (jets - 1) + j - 1] += factor

    for node in range(1, count - 1):
        for order in higher:
            add(node - 1, 1, order, 1.0)
            add(node, 0, order, -1.0)
            row += 1
    if ends == "periodic":
        for order in solved:
            matrix[row, order - 1], matrix[row, (count - 1) * (jets - 1) + order - 1] = 1.0, -turn
            row += 1
        for order in higher:
            add(count - 2, 1, order, 1.0)
            add(0, 0, order, -turn)
            row += 1
    else:
        for node, piece, side in ((0, 0, 0), (count - 1, count - 2, 1)):
            for order, high in zip(solved, higher, strict=True):
                if ends == "natural":
                    add(piece, side, high, 1.0)
                else:
                    matrix[row, node * (jets - 1) + order - 1] = 1.0
                row += 1
    derivatives = scipy.sparse.linalg.spsolve(matrix.tocsc(), right).reshape(count, jets - 1, -1)
    return hermite(times, np.concatenate([values[:, None], derivatives], axis=1))


def signed(quaternions):
    """Unit quaternions of which each is as near to the one before as its sign allows, (n, 4)."""
    quaternions = quaternions / np.linalg.norm(quaternions, axis=1)[:, None]
    flips = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    quaternions[1:] *= np.where(np.cumsum(flips) % 2 == 1, -1.0, 1.0)[:, None]
    return quaternions


@dataclasses.dataclass(frozen=True)
class State:
    """Motion at n instants: position, velocity, acceleration, omega, alpha (n, 3), rotation (n, 3, 3)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    rotation: np.ndarray
    omega: np.ndarray
    alpha: np.ndarray


def rotations(quaternions):
    """Rotations of quaternions of any norm, (n, 3, 3)."""
    w, x, y, z = quaternions.T
    rows = [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.moveaxis(np.array(rows), 2, 0) / np.sum(quaternions**2, axis=1)[:, None, None]


def conjugate_product(a, b):
    """Vector part of a b*, (n, 3)."""
    return b[:, :1] * a[:, 1:] - a[:, :1] * b[:, 1:] - np.cross(a[:, 1:], b[:, 1:])


@dataclasses.dataclass(frozen=True)
class Motion:
    """Motion of a mass centre, and of a body about it (None: its axes do not turn)."""

    positions: Spline
    quaternions: Spline | None = None

    @property
    def times(self):
        """Start and end, s."""
        return self.positions.knots[0], self.positions.knots[-1]

    def state(self, times):
        """State at times."""
        p, v, a = (self.positions(times, order) for order in range(3))
        if self.quaternions is None:
            still = np.zeros_like(p)
            return State(p, v, a, np.broadcast_to(np.eye(3), (len(p), 3, 3)), still, still)
        q, dq, ddq = (self.quaternions(times, order) for order in range(3))
        square = np.sum(q * q, axis=1)[:, None]
        # q' = (spin + stretch) q / 2: the vector part of 2 q' q* is the spin, whatever the norm does.
        omega = 2.0 * conjugate_product(dq, q) / square
        alpha = 2.0 * conjugate_product(ddq, q) / square - omega * 2.0 * np.sum(q * dq, axis=1)[:, None] / square
        return State(p, v, a, rotations(q), omega, alpha)


def sampled(times, positions, quaternions=None, *, interpolation="cubic", ends="rest", rates=None):
    """Motion through samples; where positions are Hermite pieces, quaternions are a spline of the same degree."""
    if interpolation == "hermite":
        interpolation = ["cubic", "quintic"][rates.shape[1] - 1]
        moved = hermite(times, np.concatenate([positions[:, None], rates], axis=1))
    else:
        moved = spline(times, positions, interpolation, ends)
    return Motion(moved, None if quaternions is None else spline(times, signed(quaternions), interpolation, ends))
