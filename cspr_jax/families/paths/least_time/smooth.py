"""Least time along a path with a continuous path acceleration, whose rate of change (path jerk) is limited.

Between nodes u = s'' changes at a constant rate along the path, so that x = s'^2 is quadratic there. The time is a
convex function of x, and the half-planes at the nodes are linear in u and x (Verscheure et al. 2009): an interior-point
method finds the optimum, with one banded matrix for each step. The limit |du/ds| sqrt(x) <= J of the path jerk is not
convex; it is replaced by tangents at an earlier motion, which are stricter, and the optimum gives new tangents.

From rest and to rest, s is the cube of time over the first and the last cell: a constant jerk.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_banded

from cspr_jax.families.paths.least_time.interior_point import interior_point
from cspr_jax.numerics.shapes import Float

BANDWIDTH = 4  # diagonals below and above the main one, with three unknowns for each node
REGULAR = 1e-14  # regularization, added to the diagonal
SMALLEST = 1e-12  # smallest x of the start, over the largest x
# Instead of all half-planes, this many nearest ones bound u on each side, at a motion's x and at a fraction of it.
NEAREST, SLOWER = 6, 0.8
FLAT = 1e-12  # a half-plane with a smaller coefficient of u bounds x alone
MISSED = 1e-9  # other half-planes may be broken by this much
MORE_ROWS = 4  # number of times that half-planes are added: those nearest to a motion that breaks some


class SectionEnds(NamedTuple):
    """Start and end of a section.

    Fields:
        speeds: squared path speeds at the start and at the end, (m/s)^2.
        rests: whether the path acceleration vanishes at the start, and at the end.
    """

    speeds: tuple[float, float]
    rests: tuple[bool, bool]


class NodeHalfPlanes(NamedTuple):
    """Half-planes at the nodes, as in `constraints.HalfPlanes`, and x <= cap.

    Fields:
        u: (n_rows, n_nodes) coefficients of u.
        x: (n_rows, n_nodes) coefficients of x.
        bound: (n_rows, n_nodes) bounds.
        cap: (n_nodes,) largest x, finite.
        width: (n_nodes - 1,) widths of the cells, m.
    """

    u: np.ndarray
    x: np.ndarray
    bound: np.ndarray
    cap: np.ndarray
    width: np.ndarray

    def nearest(self, x: Float[np.ndarray, "n_nodes"]) -> "NodeHalfPlanes":
        """The half-planes nearest to a motion, from either side of u; some may be duplicates."""
        if len(self.u) <= 4 * NEAREST:
            return self
        chosen = []
        over = np.where(np.abs(self.u) > FLAT, self.u, 1.0)
        for fraction in (1.0, SLOWER):
            value = (self.bound - fraction * self.x * x) / over
            for sign in (1.0, -1.0):
                bounds = np.where(sign * self.u > FLAT, sign * value, np.inf)
                chosen.append(np.argpartition(bounds, NEAREST, axis=0)[:NEAREST])
        indices = np.concatenate(chosen)
        u, x, maximum = (np.take_along_axis(side, indices, axis=0) for side in (self.u, self.x, self.bound))
        return NodeHalfPlanes(u, x, maximum, self.cap, self.width)

    def beside(self, others: "NodeHalfPlanes") -> "NodeHalfPlanes":
        """These half-planes, and others beside them."""
        u, x, maximum = (np.concatenate(pair) for pair in zip(self[:3], others[:3], strict=True))
        return NodeHalfPlanes(u, x, maximum, self.cap, self.width)

    def with_cap(
        self,
    ) -> tuple[
        Float[np.ndarray, "n_rows+1 n_nodes"],
        Float[np.ndarray, "n_rows+1 n_nodes"],
        Float[np.ndarray, "n_rows+1 n_nodes"],
    ]:
        """Half-planes with the cap as the last of them."""
        ones = np.ones((1, len(self.cap)))
        pairs = (self.u, 0.0 * ones), (self.x, ones / self.cap), (self.bound, ones)
        u, x, maximum = (np.concatenate(pair) for pair in pairs)
        return u, x, maximum


class Smooth(NamedTuple):
    """Motion on the grid.

    Fields:
        x: (n_nodes,) squared path speeds.
        u: (n_nodes,) path accelerations.
    """

    x: np.ndarray
    u: np.ndarray


def smooth(half_planes: NodeHalfPlanes, ends: SectionEnds, start: Smooth, jerk: float, tries: int = 1) -> Smooth | None:
    """Least time with a continuous path acceleration."""
    near, motion = half_planes.nearest(start.x), start
    for k in range(tries + MORE_ROWS):
        problem = _Problem(near, ends, jerk, motion.x)
        z, _, is_optimal = interior_point(problem, problem.start(motion))
        if not is_optimal:
            return None
        motion = Smooth(z[:, 0], z[:, 1])
        if k >= tries - 1:
            if (half_planes.bound - half_planes.u * motion.u - half_planes.x * motion.x).min() > -MISSED:
                return motion
            near = near.beside(half_planes.nearest(motion.x))
    return None


def below_ramps(
    x: Float[np.ndarray, "n_nodes"], width: Float[np.ndarray, "n_nodes-1"], jerk: float, ends: SectionEnds
) -> Smooth:
    """Motion at most as fast as another one, and as ramps from rest and to rest."""
    s = np.concatenate([[0.0], np.cumsum(width)])
    x = x.copy()
    for distance, rest in zip((s, s[-1] - s), ends.rests, strict=True):
        # Ramp from rest: s = J t^3 / 6.
        x = np.minimum(x, (0.5 * jerk) ** 2 * (6.0 * distance / jerk) ** (4.0 / 3.0)) if rest else x
    x[1:-1] = np.maximum(x[1:-1], SMALLEST * x.max())
    x[[0, -1]] = ends.speeds
    return Smooth(x, 0.5 * np.gradient(x, s))


class _Time(NamedTuple):
    # The duration, its gradient in x, and the diagonals of its Hessian: for x itself, and for x and the next x.
    value: float
    gradient: np.ndarray
    hessian: np.ndarray
    coupling: np.ndarray


def _time(x: np.ndarray, width: np.ndarray, rests: tuple[bool, bool]) -> _Time:
    # Cells take 2 D / (sqrt x0 + sqrt x1); a cell from or to rest takes 3 D / sqrt x. A zero x is fixed.
    moves = x > 0.0
    speed = np.sqrt(np.where(moves, x, 1.0))
    both = np.where(moves, speed, 0.0)[1:] + np.where(moves, speed, 0.0)[:-1]
    scaled = 2.0 * width
    scaled[0], scaled[-1] = ((3.0 if rest else 2.0) * width[end] for end, rest in zip((0, -1), rests, strict=True))
    gradient, hessian = np.zeros(len(x)), np.zeros(len(x))
    for near in (slice(None, -1), slice(1, None)):
        gradient[near] -= 0.5 * scaled / (both**2 * speed[near])
        hessian[near] += 0.5 * scaled * (1.0 / (both**3 * speed[near] ** 2) + 0.5 / (both**2 * speed[near] ** 3))
    coupling = np.where(moves[1:] & moves[:-1], 0.5 * scaled / (both**3 * speed[1:] * speed[:-1]), 0.0)
    return _Time(float(np.sum(scaled / both)), np.where(moves, gradient, 0.0), np.where(moves, hessian, 1.0), coupling)


class _Tangents(NamedTuple):
    # Tangents to the limit of the path jerk: +-(u1 - u0) of_u + (x0 + x1) of_x <= 1, (n_cells,).
    of_u: np.ndarray
    of_x: np.ndarray


def _tangents(x: np.ndarray, width: np.ndarray, jerk: float, rests: tuple[bool, bool]) -> _Tangents:
    middle = 0.5 * (x[1:] + x[:-1])
    # 1 / sqrt x is not below its tangent 1.5 / sqrt m - 0.5 x / m^1.5.
    of_u, of_x = middle**0.5 / (1.5 * jerk * width), 1.0 / (6.0 * middle)
    for end, rest in zip((0, -1), rests, strict=True):
        if rest:  # the jerk in the cell is 2 x^1.5 / 9 D^2
            of_u[end], of_x[end] = 0.0, (4.5 * width[end] ** 2 * jerk) ** (-2.0 / 3.0)
    return _Tangents(of_u, of_x)


class _Problem:
    # Unknowns are x, u, and the multiplier of the equation of the next cell, (n_nodes, 3).
    def __init__(self, half_planes: NodeHalfPlanes, ends: SectionEnds, jerk: float, x: np.ndarray) -> None:
        self.ends, self.width = ends, half_planes.width
        self.tangents = _tangents(x, half_planes.width, jerk, ends.rests)
        self.u, self.x, self.bound = half_planes.with_cap()
        count = len(half_planes.cap)
        self.free = np.ones((count, 3), bool)
        self.free[[0, -1], 0] = False
        self.free[[0, -1], 1] = ~np.array(ends.rests)
        # Equations of the cells: coefficients of x and u at the start, then at the end, (2, 2, n_cells).
        one = np.ones(count - 1)
        self.cells = np.array([[-one, -half_planes.width], [one, -half_planes.width]])
        for end, rest in zip((0, -1), ends.rests, strict=True):
            if rest:  # |u| D is 2/3 x beside a rest
                self.cells[:, :, end] = 0.0
                self.cells[1 + end, :, end] = 2.0 / 3.0, -half_planes.width[end] * (1.0 + 2.0 * end)

    def start(self, motion: Smooth) -> np.ndarray:
        return np.stack([motion.x, np.where(self.free[:, 1], motion.u, 0.0), np.zeros(len(motion.x))], axis=1)

    def value(self, z: np.ndarray) -> float:
        return _time(z[:, 0], self.width, self.ends.rests).value

    def positive(self, z: np.ndarray) -> np.ndarray:
        return z[1:-1, 0]

    def slacks(self, z: np.ndarray) -> np.ndarray:
        slacks = self.bound - self.u * z[:, 1] - self.x * z[:, 0]
        return np.concatenate([slacks.ravel(), *(1.0 - side for side in self._tangent_values(z))])

    def change(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        slacks = -self.u * step[:, 1] - self.x * step[:, 0]
        return np.concatenate([slacks.ravel(), *(-side for side in self._tangent_values(step))])

    def _tangent_values(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        change, total = self.tangents.of_u * np.diff(z[:, 1]), self.tangents.of_x * (z[1:, 0] + z[:-1, 0])
        return total + change, total - change

    def jt_multipliers(self, z: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        of_rows = multipliers[: self.u.size].reshape(self.u.shape)
        gradient = np.zeros_like(z)
        gradient[:, 0], gradient[:, 1] = np.sum(self.x * of_rows, axis=0), np.sum(self.u * of_rows, axis=0)
        up, down = multipliers[self.u.size :].reshape(2, -1)
        total, difference = (up + down) * self.tangents.of_x, (up - down) * self.tangents.of_u
        gradient[:-1, 0] += total
        gradient[1:, 0] += total
        gradient[:-1, 1] -= difference
        gradient[1:, 1] += difference
        return np.where(self.free, gradient, 0.0)

    def residual(self, z: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        residual = self.jt_multipliers(z, multipliers)
        residual[:, 0] += _time(z[:, 0], self.width, self.ends.rests).gradient
        for side, nodes in enumerate((slice(None, -1), slice(1, None))):
            for column in (0, 1):
                residual[nodes, column] += self.cells[side, column] * z[:-1, 2]
                residual[:-1, 2] += self.cells[side, column] * z[nodes, column]
        return np.where(self.free, residual, 0.0)

    def solved(self, z: np.ndarray, weights: np.ndarray, right: np.ndarray) -> np.ndarray:
        # Blocks of the matrix: (row, column) at one node, and (row at one node, column at the next).
        count, of_rows = len(z), weights[: self.u.size].reshape(self.u.shape)
        diagonal, ahead = np.zeros((3, 3, count)), np.zeros((3, 3, count - 1))
        time = _time(z[:, 0], self.width, self.ends.rests)
        diagonal[0, 0] = time.hessian + np.sum(of_rows * self.x**2, axis=0)
        diagonal[0, 1] = np.sum(of_rows * self.x * self.u, axis=0)
        diagonal[1, 1] = np.sum(of_rows * self.u**2, axis=0) + REGULAR
        ahead[0, 0] = time.coupling
        up, down = weights[self.u.size :].reshape(2, -1)
        of_u, of_x = self.tangents
        x_squares, u_squares, mixed = (up + down) * of_x**2, (up + down) * of_u**2, (up - down) * of_x * of_u
        for near, sign in ((slice(None, -1), -1.0), (slice(1, None), 1.0)):
            diagonal[0, 0, near] += x_squares
            diagonal[1, 1, near] += u_squares
            diagonal[0, 1, near] += sign * mixed
        ahead[:2, :2] += np.array([[x_squares, mixed], [-mixed, -u_squares]])
        diagonal[1, 0] = diagonal[0, 1]
        diagonal[2, :2, :-1] = diagonal[:2, 2, :-1] = self.cells[0]
        diagonal[2, 2, -1] = 1.0
        ahead[2, :2] = self.cells[1]
        return solve_banded(
            (BANDWIDTH, BANDWIDTH), self._banded(diagonal, ahead), right.ravel(), check_finite=False
        ).reshape(z.shape)

    def _banded(self, diagonal: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        # Banded matrix in SciPy's form: row 4 + i - j, column j. Rows and columns of fixed unknowns are those of the
        # identity.
        free = self.free.T
        diagonal = np.where(free[:, None] & free[None], diagonal, np.eye(3)[:, :, None])
        ahead = np.where(free[:, None, :-1] & free[None, :, 1:], ahead, 0.0)
        banded = np.zeros((2 * BANDWIDTH + 1, diagonal.shape[2], 3))
        for row in range(3):
            for column in range(3):
                banded[BANDWIDTH + row - column, :, column] += diagonal[row, column]
                if column < 2:  # nothing depends on the multiplier of the cell after next
                    banded[BANDWIDTH + row - column - 3, 1:, column] += ahead[row, column]
                    banded[BANDWIDTH + column + 3 - row, :-1, row] += ahead[row, column]
        return banded.reshape(2 * BANDWIDTH + 1, -1)
