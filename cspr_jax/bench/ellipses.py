"""Ellipses of a point mass: verdicts and frequency intervals a second, beside the same formulas in NumPy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.bench.timing import best
from cspr_jax.build.robots import load_robot
from cspr_jax.families.ellipses import harmonics
from cspr_jax.families.ellipses.harmonics import Ellipse
from cspr_jax.families.ellipses.hull import SpoolHull, hull_of
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.shapes import Float
from cspr_jax.robots.statics.kernel_axes import centred

COUNT = 1 << 20


class EllipseWork(NamedTuple):
    """Random ellipses below the spools of a robot.

    Fields:
        hull: hull of the spools.
        ellipse: vectors of the ellipses, arrays (n, 3) m.
        frequency: (n,) rad/s.
    """

    hull: SpoolHull
    ellipse: Ellipse
    frequency: np.ndarray


def work(count: int) -> EllipseWork:
    """Draw random ellipses."""
    rng, robot = np.random.default_rng(0), load_robot("prototype")
    centre = rng.normal(size=(count, 3)) * [0.08, 0.08, 0.2] + [0.0, 0.0, 2.0]
    axes = rng.normal(size=(2, count, 3)) * [0.3, 0.3, 0.1]
    return EllipseWork(hull_of(centred(robot)[0]), Ellipse(centre, *axes), 2.2 * np.exp(rng.uniform(-0.1, 0.1, count)))


def numpy_margins(case: EllipseWork) -> Float[np.ndarray, "n"]:
    """Margins by NumPy; see `harmonics.least_margin`."""
    constant, tilting, pulling, depth, swing = _numpy_terms(case)
    e = 1.0 - case.frequency**2 * depth / np.asarray(case.hull.gravity)
    harmonic = tilting + e[:, None] * pulling
    slack = (constant - np.hypot(*harmonic)).min(1)
    return np.where(depth > 0.0, np.minimum(slack, 1.0 - swing / depth), -np.inf)


def numpy_intervals(case: EllipseWork) -> Float[np.ndarray, "2 n"]:
    """Ends of the feasible frequencies by NumPy; see `harmonics.frequency_interval`."""
    constant, tilting, pulling, depth, swing = _numpy_terms(case)
    square, mixed, rest = (pulling**2).sum(0), (tilting * pulling).sum(0), constant**2 - (tilting**2).sum(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(mixed**2 + square * rest)
        low, high = ((-mixed - root) / square).max(1), ((-mixed + root) / square).min(1)
        ends = np.sqrt((1.0 - np.stack([np.minimum(high, 1.0), low])) * np.asarray(case.hull.gravity) / depth)
    return np.where((constant > 0.0).all(1) & (depth > swing), ends, np.nan)


def _numpy_terms(case: EllipseWork) -> tuple[np.ndarray, ...]:
    # Return constant, tilting and pulling (..., n, n_edges), depth and swing (n,).
    edges, normal = np.asarray(case.hull.edges), np.asarray(case.hull.normal)
    flat = [vector[:, :2] @ edges.T for vector in case.ellipse]
    depth, *swing = (vector @ normal for vector in case.ellipse)
    constant = 1.0 + flat[0]
    tilting = constant * (np.stack(swing) / depth)[..., None]
    return constant, tilting, np.stack(flat[1:]) - tilting, depth, np.hypot(*swing)


def rates() -> dict[str, dict[str, float]]:
    """Ellipses a second, with conversions from and to NumPy arrays."""
    case = work(COUNT)

    def of_many(function, *items):
        with double_precision():
            return harmonics.of_many(function, case.hull, case.ellipse, *items)

    return {
        "verdicts": {
            "float64": COUNT / best(lambda: of_many(harmonics.least_margin, case.frequency)),
            "numpy": COUNT / best(lambda: numpy_margins(case)),
        },
        "frequencies": {
            "float64": COUNT / best(lambda: of_many(harmonics.frequency_interval)),
            "numpy": COUNT / best(lambda: numpy_intervals(case)),
        },
    }


def lines(measured: dict[str, dict[str, float]]) -> list[str]:
    """Lines for people."""
    rows = [
        f"  {name:12s} float64 {row['float64'] / 1e6:6.1f} M/s, NumPy {row['numpy'] / 1e6:6.1f} M/s"
        for name, row in measured.items()
    ]
    return ["ellipses a second", *rows]
