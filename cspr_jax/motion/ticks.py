"""Ticks of a clock over consecutive motions: the times k / rate, and the exact end."""

from __future__ import annotations

import numpy as np

from cspr_jax.numerics.shapes import Float

# A tick closer to the end of a segment than this fraction of the time between ticks is that end.
SAME_TICK = 1e-6


def ticks(
    durations: Float[np.ndarray, "n"], rate: float
) -> tuple[Float[np.ndarray, "m"], list[Float[np.ndarray, "k"]]]:
    """Times of the ticks from the start, and the normalised times of those in each of n segments; the end is a tick."""
    starts = np.concatenate([[0.0], np.cumsum(durations)])
    times, taus = [], []
    for i, length in enumerate(durations):
        time = np.arange(*np.ceil(starts[i : i + 2] * rate - SAME_TICK) + 0.0) / rate  # no -0
        tau = np.clip((time - starts[i]) / length, 0.0, 1.0)
        if i == len(durations) - 1:
            time, tau = np.append(time, starts[-1]), np.append(tau, 1.0)
        times.append(time)
        taus.append(tau)
    return np.concatenate(times), taus
