"""Point masses on ellipses, in plain NumPy from the balance of forces alone, instant by instant.

Nothing of the package is used, and no harmonics: x = C + a cos(w t) + b sin(w t), z down, needs the force m s with
s = x'' - g, along which a line through the robot meets the plane of the spools at q. The tensions over lengths are the
weights that have their centre at q, times m |s| / |q - x|. Times n depth / (m g), with the depth along the vertical,
they are all 1 at rest below the centroid of n spools: the shares. More cables than needed can choose: their margin is
the largest value of the smallest share, a linear program.

Many ellipses at once: centre, a and b (e, 3), frequencies (e,), all on spools (n, 3); a robot in the plane of x and z
has spools with y = 0, and two cables.
"""

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import block_diag, csr_array, hstack, kron

INSTANTS, AT_A_TIME = 4_001, 16
DOWN = np.array([0.0, 0.0, 1.0])
EXACT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def states(centre, a, b, frequency, angles):
    """Positions, velocities and accelerations at angles w t, (e, k) or (k,): (e, k, 3) each."""
    w, c, s = np.reshape(frequency, (-1, 1)), np.cos(angles), np.sin(angles)
    centre, a, b = (np.atleast_2d(x).T[..., None] for x in (centre, a, b))
    along, across = a * c + b * s, b * c - a * s
    return [np.moveaxis(x, 0, -1) for x in (centre + along, w * across, -(w**2) * along)]


def normal(spools):
    """Normal of the plane of the spools with vertical part 1: its product with a way is the depth that it gains."""
    flat = spools - spools.mean(0)
    columns = [0] if is_planar(spools) else [0, 1]
    slope = np.zeros(3)
    slope[columns] = np.linalg.lstsq(flat[:, columns], flat[:, 2])[0]
    return DOWN - slope


def is_planar(spools):
    return not spools[:, 1].any()


def depths(spools, position):
    """Depths below the plane of the spools along the vertical."""
    return dot(position - spools.mean(0), normal(spools))


def dot(vectors, vector):
    # Faster than @ on components that lie apart, as those of `states` do.
    return sum(vectors[..., k] * vector[k] for k in range(len(vector)))


def shares(spools, gravity, position, acceleration):
    """Shares of as many cables as needed, (..., n): weights of the point q times the force across the plane."""
    columns = [0] if is_planar(spools) else [0, 1]
    weights = np.linalg.inv(np.vstack([spools[:, columns].T, np.ones(len(spools))]))
    push = acceleration - gravity * DOWN
    across, depth = -dot(push, normal(spools)), depths(spools, position)
    q = [across * position[..., k] + depth * push[..., k] for k in columns] + [across]
    rows = [sum(w * x for w, x in zip(row, q, strict=True)) for row in len(spools) / gravity * weights]
    return np.moveaxis(np.stack(rows), 0, -1)


def slacks(spools, gravity, centre, a, b, frequency, angles):
    """Shares of the cables, and the depth over that of the centre, (e, k, n + 1)."""
    position, _, acceleration = states(centre, a, b, frequency, angles)
    ratio = depths(spools, position) / depths(spools, np.atleast_2d(centre))[:, None]
    found = [*np.moveaxis(shares(spools, gravity, position, acceleration), -1, 0), ratio]
    return np.moveaxis(np.stack(found), 0, -1)


def refined(function, first, zooms=4):
    """Least values (e, n) of a function of angles (e, k) with values (e, k, n): at the first ones, and refined."""
    values = function(first)
    sampled = values.min(1)
    width, at = first[0, 1] - first[0, 0], np.take_along_axis(first[..., None], values.argmin(1)[:, None], 1)[:, 0]
    least = sampled
    offsets = np.linspace(-1.0, 1.0, 21)
    for _ in range(zooms):
        near = [at[:, k, None] + width * offsets for k in range(at.shape[1])]
        values = np.stack([function(angles)[..., k] for k, angles in enumerate(near)], -1)
        at = np.stack(
            [np.take_along_axis(near[k], values[..., k].argmin(1)[:, None], 1)[:, 0] for k in range(len(near))], 1
        )
        least, width = np.minimum(least, values.min(1)), 0.1 * width
    return sampled, least


def turn(count, instants=INSTANTS):
    return np.broadcast_to(np.linspace(0.0, 2.0 * np.pi, instants), (count, instants))


def margins(spools, gravity, centre, a, b, frequency, instants=INSTANTS):
    """Margins of ellipses with as many cables as needed, of samples and of refined ones, (e, n + 1) each."""
    centre, a, b = np.broadcast_arrays(*map(np.atleast_2d, (centre, a, b)))
    frequency, parts = np.broadcast_to(frequency, len(centre)), []
    for start in range(0, len(centre), AT_A_TIME):
        part = [x[start : start + AT_A_TIME] for x in (centre, a, b, frequency)]
        parts.append(refined(lambda angles, p=part: slacks(spools, gravity, *p, angles), turn(len(part[0]), instants)))
    return [np.concatenate(x) for x in zip(*parts, strict=True)]


def program_margins(spools, gravity, position, acceleration):
    """Largest values of the smallest share at instants (k, 3), for any number of cables: (k,). One sparse program."""
    n, k = len(spools), len(position)
    rows = [0, 2] if is_planar(spools) else [0, 1, 2]
    balance = block_diag([(spools - x)[:, rows].T for x in position])
    needed = n / gravity * depths(spools, position)[:, None] * (acceleration - gravity * DOWN)
    at_least = hstack([-kron(np.eye(k), np.eye(n)), kron(np.eye(k), np.ones((n, 1)))])
    found = linprog(
        np.concatenate([np.zeros(n * k), -np.ones(k)]),
        A_ub=csr_array(at_least), b_ub=np.zeros(n * k),
        A_eq=csr_array(hstack([balance, csr_array((len(rows) * k, k))])), b_eq=needed[:, rows].ravel(),
        bounds=(None, None), method="highs", options=EXACT,
    )  # fmt: skip
    assert found.status == 0, found.message
    return found.x[n * k :]


def margin_by_programs(spools, gravity, centre, a, b, frequency, instants=201):
    """Margin of one ellipse with any number of cables, by programs refined near the least, and by depths."""

    def values(angles):
        position, _, acceleration = (x[0] for x in states(centre, a, b, frequency, angles[0]))
        ratio = depths(spools, position) / depths(spools, np.asarray(centre))
        return np.stack([program_margins(spools, gravity, position, acceleration), ratio], -1)[None]

    return refined(values, turn(1, instants))[1].min()


def intervals(spools, gravity, centre, a, b, instants=INSTANTS):
    """Feasible frequencies of ellipses by bisection: lower and upper ends (e,), and the largest margin met (e,).

    The force is affine in w^2, so the margin is a concave function of w^2, and its positive part one interval.
    """
    centre, a, b = np.broadcast_arrays(*map(np.atleast_2d, (centre, a, b)))

    def margin(square):
        found = margins(spools, gravity, centre, a, b, np.sqrt(square), instants)[1].min(1)
        return np.where(depths(spools, centre) > 0.0, found, -1.0)

    scale = gravity / np.abs(depths(spools, centre))
    top = scale * np.ones(len(centre))
    for _ in range(60):  # the accelerations of an ellipse with an extent at last point up
        is_good = margin(top) >= 0.0
        if not is_good.any():
            break
        top = np.where(is_good, 2.0 * top, top)
    low, high = np.zeros_like(top), top
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = margin(left), margin(right)
    for _ in range(60):
        is_left = at_left >= at_right
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
        inner = np.where(is_left, high - ratio * (high - low), low + ratio * (high - low))
        value = margin(inner)
        left, right = np.where(is_left, inner, right), np.where(is_left, left, inner)
        at_left, at_right = np.where(is_left, value, at_right), np.where(is_left, at_left, value)
    candidates = np.stack([np.zeros_like(top), left, right, scale])
    heights = np.stack([margin(x) for x in candidates])
    best = np.take_along_axis(candidates, heights.argmax(0)[None], 0)[0]
    ends = []
    for bad, good in ((np.zeros_like(top), best), (top, best)):
        good = np.where(margin(bad) > 0.0, bad, good)
        for _ in range(50):
            middle = 0.5 * (bad + good)
            is_good = margin(middle) > 0.0
            good, bad = np.where(is_good, middle, good), np.where(is_good, bad, middle)
        ends.append(np.sqrt(good))
    return ends[0], ends[1], heights.max(0)
