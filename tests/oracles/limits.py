"""NumPy reference for every criterion of a point mass between samples: printed kinematics, minima zoomed in on.

The slacks are those of the package's documentation: pseudotension and depth over their values at rest, and for the
limits, with the tension over the weight F, the cable length rho and the depth eta:

    (F - F_min) eta,  (F_max - F) eta,  (floor - z) / z0,  (rho_max^2 - rho^2) / (2 z0^2),
    rho^2 (1 - (rho' / v_max)^2) / (2 z0^2),  rho^3 (1 -+ rho'' / a_max) / z0^3

and of the mass centre

    1 - (|v| / v_max)^2,  1 - (|a| / a_max)^2
"""

import dataclasses

import numpy as np

from oracles import point_mass as printed

SAMPLES = 20_001
CANDIDATES, ROUNDS, POINTS = 3, 7, 21


@dataclasses.dataclass(frozen=True)
class Case:
    """A segment with its limits, z down; limits are None or one number a cable, of floor and mass centre one number."""

    base: np.ndarray
    mass: float
    gravity: float
    z0: float
    start: np.ndarray
    end: np.ndarray
    amplitude: printed.Amplitude
    limits: dict


def slacks(case: Case, arcs: int, tau: np.ndarray) -> np.ndarray:
    """Slacks of the criteria at instants, (n_criteria, n): taut, below the spools, then the limits that are given."""
    center = case.base.mean(0) + np.array([0.0, 0.0, case.z0])
    normal = printed.plane_normal(case.base)
    settings = {"z0": case.z0, "normal": normal}
    duration, p, v, a = printed.motion(
        case.start, case.end, center, case.gravity, arcs, tau, case.amplitude, **settings
    )
    if not duration > 0.0:
        return np.full((2, len(tau)), -np.inf)
    eta = printed.height_ratio(case.base, p, center)
    kappa = printed.normalised_pseudotensions(case.base, center, p, a, case.gravity)
    rho, rate = printed.cable_lengths(case.base, p), printed.cable_rates(case.base, p, v)
    second_derivative = printed.cable_accelerations(case.base, p, v, a)
    # Tension over weight times depth: 3 z0 eta F = kappa rho.
    lift, weight = kappa * rho / (3.0 * case.z0), case.mass * case.gravity
    found = [kappa.min(1), eta]
    for name, limit in case.limits.items():
        if limit is None:
            continue
        found.append(
            {
                "tension_min": lambda limit: lift - limit / weight * eta[:, None],
                "tension_max": lambda limit: limit / weight * eta[:, None] - lift,
                "floor": lambda limit: (limit - p[:, 2:]) / case.z0,
                "cable_length_max": lambda limit: (limit**2 - rho**2) / (2.0 * case.z0**2),
                "cable_speed_max": lambda limit: rho**2 * (1.0 - (rate / limit) ** 2) / (2.0 * case.z0**2),
                "cable_acceleration_max": lambda limit: rho**3 * (1.0 - np.abs(second_derivative) / limit) / case.z0**3,
                "speed_max": lambda limit: 1.0 - (v**2).sum(1, keepdims=True) / limit**2,
                "acceleration_max": lambda limit: 1.0 - (a**2).sum(1, keepdims=True) / limit**2,
            }[name](limit).min(1)
        )
    return np.stack(found)


def smallest(case: Case, arcs: int) -> np.ndarray:
    """The smallest slack of each criterion: 20,001 samples, then ever finer ones about the lowest."""
    tau = np.linspace(0.0, 1.0, SAMPLES)
    values = slacks(case, arcs, tau)
    if not np.isfinite(values).all():
        return np.full(len(values), -np.inf)
    lowest, width = values.min(1), 1.0 / (SAMPLES - 1)
    # The lowest local minima of each criterion.
    inner = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    is_valley = (inner[:, 1:-1] <= inner[:, :-2]) & (inner[:, 1:-1] <= inner[:, 2:])
    order = np.argsort(np.where(is_valley, values, np.inf), axis=1)[:, :CANDIDATES]
    places = tau[order]
    for _ in range(ROUNDS):
        fine = np.clip(places[..., None] + width * np.linspace(-1.0, 1.0, POINTS), 0.0, 1.0)
        every = slacks(case, arcs, fine.ravel()).reshape(len(values), *fine.shape)
        own = every[np.arange(len(values)), np.arange(len(values))]
        lowest = np.minimum(lowest, own.min((1, 2)))
        places = np.take_along_axis(fine, own.argmin(2)[..., None], axis=2)[..., 0]
        width *= 2.0 / (POINTS - 1)
    return lowest
