"""Calibration apart from the package: lengths by NumPy, and one dense least squares of all unknowns by SciPy."""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation


def lengths(base, points, positions, rotations):
    """(k, n) lengths of cables from spools (n, 3) to points (n, 3) of a body at k poses."""
    ends = positions[:, None] + np.einsum("kij,nj->kni", rotations, points)
    return np.linalg.norm(ends - base, axis=2)


def point_mass_fit(base, readings, seen):
    """Spools and offsets of a point mass from readings (k, n) and positions (k, 3), all with equal errors.

    Returns spools, offsets, positions, cost and the covariance for errors of variance 1.
    """
    count, n = readings.shape

    def parts(unknowns):
        spools, offsets = unknowns[: 3 * n].reshape(n, 3), unknowns[3 * n : 4 * n]
        return spools, offsets, unknowns[4 * n :].reshape(count, 3)

    def residuals(unknowns):
        spools, offsets, positions = parts(unknowns)
        predicted = np.linalg.norm(positions[:, None] - spools, axis=2) - offsets
        return np.concatenate([(predicted - readings).ravel(), (positions - seen).ravel()])

    def derivatives(unknowns):
        spools, _, positions = parts(unknowns)
        rays = positions[:, None] - spools
        units = rays / np.linalg.norm(rays, axis=2, keepdims=True)
        matrix = np.zeros((count, n, len(unknowns)))
        for i in range(n):
            matrix[:, i, 3 * i : 3 * i + 3] = -units[:, i]
            matrix[:, i, 3 * n + i] = -1.0
        for k in range(count):
            matrix[k, :, 4 * n + 3 * k : 4 * n + 3 * k + 3] = units[k]
        return np.concatenate([matrix.reshape(count * n, -1), np.eye(len(unknowns))[4 * n :]])

    start = np.concatenate([base.ravel(), np.zeros(n), seen.ravel()])
    tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
    best = least_squares(residuals, start, derivatives, method="lm", **tight)
    inverse = np.linalg.inv(best.jac.T @ best.jac)[: 4 * n, : 4 * n]
    return (*parts(best.x), 2.0 * best.cost, inverse)


def body_fit(base, points, readings, positions, rotations):
    """Lengths that the best body on cables has at the poses of readings (k, n), and the cost; all from readings alone.

    The frame is free: only what the readings tell is comparable.
    """
    count, n = readings.shape

    def predicted(unknowns):
        spools, attached = (unknowns[3 * n * i : 3 * n * (i + 1)].reshape(n, 3) for i in range(2))
        offsets, moves = unknowns[6 * n : 7 * n], unknowns[7 * n :].reshape(count, 6)
        turned = Rotation.from_rotvec(moves[:, 3:]).as_matrix() @ rotations
        return lengths(spools, attached, positions + moves[:, :3], turned) - offsets

    start = np.concatenate([base.ravel(), points.ravel(), np.zeros(n + 6 * count)])
    best = least_squares(
        lambda x: (predicted(x) - readings).ravel(), start, method="trf", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    return predicted(best.x), 2.0 * best.cost


def tracked_covariance(spools, positions):
    """Covariance of spools and offsets of a point mass for readings and positions of variance 1.

    The tracker's axes are unknown, and the spools are as near nominal ones as a motion of everything allows: that
    is a constraint on the linear least squares of all unknowns, solved by its bordered normal equations.
    """
    n, count = len(spools), len(positions)
    own, total = 4 * n, 4 * n + 6 + 3 * count
    rows = np.zeros((count, n + 3, total))
    for k, position in enumerate(positions):
        rays = position - spools
        units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        of_pose = slice(own + 6 + 3 * k, own + 9 + 3 * k)
        for i in range(n):
            rows[k, i, 3 * i : 3 * i + 3], rows[k, i, 3 * n + i] = -units[i], -1.0
        rows[k, :n, of_pose] = units
        # Seen positions, in the robot's axes: shifts and turns of the tracker, and the pose itself.
        rows[k, n:, own : own + 3] = rows[k, n:, of_pose] = np.eye(3)
        rows[k, n:, own + 3 : own + 6] = np.cross(np.eye(3), position).T
    matrix = rows.reshape(-1, total)
    motions = np.zeros((6, total))
    motions[:3, : 3 * n] = np.tile(np.eye(3), n)
    motions[3:, : 3 * n] = np.cross(np.eye(3)[:, None], spools).reshape(3, -1)
    border = np.block([[matrix.T @ matrix, motions.T], [motions, np.zeros((6, 6))]])
    return np.linalg.inv(border)[:own, :own]
