"""Distances by enumeration of features, in NumPy's longest floats: nothing here is shared with the package."""

import itertools

import numpy as np

LONG = np.longdouble


def dot(a, b):
    return (a * b).sum(-1)


def point_to_segment(p, a, u):
    """Distances of points from segments, (n,)."""
    square = dot(u, u)
    part = np.clip(dot(p - a, u) / np.where(square > 0, square, 1), 0, 1)
    between = p - a - part[:, None] * u
    return np.sqrt(dot(between, between))


def segments(a, u, b, v):
    """Distances of segments, (n,): of each end from the other segment, and of the lines' foot."""
    a, u, b, v = (np.asarray(x, LONG) for x in (a, u, b, v))
    ends = [point_to_segment(p, b, v) for p in (a, a + u)] + [point_to_segment(p, a, u) for p in (b, b + v)]
    normal = np.cross(u, v)
    square = dot(normal, normal)
    safe = np.where(square > 0, square, 1)
    s = dot(np.cross(b - a, v), normal) / safe
    # From there to the other segment: where lines are nearly parallel, its own foot would be too far along.
    middle = point_to_segment(a + np.clip(s, 0, 1)[:, None] * u, b, v)
    return np.minimum(np.min(ends, axis=0), np.where(square > 0, middle, np.inf))


def corners(half):
    """Corners of boxes, (n, 8, 3)."""
    return half[:, None] * np.array(list(itertools.product([-1.0, 1.0], repeat=3)))[None]


def chord(a, u, half):
    """Length of the part of each segment inside a box, over that of the segment, (n,); negative outside."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (-half - a) / u, (half - a) / u
    still = u == 0
    first = np.where(still, np.where(np.abs(a) <= half, -np.inf, np.inf), np.minimum(low, high))
    last = np.where(still, np.where(np.abs(a) <= half, np.inf, -np.inf), np.maximum(low, high))
    return np.minimum(last.min(1), 1) - np.maximum(first.max(1), 0)


def outside_box(a, u, half):
    """Distances of segments from boxes around the origin, (n,); 0 where they meet."""
    a, u, half = (np.asarray(x, LONG) for x in (a, u, half))
    found = [np.sqrt(dot(x, x)) for p in (a, a + u) for x in [np.maximum(np.abs(p) - half, 0)]]
    points = corners(half)
    for i, j in itertools.combinations(range(8), 2):
        if bin(i ^ j).count("1") == 1:
            found.append(segments(a, u, points[:, i], points[:, j] - points[:, i]))
    return np.where(chord(a, u, half) >= 0, 0, np.min(found, axis=0))


def outside_triangles(a, u, triangles):
    """Distances of segments (n, 3) from the faces (f, 3, 3) of a polyhedron, (n,), where they do not cross one."""
    a, u, found = np.asarray(a, LONG), np.asarray(u, LONG), []
    for x, y, z in np.asarray(triangles, LONG):
        for p, q in ((x, y), (y, z), (z, x)):
            found.append(segments(a, u, np.broadcast_to(p, a.shape), np.broadcast_to(q - p, a.shape)))
        normal = np.cross(y - x, z - x)
        normal = normal / np.sqrt(dot(normal, normal))
        for end in (a, a + u):
            high = dot(end - x, normal)
            foot = end - high[:, None] * normal
            areas = [dot(np.cross(q - p, foot - p), normal) for p, q in ((x, y), (y, z), (z, x))]
            found.append(np.where(np.min(areas, axis=0) >= 0, np.abs(high), np.inf))
    return np.min(found, axis=0)
