"""Least time along a path with a path acceleration that is continuous, and whose changes take their time.

Between nodes u = s'' changes at a constant rate along the path, so that x = s'^2 is quadratic there. The time is a
convex function of x, and the half-planes at the nodes are linear in u and x (Verscheure et al. 2009): an interior-point
method finds the optimum, with a banded matrix a step. The limit |du/ds| sqrt(x) <= J of the path jerk is not convex; it
is replaced by its tangent from inside at each step.

From rest and to rest, s is the cube of time over the first and the last cell: a constant jerk.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_banded

from cspr_jax.paths.interior_point import interior_point

# Bands below and above the diagonal, with three unknowns a node; what keeps the matrix regular; part of the largest
# squared path speed from which the search starts, at least.
BANDS, REGULAR, LEAST = 4, 1e-14, 1e-4


class Ends(NamedTuple):
    """Start and end of a section.

    Fields:
        speeds: squared path speeds, (m/s)^2.
        rests: whether the path acceleration vanishes too.
    """

    speeds: tuple[float, float]
    rests: tuple[bool, bool]


class NodeRows(NamedTuple):
    """Half-planes at the nodes, as `paths.rows.Rows`: u_share u + x_share x <= most, and x <= cap.

    Fields:
        u: (n_rows, n_nodes).
        x: (n_rows, n_nodes).
        most: (n_rows, n_nodes).
        cap: (n_nodes,) finite.
        width: (n_nodes - 1,) m.
    """

    u: np.ndarray
    x: np.ndarray
    most: np.ndarray
    cap: np.ndarray
    width: np.ndarray

    def with_cap(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Half-planes with the cap as the last one.

        Returns:
            u, x, most, (n_rows + 1, n_nodes) each.
        """
        ones = np.ones((1, len(self.cap)))
        pairs = (self.u, 0.0 * ones), (self.x, ones / self.cap), (self.most, ones)
        u, x, most = (np.concatenate(pair) for pair in pairs)
        return u, x, most


class Smooth(NamedTuple):
    """Optimum on the grid.

    Fields:
        x: (n_nodes,) squared path speeds.
        u: (n_nodes,) path accelerations.
        is_optimal: whether the method converged.
    """

    x: np.ndarray
    u: np.ndarray
    is_optimal: bool


def smooth(rows: NodeRows, ends: Ends, start: tuple[np.ndarray, np.ndarray], jerk: float = np.inf) -> Smooth:
    """Least time with a continuous path acceleration.

    Args:
        ends: speeds, and whether it rests there.
        start: x and u at the nodes from which the search begins, (n_nodes,) each.
        jerk: largest size of s''', m/s^3.

    Returns:
        the optimum; where there is none, what was reached.
    """
    problem = _Problem(rows, ends, jerk)
    z, _, is_optimal = interior_point(problem, problem.start(*start))
    return Smooth(z[:, 0], z[:, 1], is_optimal)


class _Time(NamedTuple):
    # The duration, its gradient in x, and the bands of its Hessian: of x with itself, and with the next x.
    value: float
    gradient: np.ndarray
    bend: np.ndarray
    coupling: np.ndarray


def _time(x: np.ndarray, width: np.ndarray, rests: tuple[bool, bool]) -> _Time:
    # Cells take 2 D / (sqrt x0 + sqrt x1), one at rest 3 D / sqrt x. An x of zero is fixed.
    moves = x > 0.0
    speed = np.sqrt(np.where(moves, x, 1.0))
    both = np.where(moves, speed, 0.0)[1:] + np.where(moves, speed, 0.0)[:-1]
    scaled = 2.0 * width
    scaled[0], scaled[-1] = ((3.0 if rest else 2.0) * width[end] for end, rest in zip((0, -1), rests, strict=True))
    gradient, bend = np.zeros(len(x)), np.zeros(len(x))
    for near in (slice(None, -1), slice(1, None)):
        gradient[near] -= 0.5 * scaled / (both**2 * speed[near])
        bend[near] += 0.5 * scaled * (1.0 / (both**3 * speed[near] ** 2) + 0.5 / (both**2 * speed[near] ** 3))
    coupling = np.where(moves[1:] & moves[:-1], 0.5 * scaled / (both**3 * speed[1:] * speed[:-1]), 0.0)
    return _Time(float(np.sum(scaled / both)), np.where(moves, gradient, 0.0), np.where(moves, bend, 1.0), coupling)


class _Jerk(NamedTuple):
    # Tangents of the limit of the path jerk: +-(u1 - u0) share + (x0 + x1) level <= most, (n_cells,).
    share: np.ndarray
    level: np.ndarray
    most: np.ndarray


class _Problem:
    # Unknowns are x, u, and the multiplier of the equation of the cell that follows, (n_nodes, 3).
    def __init__(self, rows: NodeRows, ends: Ends, jerk: float) -> None:
        self.ends, self.jerk, self.width = ends, jerk, rows.width
        self.u, self.x, self.most = rows.with_cap()
        count = len(rows.cap)
        self.free = np.ones((count, 3), bool)
        self.free[[0, -1], 0] = False
        self.free[[0, -1], 1] = ~np.array(ends.rests)
        # Equations of the cells: shares of x and u at the start, then at the end, (2, 2, n_cells).
        one = np.ones(count - 1)
        self.cells = np.array([[-one, -rows.width], [one, -rows.width]])
        for end, rest in zip((0, -1), ends.rests, strict=True):
            if rest:  # u D is 2/3 x towards rest
                self.cells[:, :, end] = 0.0
                self.cells[1 + end, :, end] = 2.0 / 3.0, -rows.width[end] * (1.0 + 2.0 * end)

    def start(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        x = np.maximum(x, LEAST * x.max())
        x[[0, -1]] = self.ends.speeds
        return np.stack([x, np.where(self.free[:, 1], u, 0.0), np.zeros(len(x))], axis=1)

    def value(self, z: np.ndarray) -> float:
        return _time(z[:, 0], self.width, self.ends.rests).value

    def positive(self, z: np.ndarray) -> np.ndarray:
        return z[1:-1, 0]

    def slacks(self, z: np.ndarray) -> np.ndarray:
        slacks = self.most - self.u * z[:, 1] - self.x * z[:, 0]
        tangents = self._tangents(z)
        if tangents is None:
            return slacks.ravel()
        return np.concatenate([slacks.ravel(), *(tangents.most - side for side in self._turned(tangents, z))])

    def change(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        slacks = -self.u * step[:, 1] - self.x * step[:, 0]
        tangents = self._tangents(z)
        if tangents is None:
            return slacks.ravel()
        return np.concatenate([slacks.ravel(), *(-side for side in self._turned(tangents, step))])

    def _tangents(self, z: np.ndarray) -> _Jerk | None:
        if not np.isfinite(self.jerk):
            return None
        middle = 0.5 * (z[1:, 0] + z[:-1, 0])
        share, level, most = 1.0 / (self.jerk * self.width), 0.25 * middle**-1.5, 1.5 * middle**-0.5
        for end, rest in zip((0, -1), self.ends.rests, strict=True):
            if rest:  # the jerk of the cell is 2 x^1.5 / 9 D^2
                largest = (4.5 * self.width[end] ** 2 * self.jerk) ** (2.0 / 3.0)
                share[end], level[end], most[end] = 0.0, 1.0 / largest, 1.0
        return _Jerk(share, level, most)

    @staticmethod
    def _turned(tangents: _Jerk, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        change, total = tangents.share * np.diff(z[:, 1]), tangents.level * (z[1:, 0] + z[:-1, 0])
        return total + change, total - change

    def pushed(self, z: np.ndarray, pressures: np.ndarray) -> np.ndarray:
        of_rows = pressures[: self.u.size].reshape(self.u.shape)
        pushed = np.zeros_like(z)
        pushed[:, 0], pushed[:, 1] = np.sum(self.x * of_rows, axis=0), np.sum(self.u * of_rows, axis=0)
        tangents = self._tangents(z)
        if tangents is not None:
            up, down = pressures[self.u.size :].reshape(2, -1)
            total, difference = (up + down) * tangents.level, (up - down) * tangents.share
            pushed[:-1, 0] += total
            pushed[1:, 0] += total
            pushed[:-1, 1] -= difference
            pushed[1:, 1] += difference
        return np.where(self.free, pushed, 0.0)

    def residual(self, z: np.ndarray, pressures: np.ndarray) -> np.ndarray:
        residual = self.pushed(z, pressures)
        residual[:, 0] += _time(z[:, 0], self.width, self.ends.rests).gradient
        for side, nodes in enumerate((slice(None, -1), slice(1, None))):
            for column in (0, 1):
                residual[nodes, column] += self.cells[side, column] * z[:-1, 2]
                residual[:-1, 2] += self.cells[side, column] * z[nodes, column]
        return np.where(self.free, residual, 0.0)

    def solved(self, z: np.ndarray, weights: np.ndarray, right: np.ndarray) -> np.ndarray:
        # Matrix of neighbouring nodes: (row, column) of one node, and (row of one, column of the next).
        count, of_rows = len(z), weights[: self.u.size].reshape(self.u.shape)
        own, next_ = np.zeros((3, 3, count)), np.zeros((3, 3, count - 1))
        time = _time(z[:, 0], self.width, self.ends.rests)
        own[0, 0] = time.bend + np.sum(of_rows * self.x**2, axis=0)
        own[0, 1] = np.sum(of_rows * self.x * self.u, axis=0)
        own[1, 1] = np.sum(of_rows * self.u**2, axis=0) + REGULAR
        next_[0, 0] = time.coupling
        tangents = self._tangents(z)
        if tangents is not None:
            up, down = weights[self.u.size :].reshape(2, -1)
            of_level, of_share = (up + down) * tangents.level**2, (up + down) * tangents.share**2
            mixed = (up - down) * tangents.level * tangents.share
            for near, sign in ((slice(None, -1), -1.0), (slice(1, None), 1.0)):
                own[0, 0, near] += of_level
                own[1, 1, near] += of_share
                own[0, 1, near] += sign * mixed
            next_[:2, :2] += np.array([[of_level, mixed], [-mixed, -of_share]])
        own[1, 0] = own[0, 1]
        own[2, :2, :-1] = own[:2, 2, :-1] = self.cells[0]
        own[2, 2, -1] = 1.0
        next_[2, :2] = self.cells[1]
        return solve_banded((BANDS, BANDS), self._bands(own, next_), right.ravel(), check_finite=False).reshape(z.shape)

    def _bands(self, own: np.ndarray, next_: np.ndarray) -> np.ndarray:
        # Bands as SciPy takes them: row 4 + i - j, column j. Rows and columns of fixed unknowns are those of 1.
        free = self.free.T
        own = np.where(free[:, None] & free[None], own, np.eye(3)[:, :, None])
        next_ = np.where(free[:, None, :-1] & free[None, :, 1:], next_, 0.0)
        bands = np.zeros((2 * BANDS + 1, own.shape[2], 3))
        for row in range(3):
            for column in range(3):
                bands[BANDS + row - column, :, column] += own[row, column]
                if column < 2:  # nothing depends on the multiplier of the cell after next
                    bands[BANDS + row - column - 3, 1:, column] += next_[row, column]
                    bands[BANDS + column + 3 - row, :-1, row] += next_[row, column]
        return bands.reshape(2 * BANDS + 1, -1)
