"""Smoothing of samples: the curve of smallest second derivative that stays within their noise."""

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import brentq
from scipy.sparse import block_diag, csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from cspr_jax.config.motions.stamps import CLOSER
from cspr_jax.config.motions.table import MotionTable
from cspr_jax.curves.interpolation import continuous
from cspr_jax.curves.noise import deviation_of
from cspr_jax.errors import InputError

MIN_SAMPLES = 5
# Weights of the second derivative (time in steps) are powers of ten; with the lowest, curves meet all samples.
LOWEST = -8.0
HIGHEST = 24.0
STEPS = 4.0  # increment of the power in the search for its upper bound
POWER_ERROR = 1e-4  # tolerance of the search for the power
REFINEMENTS = 3  # number of iterative refinements: matrices are badly conditioned where weights are large
# A record moves at an end if, with rest assumed there, the squared errors of a polynomial are more than FACTOR times as
# large as without, and the squared second derivatives of the smoothed curve more than COSTS times.
FACTOR = 2.0
COSTS = 1.03
SURE = 4.0  # standard deviations, of the sum of squared errors, that are ascribed to noise
FITS = 1.2  # a polynomial fits samples that it misses by less than this multiple of their noise
SAMPLE_ERROR = 1e-9  # rounding error of samples, as a fraction of the largest
_COUNTS = np.unique(np.geomspace(6.0, 256.0, 20).astype(int))  # numbers of samples from which an end's speed is found
REST, MOVING = (1, 2), ()  # orders of the derivatives that are 0 at an end at rest, and at a moving one


def smoothed(
    table: MotionTable,
    deviation: float,
    *,
    angle: float | None = None,
    interpolation: str | None = None,
    ends: str | None = None,
) -> MotionTable:
    """Replace the samples of a table by those of a smoothing spline, which deviates by as much as they are noisy.

    Among splines with the same end conditions and no larger root-mean-square deviation from the samples, it has the
    smallest mean square of the second derivative (Reinsch, Numerische Mathematik 10, 1967). An end has zero velocity
    and acceleration where the record is at rest or `ends` says so, and is free where the record moves.
    """
    angle = deviation if angle is None else angle
    for key, value in (("smooth", deviation), ("smooth (angle)", angle)):
        if not 0.0 < value < math.inf:
            raise InputError(key, value, "a number > 0, the standard deviation of the noise")
    is_later = np.append(True, np.diff(table.times) > 0.0)
    times, ends = table.times[is_later], ends or table.ends
    kind = interpolation or table.interpolation
    kind = "quintic" if kind == "quintic" else "cubic"
    minimum = MIN_SAMPLES + (kind == "quintic")
    knots = _knots(times)
    if len(knots) < minimum:
        raise InputError("smooth", deviation, f"absent for {len(knots)} samples: must have {minimum} or more")
    groups = [("positions", "m", 1.0, deviation, table.positions[is_later])]
    if table.quaternions is not None:
        groups.append(("orientations", "rad", 2.0, angle, continuous(table.quaternions[is_later])))
    degree = 3 if kind == "cubic" else 5
    fits = [_Fit(times, knots, values, degree, ends == "periodic") for *_, values in groups]
    moving = [
        [ends == "natural"] * 2 if ends else fit.moving(times, amount / factor)
        for fit, (_, _, factor, amount, _) in zip(fits, groups, strict=True)
    ]
    is_told = ends is None
    if ends is None and any(map(any, moving)):
        ends = "natural"  # also true of a spline at rest, whose acceleration is 0 at its end
        if kind == "quintic":
            moving = [[True, True]] * len(groups)
    results, notes = [], [*table.notes]
    for (name, unit, factor, amount, _), fit, moves in zip(groups, fits, moving, strict=True):
        conditions = [MOVING if is_moving else REST for is_moving in moves]
        result, away = fit.smooth(amount / factor, conditions, name, unit, factor)
        results.append(result)
        rms, maximum = math.sqrt(float(np.mean(away**2))) * factor, float(away.max()) * factor
        notes.append(
            f"smoothing moved {name} by {rms:.2g} {unit} in the root mean square, {maximum:.2g} {unit} at most"
        )
        words = [word for word, is_moving in zip(("begin", "end"), moves, strict=True) if is_moving and is_told]
        if words:
            notes.append(
                f"{name} {' and '.join(words)} in motion: smoothing keeps their speed there, as ends = natural"
            )
    quaternions = None
    if len(results) == 2:
        quaternions = results[1] / np.linalg.norm(results[1], axis=1, keepdims=True)
    rates = dict.fromkeys(("velocities", "accelerations", "angular_velocities", "angular_accelerations"))
    samples: dict[str, Any] = {"times": times[knots], "positions": results[0], "quaternions": quaternions, **rates}
    return dataclasses.replace(table, **samples, interpolation=kind, ends=ends, notes=tuple(notes))


class _Fit:
    """Splines with knots at some of the samples, fitted to all of them; times are in steps."""

    def __init__(
        self, times: np.ndarray, knots: np.ndarray, values: np.ndarray, degree: int, is_periodic: bool
    ) -> None:
        self.values, self.degree, self.is_periodic = values, degree, is_periodic
        self.moved = np.ptp(values, axis=0) > 0.0
        steps = (times - times[0]) / float(np.median(np.diff(times)))
        self.steps, self.knots = steps, steps[knots]
        self.sign = 1.0 if values.shape[1] == 3 or float(values[0] @ values[-1]) >= 0.0 else -1.0
        table = _knot_table(self.knots, degree, is_periodic)
        self.design = csr_array(BSpline.design_matrix(steps, table, degree, extrapolate=False))
        self.at_knots = csr_array(BSpline.design_matrix(self.knots, table, degree, extrapolate=False))
        self.derivatives = _derivatives(table, degree, 4 if degree == 5 else 2)
        # Gauss points, at which the squares of second derivatives are summed exactly.
        nodes, weights = np.polynomial.legendre.leggauss(degree - 1)
        width = np.diff(self.knots)[:, None]
        points = (self.knots[:-1, None] + width * (nodes + 1.0) / 2.0).ravel()
        basis = csr_array(BSpline.design_matrix(points, table[2:-2], degree - 2, extrapolate=False))
        roots = diags_array(np.sqrt((width * weights / 2.0).ravel()))
        self.bending = csr_array(roots @ basis @ self.derivatives[2])

    def smooth(
        self, deviation: float, conditions: list, name: str, unit: str, factor: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values at the knots, and distances (n,) of the samples from the curve."""
        values = self.values[:, self.moved]
        if not self.moved.any():
            return self.values[: len(self.knots)].copy(), np.zeros(len(self.values))
        is_free = conditions == [MOVING, MOVING] and not self.is_periodic
        straight = np.stack([np.ones(len(self.steps)), self.steps], axis=1)[:, : 1 + is_free]
        if not (self.is_periodic and self.sign < 0.0):
            line = straight @ np.linalg.lstsq(straight, values, rcond=None)[0]
            maximum = _rms(line - values)
            if maximum <= deviation:
                words = "a straight line" if is_free else "rest at one place"
                allowed = f"less than {factor * maximum:.2g} {unit}, by which {words} misses the {name}"
                raise InputError("smooth", factor * deviation, allowed)
        coefficients = self._smoothest(deviation, conditions, values)
        result, fitted = (np.tile(self.values[:1], (basis.shape[0], 1)) for basis in (self.at_knots, self.design))
        result[:, self.moved], fitted[:, self.moved] = self.at_knots @ coefficients, self.design @ coefficients
        if self.is_periodic:
            result[-1] = self.sign * result[0]
        return result, np.linalg.norm(fitted - self.values, axis=1)

    def moving(self, times: np.ndarray, deviation: float) -> list[bool]:
        """Tell whether the samples move at the start and at the end, so that rest there would be a jolt."""
        may_move = _may_move(times, self.values)
        values = self.values[:, self.moved]
        for k in range(2):
            if may_move[k]:
                free = [MOVING if is_moving else REST for is_moving in may_move]
                rest = [REST if j == k else condition for j, condition in enumerate(free)]
                minimum, maximum = (
                    self._bending(self._weighed(deviation, self._space(each), values)) for each in (free, rest)
                )
                may_move[k] = maximum > COSTS * minimum
        return may_move

    def _smoothest(self, deviation: float, conditions: list, values: np.ndarray) -> np.ndarray:
        # A curve that must come to rest within one step may miss the samples, or bend more than the curve through them:
        # then only its velocity is 0 at its ends.
        smoothest = self._weighed(deviation, self._space(conditions), values)
        relaxed = [condition[:1] for condition in conditions]
        if self.degree == 5 or relaxed.count(REST[:1]) != 2 or self.is_periodic:
            return smoothest
        through = self._solved(LOWEST, self._space(relaxed), values)
        is_within = _rms(self.design @ smoothest - values) <= deviation * (1.0 + POWER_ERROR)
        if is_within and self._bending(smoothest) <= self._bending(through):
            return smoothest
        return self._weighed(deviation, self._space(relaxed), values)

    def _weighed(self, deviation: float, space: csr_array, values: np.ndarray) -> np.ndarray:
        # The largest weight of the second derivative with which the curve misses the samples by the deviation.
        def excess(power: float) -> float:
            return _rms(self.design @ self._solved(power, space, values) - values) - deviation

        if excess(LOWEST) >= 0.0:
            return self._solved(LOWEST, space, values)
        high = LOWEST + STEPS
        while high < HIGHEST and excess(high) < 0.0:
            high += STEPS
        if high >= HIGHEST:
            return self._solved(HIGHEST, space, values)
        return self._solved(float(brentq(excess, high - STEPS, high, xtol=POWER_ERROR)), space, values)

    def _solved(self, power: float, space: csr_array, values: np.ndarray) -> np.ndarray:
        weight, design, bending = 10.0**power, self.design @ space, self.bending @ space
        factors = splu((design.T @ design + weight * (bending.T @ bending)).tocsc(), permc_spec="NATURAL")
        middle = values.mean(axis=0) * (self.sign > 0.0)
        solution = np.zeros((space.shape[1], values.shape[1]))
        for _ in range(REFINEMENTS):
            away = values - middle - design @ solution
            solution += factors.solve(design.T @ away - weight * (bending.T @ (bending @ solution)))
        return space @ solution + middle

    def _bending(self, coefficients: np.ndarray) -> float:
        return float(((self.bending @ coefficients) ** 2).sum())

    def _space(self, conditions: list) -> csr_array:
        # Matrix from free coefficients to all coefficients of the curves that meet the conditions at both ends.
        count = self.design.shape[1]
        if self.is_periodic:
            inner = count - self.degree
            rows, columns = np.arange(count), np.arange(count) % inner
            return csr_array((self.sign ** (rows // inner), (rows, columns)), shape=(count, inner))
        zero = [condition or ((3, 4) if self.degree == 5 else ()) for condition in conditions]
        blocks = [self._end(orders, is_last) for orders, is_last in zip(zero, (False, True), strict=True)]
        inner = count - sum(block.shape[0] for block in blocks)
        return csr_array(block_diag([blocks[0], eye_array(inner), blocks[1]]))

    def _end(self, orders: tuple[int, ...], is_last: bool) -> np.ndarray:
        # Matrix from free coefficients to those next to an end at which derivatives of these orders are 0.
        count = max(orders, default=0) + 1
        free = [k for k in range(count) if k not in orders]
        block = np.zeros((count, len(free)))
        for k in range(count):
            if k in free:
                block[k, free.index(k)] = 1.0
                continue
            derivative = self.derivatives[k]
            weights = derivative[[derivative.shape[0] - 1 if is_last else 0]].toarray()[0]
            weights = weights[::-1][: k + 1] if is_last else weights[: k + 1]
            block[k] = -weights[:k] @ block[:k] / weights[k]
        return block[::-1, ::-1] if is_last else block


def _rms(away: np.ndarray) -> float:
    return math.sqrt(float(np.mean(away**2)))


def _knots(times: np.ndarray) -> np.ndarray:
    # Indices of the samples that become knots; those much closer together than the median step do not.
    minimum, indices = float(np.median(np.diff(times))) / CLOSER, [0]
    if np.diff(times).min() >= minimum:
        return np.arange(len(times))
    for k in range(1, len(times)):
        if times[k] - times[indices[-1]] >= minimum:
            indices.append(k)
    if indices[-1] != len(times) - 1:
        indices[-1] = len(times) - 1
    return np.array(indices)


def _knot_table(knots: np.ndarray, degree: int, is_periodic: bool) -> np.ndarray:
    if not is_periodic:
        return np.concatenate([np.repeat(knots[0], degree), knots, np.repeat(knots[-1], degree)])
    count, period = len(knots) - 1, knots[-1] - knots[0]
    numbers = np.arange(-degree, count + degree + 1)
    return knots[numbers % count] + period * (numbers // count)


def _derivatives(table: np.ndarray, degree: int, orders: int) -> dict[int, csr_array]:
    # Matrices from coefficients to those of derivatives.
    matrices, last = dict[int, csr_array](), csr_array(eye_array(len(table) - degree - 1))
    for order in range(1, orders + 1):
        left = degree - order + 1
        inner = table[order:-order]
        factors = left / (inner[left:] - inner[:-left])
        count = len(factors)
        last = csr_array(diags_array([-factors, factors], offsets=[0, 1], shape=(count, count + 1)) @ last)
        matrices[order] = last
    return matrices


def _may_move(times: np.ndarray, values: np.ndarray) -> list[bool]:
    # Tell, for the start and the end, whether samples move by more than their noise.
    return [_moves(times - times[0], values), _moves(times[-1] - times[::-1], values[::-1])]


def _moves(times: np.ndarray, values: np.ndarray) -> bool:
    # Tell whether a polynomial with a speed at the start fits samples far better than one without, over as many
    # samples as at least one of the two fits within their noise.
    noise, missed = deviation_of(times, values), (0.0, 0.0)
    for count in _COUNTS[: np.searchsorted(_COUNTS, len(times), "right")]:
        powers = (times[:count, None] / times[count - 1]) ** np.arange(5)
        both = [_missed(powers[:, chosen], values[:count]) for chosen in ([0, 1, 2, 3], [0, 2, 3, 4])]
        freedom = (count - 4) * values.shape[1]
        spread = noise**2 * SURE * math.sqrt(2.0 * freedom) + (SAMPLE_ERROR * float(np.abs(values[:count]).max())) ** 2
        if count > _COUNTS[0] and min(both) > FITS**2 * noise**2 * freedom + spread:
            break
        missed = both[1], FACTOR * both[0] + spread
    return missed[0] > missed[1]


def _missed(powers: np.ndarray, values: np.ndarray) -> float:
    return float(np.sum((powers @ np.linalg.lstsq(powers, values, rcond=None)[0] - values) ** 2))
