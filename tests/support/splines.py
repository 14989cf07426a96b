"""Random splines, by SciPy."""

import numpy as np
from scipy.interpolate import CubicSpline, PPoly, make_interp_spline

from cspr_jax.curves.spline import Spline
from cspr_jax.numerics.bounds.piecewise_bounds import bernstein_of_powers
from cspr_jax.robots.model.state import State
from support.motions import states_along


def pieces(times: np.ndarray, values: np.ndarray, degree: int) -> PPoly:
    """Spline through values (n, ...), at rest at both ends."""
    if degree == 3:
        return CubicSpline(times, values, bc_type="clamped")
    still = ([(1, 0.0), (2, 0.0)],) * 2
    columns = [PPoly.from_spline(make_interp_spline(times, column, 5, bc_type=still)) for column in values.T]
    keep = np.flatnonzero(np.diff(columns[0].x) > 0.0)
    knots = np.append(columns[0].x[keep], columns[0].x[-1])
    return PPoly(np.stack([column.c[:, keep] for column in columns], axis=-1), knots)


def spline_of(table: PPoly, turns: bool = True) -> Spline:
    """The motion of a spline of positions, and of quaternions behind them."""
    width = np.diff(table.x)[:, None, None]
    powers = np.moveaxis(table.c[::-1], 0, 1) * width ** np.arange(len(table.c))[:, None]
    coefficients = bernstein_of_powers(powers)
    quaternion = coefficients[..., 3:] if turns else None
    return Spline(table.x, coefficients[..., :3], quaternion, np.asarray(4.0))


def random_spline(
    seed: int, *, middle=(0.0, 0.0, 4.0), size=1.0, tilt=0.1, degree=5, count=6, duration=9.0
) -> tuple[Spline, PPoly]:
    """A motion through random poses about a middle, and its table."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, duration, count + 1)
    times[1:-1] += rng.uniform(-0.3, 0.3, count - 1) * duration / count
    places = np.array(middle) + size * rng.uniform(-1.0, 1.0, (count + 1, 3))
    quaternions = np.concatenate([np.ones((count + 1, 1)), tilt * rng.uniform(-1.0, 1.0, (count + 1, 3))], axis=1)
    table = pieces(times, np.concatenate([places, quaternions], axis=1), degree)
    return spline_of(table), table


def states_of(spline: Spline, times: np.ndarray) -> State:
    """States at times of any shape, s, NumPy."""
    return states_along(spline, np.asarray(times) / float(spline.duration()))
