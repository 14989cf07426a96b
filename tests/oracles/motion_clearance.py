"""NumPy reference for clearances in motions: cables with each other, cables and platform with obstacles, m.

An obstacle is a dict of one of these: sphere: centre (3,), radius; capsule: ends (2, 3), radius; box: centre (3,),
half (3,), rotation (3, 3) from its axes to those of the robot. Cables are segments with a diameter, and the platform is
the hull of its points. Solids that meet have the clearance 0 between them, less radii.
"""

import itertools

import numpy as np
import scipy.spatial

from . import clearance

TOUCHING = 1e-12


def hull(points):
    """Triangles (f, 3, 3) of a convex hull, flat ones too, and its half-spaces (h, 4): normal . x + offset <= 0."""
    points = np.asarray(points, float)
    middle = points.mean(0)
    axes = np.linalg.svd(points - middle)[2]
    size = np.ptp(points @ axes.T, axis=0)
    if size[2] > 1e-9 * size[0]:
        solid = scipy.spatial.ConvexHull(points)
        return points[solid.simplices], solid.equations
    flat = scipy.spatial.ConvexHull((points - middle) @ axes[:2].T)
    corners = points[flat.vertices]
    fan = [corners[[0, i, i + 1]] for i in range(1, len(corners) - 1)]
    sides = np.concatenate([flat.equations[:, :2] @ axes[:2], flat.equations[:, 2:]], axis=1)
    sides[:, 3] -= sides[:, :3] @ middle
    planes = [[*(sign * axes[2]), -sign * axes[2] @ middle] for sign in (1.0, -1.0)]
    return np.array(fan), np.concatenate([sides, planes])


def meets(a, u, spaces):
    """Whether segments (k, 3) have a point in all half-spaces, (k,)."""
    along, off = u @ spaces[:, :3].T, a @ spaces[:, :3].T + spaces[:, 3] - TOUCHING
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -off / along
    first = np.where(along < 0.0, crossing, np.where((along == 0.0) & (off > 0.0), np.inf, -np.inf)).max(1)
    last = np.where(along > 0.0, crossing, np.inf).min(1)
    return np.maximum(first, 0.0) <= np.minimum(last, 1.0)


def from_hull(a, u, triangles, spaces):
    """Distances of segments from a hull, (k,)."""
    apart = clearance.outside_triangles(a, u, triangles)
    return np.where(meets(a, u, spaces), 0.0, apart).astype(float)


def cable_pairs(robot):
    """Pairs of cables that share neither a spool nor an attachment."""
    base, body = robot["base_points"], robot["platform_points"]
    pairs = itertools.combinations(range(len(base)), 2)
    return [(i, j) for i, j in pairs if body is not None and (base[i] != base[j]).any() and (body[i] != body[j]).any()]


def between_cables(robot, found):
    """Clearance of each pair of cables, (k, pairs), from the cables of an `any_motion` state."""
    a, u = found.leaving, found.attachments - found.leaving
    apart = [clearance.segments(a[:, i], u[:, i], a[:, j], u[:, j]) for i, j in cable_pairs(robot)]
    return np.stack(apart, axis=1).astype(float) - robot["cable_diameter"]


def cables_and_obstacle(robot, found, obstacle):
    """Clearance of each cable from an obstacle, (k, n)."""
    shape = found.leaving.shape
    a, u = found.leaving.reshape(-1, 3), (found.attachments - found.leaving).reshape(-1, 3)
    if "half" in obstacle:
        rotated = [x @ obstacle["rotation"] for x in (a - obstacle["centre"], u)]
        apart = clearance.outside_box(*rotated, np.broadcast_to(obstacle["half"], a.shape))
    elif "ends" in obstacle:
        start, end = obstacle["ends"]
        apart = clearance.segments(a, u, np.broadcast_to(start, a.shape), np.broadcast_to(end - start, a.shape))
    else:
        apart = clearance.point_to_segment(np.broadcast_to(obstacle["centre"], a.shape), a, u)
    return apart.astype(float).reshape(shape[:2]) - obstacle.get("radius", 0.0) - 0.5 * robot["cable_diameter"]


def platform_and_obstacle(robot, state, obstacle):
    """Clearance of the platform from an obstacle, (k,)."""
    triangles, spaces = hull(np.asarray(robot["platform_points"]) - robot["centre_of_mass"])

    def inside(points):
        """Points in the platform's axes, from the mass centre."""
        return np.einsum("kji,kj->ki", state.rotation, points - state.position)

    if "half" not in obstacle:
        start, end = obstacle.get("ends", [obstacle.get("centre")] * 2)
        a = inside(np.asarray(start))
        return from_hull(a, inside(np.asarray(end)) - a, triangles, spaces) - obstacle["radius"]
    corners = clearance.corners(np.asarray(obstacle["half"])[None])[0] @ obstacle["rotation"].T + obstacle["centre"]
    edges = [(i, j) for i, j in itertools.combinations(range(8), 2) if bin(i ^ j).count("1") == 1]
    apart = [
        from_hull(inside(corners[i]), inside(corners[j]) - inside(corners[i]), triangles, spaces) for i, j in edges
    ]
    half = np.broadcast_to(obstacle["half"], state.position.shape)
    for p, q in {(tuple(t[i]), tuple(t[j])) for t in triangles for i, j in ((0, 1), (1, 2), (2, 0))}:
        a = state.rotation @ np.array(p) + state.position - obstacle["centre"]
        u = state.rotation @ (np.array(q) - np.array(p))
        apart.append(clearance.outside_box(a @ obstacle["rotation"], u @ obstacle["rotation"], half).astype(float))
    return np.min(apart, axis=0)
