"""Random segments on general triangles, anywhere, with every limit and amplitude function, against refined samples."""

from functools import partial

import numpy as np
import pytest
from oracles import limits as oracle
from oracles import point_mass as printed

import cspr_jax
from cspr_jax.motion.amplitudes import from_polynomial, named

LIMITS = (
    *("tension_min", "tension_max", "floor", "cable_length_max", "cable_speed_max", "cable_acceleration_max"),
    *("speed_max", "acceleration_max"),
)
MAX_ARCS = 12
# Nearer to zero than this a verdict may be either.
NEAR = 1e-9


def of_polynomial(coefficients, tau):
    curve = np.polynomial.Polynomial(coefficients)
    return tuple(curve.deriv(k)(tau) if k else curve(tau) for k in range(3))


def in_pieces(amplitude, tau):
    # The table of pieces as it is: its own tests compare it with the printed functions.
    knots, origins = np.asarray(amplitude.knots), np.asarray(amplitude.origins)
    piece = np.searchsorted(knots, np.atleast_1d(tau), side="right")
    found = np.zeros((3, piece.size))
    for i, row in enumerate(np.asarray(amplitude.coefficients)):
        for k, values in enumerate(of_polynomial(row, np.atleast_1d(tau) - origins[i])):
            found[k] = np.where(piece == i, values, found[k])
    return tuple(found)


def amplitudes(rng, kind):
    """An amplitude function of ours, and the reference's."""
    if kind == "polynomial":  # overshoots
        bump = np.polynomial.Polynomial([0, 0, 0, 1, -3, 3, -1]) * np.polynomial.Polynomial(rng.normal(size=3) * 6.0)
        curve = (np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]) + bump).coef.tolist()
        return from_polynomial(curve), partial(of_polynomial, curve)
    if kind == "quintic":
        return named("quintic"), printed.quintic
    epsilon = float(rng.uniform(0.05, 0.5))
    mine = named(kind, epsilon)
    return mine, partial(printed.effective, epsilon=epsilon) if kind == "effective" else partial(in_pieces, mine)


def problem(rng, kind, n):
    """A robot in a file's axes, and n cases of the reference's in the kernels' sense, far off too."""
    angles = np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.6, 0.6, 3)
    size = rng.uniform(0.2, 3.0)
    base = np.stack([np.cos(angles), np.sin(angles), rng.uniform(-0.35, 0.35, 3)], 1)[:: rng.choice([-1, 1])] * size
    base -= base.mean(0)
    z0, mass, gravity = rng.uniform(1.2, 2.5) * size, rng.uniform(0.1, 20.0), rng.uniform(1.6, 12.0)
    far = np.array([0.6, 0.6, 0.9]) * z0
    center = np.array([0.0, 0.0, z0])
    starts, ends = center + rng.uniform(-far, far, (2, n, 3))
    starts[::5] = center
    mine, theirs = amplitudes(rng, kind)
    cases = [oracle.Case(base, mass, gravity, z0, a, b, theirs, {}) for a, b in zip(starts, ends, strict=True)]
    return mine, cases


def limited(rng, cases, names):
    """The cases with limits that some motions touch: from what the motions with four arcs ask for."""
    asked = [printed.limits(c.base, c.mass, c.start, c.end, c.z0, c.gravity, 4, c.amplitude, 801) for c in cases]
    middle = {key: float(np.median([a[key] for a in asked])) for key in asked[0]}
    values = {
        "tension_min": np.full(3, max(middle["tension_min"], 0.02 * middle["tension_max"]) * 0.3),
        "tension_max": middle["tension_max"] * rng.uniform(0.9, 1.6, 3),
        "floor": middle["z_max"] * rng.uniform(1.0, 1.15),
        "cable_length_max": middle["length_max"] * rng.uniform(1.0, 1.2, 3),
        "cable_speed_max": middle["speed_max"] * rng.uniform(0.9, 1.6, 3),
        "cable_acceleration_max": middle["cable_acceleration_max"] * rng.uniform(0.9, 1.8, 3),
        "speed_max": middle["mass_centre_speed"] * rng.uniform(0.9, 1.6),
        "acceleration_max": middle["mass_centre_acceleration"] * rng.uniform(0.9, 1.8),
    }
    chosen = {name: values[name] if name in names else None for name in LIMITS}
    return [oracle.Case(*(getattr(c, f) for f in c.__dataclass_fields__ if f != "limits"), chosen) for c in cases]


def answered(mine, cases, offset, z_axis):
    """Answers of the package, asked in axes of a file that lie elsewhere."""
    first, signs = cases[0], np.array([1.0, 1.0, 1.0] if z_axis == "down" else [1.0, -1.0, -1.0])
    robot = cspr_jax.point_mass_robot(
        first.base * signs + offset, mass=first.mass, gravity=first.gravity, z_axis=z_axis
    )
    own = {k: v if k != "floor" or v is None else v * signs[2] + offset[2] for k, v in first.limits.items()}
    starts, ends = (np.array([getattr(c, end) for c in cases]) * signs + offset for end in ("start", "end"))
    given = {"amplitude": mine, "limits": cspr_jax.Limits(**own), "max_arcs": MAX_ARCS}
    return cspr_jax.minimum_arcs(robot, ends, start=starts, z0=first.z0, **given)


def compare(rng, kind, names, n):
    """One robot, n segments: arcs, verdicts, margins, bounds against the reference; the largest error of a margin."""
    mine, cases = problem(rng, kind, n)
    cases = limited(rng, cases, names)
    offset, z_axis = rng.uniform(-800.0, 800.0, 3) * rng.choice([0.0, 1.0]), str(rng.choice(["down", "up"]))
    found, worst = answered(mine, cases, offset, z_axis), 0.0
    # Coordinates of 800 m are typed to 1e-13 m; what comes of that in a slack.
    typed = NEAR + 1e-11 * np.abs(offset).max() / cases[0].z0
    for i, case in enumerate(cases):
        slack = {p: oracle.smallest(case, p) for p in range(1, (int(found.arcs[i]) or MAX_ARCS) + 1)}
        for p, values in slack.items():
            if p != found.arcs[i]:
                assert values.min() < 10.0 * typed, (kind, names, i, p, "feasible, but not found")
        if found.arcs[i]:
            assert slack[int(found.arcs[i])].min() > -10.0 * typed, (kind, names, i, "not feasible")
        values = slack[int(found.tried_arcs[i])]
        if not np.isfinite(values).all():
            continue
        for mine_is, theirs in (
            (found.margin[i], values[:2].min()),
            (found.limit_margin[i], values[2:].min(initial=np.inf)),
        ):
            if np.isfinite(theirs):
                error = abs(mine_is - theirs) / (1.0 + abs(theirs))
                worst = max(worst, error)
                assert mine_is > theirs - 100.0 * typed * (1.0 + abs(theirs)), (kind, names, i, mine_is, theirs)
        assert found.margin_bound[i] <= values[:2].min() + 10.0 * typed * (1.0 + abs(values[0])), (kind, names, i)
    return worst


def test_random_segments():
    """A few of them; the soak has a thousand."""
    assert compare(np.random.default_rng(2), "quintic", LIMITS, 4) < 1e-9


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["quintic", "effective", "effective-c3", "polynomial"])
def test_many_random_segments(kind, seed, record_property):
    """A thousand segments with every limit, and some with few: none differs outside of what its typed digits leave."""
    rng, worst = np.random.default_rng([seed, len(kind)]), []
    names = LIMITS if seed < 3 else ("tension_max", "cable_acceleration_max")
    for _ in range(6):
        worst.append(compare(rng, kind, names, 12))
    record_property("largest error of a margin", float(max(worst)))
    assert max(worst) < 1e-9
