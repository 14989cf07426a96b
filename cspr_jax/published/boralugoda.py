"""Tables 4.1 to 4.3 of Boralugoda's thesis: the test case of the S-model along a straight line."""

from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.config.plan import read_plan
from cspr_jax.config.reading import read_text
from cspr_jax.config.robot import resolve_robot
from cspr_jax.feasibility.point_mass.least_time import least_s_curve
from cspr_jax.feasibility.point_mass.line_faces import Sides, line_faces, sides
from cspr_jax.plans.sequence import Sequence
from cspr_jax.problem import kernel_robot
from cspr_jax.published.chapter_1 import Key
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.trajectories.timed_lines import s_curve

CASE = Path(__file__).with_name("table_4_1.toml")
TIMES = np.round(np.arange(2.9, 4.401, 0.05), 2)
PERIODS = np.round(np.arange(1.8, 2.751, 0.05), 2)
# The printed search has boundaries of so many decimals: with exact ones 45 of the 160 cells differ in the last digit.
DECIMALS = 5
EXACT, ROUNDED = "exact boundaries", "boundaries of five decimals"


class Line(NamedTuple):
    """A boundary of the path acceleration: start + slope * s.

    Fields:
        start: 1/s^2.
        slope: 1/s^2.
    """

    start: float
    slope: float


def _case() -> tuple[Sides, float]:
    # Bounds of the path acceleration of the test case, and the largest one.
    keys = read_plan(read_text(CASE), CASE)
    spec = resolve_robot(keys.robot, CASE, CASE.parent)
    start, end = Sequence(spec, keys, CASE).stops.points(float("nan"))
    largest = float(keys.max_acceleration or np.inf) / float(np.linalg.norm(end - start))
    robot = kernel_robot(spec, keys, CASE, any_cables=True)
    return jax.tree.map(np.asarray, _bounds(robot, start, end, jnp.asarray(largest))), largest


@jax.jit
def _bounds(robot: PointMassRobot, start: Array, end: Array, largest: Array) -> Sides:
    return sides(line_faces(robot, start, end, in_plane=True), largest)


_least = jax.jit(least_s_curve)
_laws = jax.jit(jax.vmap(s_curve))


def _active() -> tuple[Line, Line, float]:
    # (24) and (25): the boundaries that hold the least time back, and the largest path acceleration.
    bounds, largest = _case()
    least = _least(bounds)
    up, down = int(least.up), int(least.down)
    # Braking is seen from the end.
    slope = float(bounds.down_slope[down])
    lower = Line(-float(bounds.down[down]) - slope, slope)
    return Line(float(bounds.up[up]), float(bounds.up_slope[up])), lower, largest


def table_4_1() -> dict[Key, float | None]:
    """All solutions of (28) and (29) for T and p.

    Returns:
        cells; of imaginary solutions the imaginary parts.
    """
    (b, m), (low, slope), _ = _active()
    brake = -(low + slope)
    ratios = np.roots([(m - slope) / 6.0, b + brake + slope / 3.0, -brake - slope / 6.0])
    cells: dict[Key, float | None] = {}
    for ratio in np.sort(ratios.real):
        square = 4.0 / (ratio * (b + m * ratio / 6.0))
        first, part = ("Solution 3", "") if square > 0.0 else ("Solution 1", "imaginary ")
        second = "Solution 4" if square > 0.0 else "Solution 2"
        for row, sign in ((first, -1.0), (second, 1.0)):
            time = sign * float(np.sqrt(abs(square)))
            cells[row, f"{part}T", ""], cells[row, f"{part}p", ""] = time, float(ratio) * time
    return cells


def table_4_2() -> dict[Key, float | None]:
    """The acceleration s'' = slope t + intercept of the least time, range by range.

    Returns:
        cells.
    """
    least = _least(_case()[0])
    time, p = float(least.duration), float(least.duration * least.ratio)
    up, down = 8.0 / (p**2 * time), 8.0 / (time * (time - p) ** 2)
    lines = ((up, 0.0), (-up, up * p), (-down, down * p), (down, -down * time))
    return {
        (row, column, ""): value
        for row, line in zip(RANGES, lines, strict=True)
        for column, value in zip(("slope", "intercept"), line, strict=True)
    }


RANGES = ("0 <= t < 1.120", "1.120 <= t < 2.240", "2.240 <= t < 3.308", "3.308 <= t <= 4.377")


def table_4_3() -> dict[Key, float | None]:
    """The search over p and T: how far the S-model passes the boundaries, and the first node where it does not.

    Returns:
        cells, with exact boundaries and with those of five decimals.
    """
    upper, lower, largest = _active()
    cells: dict[Key, float | None] = {}
    for reading, decimals in ((EXACT, None), (ROUNDED, DECIMALS)):
        high, low = (line if decimals is None else Line(*np.round(line, decimals)) for line in (upper, lower))
        over, under = _passed(high, low, largest)
        for name, values in (("Max_a", over), ("Max_b", under)):
            for i, time in enumerate(TIMES):
                for j, p in enumerate(PERIODS):
                    cells[f"T={time:.2f}", f"{name} p={p:.2f}", reading] = float(values[i, j])
        good = np.argwhere((over < 0.0) & (under < 0.0))
        cells["search", "T", reading] = float(TIMES[good[0, 0]]) if len(good) else None
        cells["search", "p", reading] = float(PERIODS[good[0, 1]]) if len(good) else None
    return cells


def _passed(upper: Line, lower: Line, largest: float) -> tuple[np.ndarray, np.ndarray]:
    # Of each duration and p: by how much s'' is above its boundary at most, and from p on below the other.
    time, p = (grid.ravel() for grid in np.meshgrid(TIMES, PERIODS, indexing="ij"))
    laws = jax.tree.map(np.asarray, _laws(jnp.asarray(p / time)))
    edges = np.concatenate([np.zeros_like(time)[:, None], laws.knots, np.ones_like(time)[:, None]], axis=1)
    spans = np.stack([edges[:, :-1] - laws.origins, edges[:, 1:] - laws.origins])
    s = np.moveaxis(laws.coefficients, -1, 0)  # (4, n, n_pieces) about the origin of each piece
    bend = np.stack([2.0 * s[2], 6.0 * s[3], 0.0 * s[0], 0.0 * s[0]]) / time[:, None] ** 2

    def beyond(line: Line) -> np.ndarray:
        constant = np.zeros((4, 1, 1))
        constant[0] = line.start
        return bend - line.slope * s - constant

    level, shape = (Line(largest, 0.0), Line(-largest, 0.0)), (len(TIMES), len(PERIODS))
    over = np.maximum(_largest(beyond(upper), spans), _largest(beyond(level[0]), spans)).max(1)
    under = np.maximum(_largest(-beyond(lower), spans), _largest(-beyond(level[1]), spans))[:, 2:].max(1)
    return over.reshape(shape), under.reshape(shape)


def _largest(curve: np.ndarray, spans: np.ndarray) -> np.ndarray:
    # Of cubics without a square, (4, n, n_pieces), over their spans, (2, n, n_pieces).
    square = -curve[1] / np.where(curve[3] != 0.0, 3.0 * curve[3], np.inf)
    turn = np.sqrt(np.maximum(square, 0.0))
    places = np.clip(np.stack([spans[0], spans[1], turn, -turn]), spans[0], spans[1])
    return (curve[0] + places * (curve[1] + places**2 * curve[3])).max(0)


_MAX_A = {
    "2.90": "0.3646 0.3449 0.3263 0.3087 0.2920 0.2762 0.2611 0.2469 0.2333 0.2204 "
    "0.2081 0.1963 0.1851 0.1744 0.1641 0.1543 0.1449 0.1359 0.1273 0.1190",
    "2.95": "0.3510 0.3316 0.3133 0.2960 0.2796 0.2641 0.2493 0.2353 0.2219 0.2092 "
    "0.1971 0.1856 0.1745 0.1640 0.1539 0.1443 0.1350 0.1262 0.1177 0.1096",
    "3.00": "0.3378 0.3188 0.3008 0.2838 0.2676 0.2524 0.2378 0.2241 0.2109 0.1984 "
    "0.1865 0.1752 0.1643 0.1540 0.1440 0.1346 0.1255 0.1168 0.1084 0.1004",
    "3.05": "0.3251 0.3064 0.2887 0.2719 0.2561 0.2410 0.2268 0.2132 0.2003 0.1880 "
    "0.1763 0.1651 0.1544 0.1443 0.1345 0.1252 0.1162 0.1077 0.0995 0.0916",
}
_MAX_B = {
    "2.90": "0.81848 0.87695 0.94139 1.01275 1.09217 1.18108 1.28125 1.39496 1.52508 1.67541 "
    "1.851 2.05875 2.30829 2.61356 2.99546 3.48683 4.14241 5.06071 6.43878 8.73639",
    "2.95": "0.74439 0.79677 0.85424 0.91759 0.98774 1.06581 1.15321 1.2517 1.36347 1.49139 "
    "1.63917 1.81179 2.01601 2.26132 2.56142 2.93685 3.41989 4.06435 4.96709 6.3218",
    "3.00": "0.67716 0.72427 0.77577 0.83229 0.89459 0.96356 1.04034 1.12628 1.22312 1.33303 "
    "1.45882 1.60414 1.77388 1.9747 2.21592 2.51102 2.88019 3.35518 3.9889 4.87659",
    "3.05": "0.61594 0.65848 0.70481 0.75547 0.81106 0.87234 0.94018 1.0157 1.10023 1.19548 "
    "1.30359 1.42732 1.57025 1.73721 1.93474 2.17201 2.46227 2.82539 3.29259 3.91592",
}


def _printed() -> dict[Key, str]:
    cells: dict[Key, str] = {}
    for reading in (EXACT, ROUNDED):
        for name, digits, rows in (("Max_a", 4, _MAX_A), ("Max_b", 5, _MAX_B)):
            for time, text in rows.items():
                for p, value in zip(PERIODS, text.split(), strict=True):
                    # Zeros at the end are lost in print.
                    whole = f"{float(value):.{digits}f}"
                    cells[f"T={time}", f"{name} p={p:.2f}", reading] = whole
        cells["search", "T", reading], cells["search", "p", reading] = "4.35", "2.25"
    return cells


PUBLISHED: dict[str, dict[Key, str]] = {
    "4.1": {
        ("Solution 1", "imaginary T", ""): "-0.138",
        ("Solution 1", "imaginary p", ""): "-7.774",
        ("Solution 2", "imaginary T", ""): "0.138",
        ("Solution 2", "imaginary p", ""): "7.774",
        ("Solution 3", "T", ""): "-4.377",
        ("Solution 3", "p", ""): "-2.240",
        ("Solution 4", "T", ""): "4.377",
        ("Solution 4", "p", ""): "2.240",
    },
    "4.2": {},
    "4.3": _printed(),
}
