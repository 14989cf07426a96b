"""Random spools in one plane, and ellipses of all kinds below, beside and above them, z down."""

import numpy as np
from oracles import ellipses as oracle


def flat_spools(rng, count, *, planar=False):
    """Spools in a tilted plane anywhere, (count, 3) m; planar: in the plane of x and z."""
    while True:
        flat = rng.normal(size=(count, 2))
        if planar:
            flat[:, 1] = 0.0
            wide = np.ptp(flat[:, 0]) > 0.5
        else:
            wide = np.linalg.svd(flat - flat.mean(0), compute_uv=False)[1] > 0.4
        if wide:
            slope = rng.normal(scale=0.0 if count == 2 else 0.4, size=2)  # two spools are always level
            spools = np.column_stack([flat, flat @ slope])
            return spools + rng.normal(scale=3.0, size=3) * [1.0, 0.0 if planar else 1.0, 1.0]


def triangle(rng):
    """Three spools in a tilted plane anywhere."""
    return flat_spools(rng, 3)


def ellipses(rng, spools, gravity, count, *, above=True):
    """Centres, axes (count, 3) and frequencies (count,): of any inclination, parallel to the spools, lines, a point."""
    normal, planar = oracle.normal(spools), oracle.is_planar(spools)
    size = np.ptp(spools, axis=0).max()
    fraction = rng.dirichlet(np.ones(len(spools)), count) + rng.normal(scale=0.15, size=(count, len(spools)))
    centre = (fraction / fraction.sum(1, keepdims=True)) @ spools
    low = -0.5 if above else 0.3
    centre[:, 2] += size * rng.uniform(low, 3.0, count)
    axes = rng.normal(size=(2, count, 3)) * size * np.exp(rng.uniform(-3.0, 0.7, (count, 1)))
    if planar:
        axes[..., 1] = 0.0
    kind = np.arange(count) % 8
    parallel = (kind == 0) | (kind == 1) | (kind == 2)
    axes[:, parallel, 2] -= (axes @ normal)[:, parallel]
    axes[1, kind == 3] = 0.0
    axes[0, kind == 4] = 0.0
    axes[1, kind == 5] = 0.6 * axes[0, kind == 5]
    axes[:, (kind == 6) & (np.arange(count) % 16 == 6)] = 0.0
    natural = np.sqrt(gravity / np.abs(oracle.depths(spools, centre)))
    return centre, *axes, natural * np.where(kind == 0, 1.0, np.exp(rng.uniform(-2.0, 0.5, count)))
