"""WireX's workspace of IPAnema1Design: its hull along rays, with closed-form tensions and with all tensions.

WireX (github.com/gldkhoward/WireX, MIT) prints volume and surface in its README; robot, limits and method are from its
source text. No external wrench acts. Rays from a centre go through the corners of an octahedron whose triangles are
divided three times; the boundary on each ray is bisected from 12 m down to 0.1 mm, and the ends of the rays span the
hull. A pose is inside if the closed-form tensions, those nearest to the middles of their ranges, keep the limits. Other
tensions may keep them where these do not, so the workspace itself is larger.
"""

from collections.abc import Callable

import jax
import numpy as np

from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.published.chapter_1 import Key
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.robots.tensions.tension_rules import closed_form
from cspr_jax.workspaces.poses import geometry
from cspr_jax.workspaces.requirements import FEASIBLE, required_wrenches, requirement
from cspr_jax.workspaces.search import WorkspaceSearch

SIGNS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
BASE = np.concatenate([np.c_[SIGNS * [2.0, 1.5], np.full(4, z)] for z in (0.0, 2.0)])
PLATFORM = np.tile(np.c_[SIGNS * 0.06, np.zeros(4)], (2, 1))
LOW, HIGH = np.full(8, 1.0), np.full(8, 10.0)
CENTRE = np.array([0.0, 0.0, 1.0])
LONGEST = 12.0
CLOSE = 1e-4
DIVISIONS = 3
FINE = 6
BATCH = 2048
VARIANT = "WireX's hulls of IPAnema1Design"
# Rounded; WireX prints 5.731436529861277 and 17.789244457956457.
PUBLISHED = {("closed form", "volume, m3", VARIANT): "5.7314365", ("closed form", "surface, m2", VARIANT): "17.7892445"}
Inside = Callable[[np.ndarray], np.ndarray]


def hulls() -> dict[Key, float | None]:
    """Volumes and surfaces of the hulls."""
    by_form, by_all = _conditions()
    cells: dict[Key, float | None] = {}
    for name, inside, divisions in (
        ("closed form", by_form, DIVISIONS),
        ("all tensions", by_all, DIVISIONS),
        ("all tensions, fine hull", by_all, FINE),
    ):
        for column, value in zip(("volume, m3", "surface, m2"), hull(inside, divisions), strict=True):
            cells[name, column, VARIANT] = value
    return cells


def hull(inside: Inside, divisions: int) -> tuple[float, float]:
    """Volume and surface of a hull."""
    triangles = _directions(divisions)
    directions, indices = np.unique(triangles.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    low, high = np.zeros(len(directions)), np.full(len(directions), LONGEST)
    radius = high
    while high[0] - low[0] > CLOSE:  # the same on all rays
        holds = inside(CENTRE + radius[:, None] * directions)
        low, high = np.where(holds, radius, low), np.where(holds, high, radius)
        radius = 0.5 * (low + high)
    a, b, c = np.moveaxis((radius[:, None] * directions)[indices.reshape(-1, 3)], 1, 0)
    volume = np.einsum("ni,ni->n", np.cross(a, b), c).sum() / 6.0
    return float(volume), float(0.5 * np.linalg.norm(np.cross(a - b, a - c), axis=1).sum())


def _directions(divisions: int) -> np.ndarray:
    # Return triangles by their corners, (n, 3, 3), counterclockwise as seen from outside.
    octants = np.stack(np.meshgrid(*[[1.0, -1.0]] * 3), axis=-1).reshape(-1, 3)
    order = np.where(octants.prod(1) > 0.0, 1, -1)
    triangles = np.stack([np.diag(signs)[::k] for signs, k in zip(octants, order, strict=True)])
    for _ in range(divisions):
        middles = triangles + np.roll(triangles, -1, axis=1)
        middles /= np.linalg.norm(middles, axis=2, keepdims=True)
        (a, b, c), (ab, bc, ca) = np.moveaxis(triangles, 1, 0), np.moveaxis(middles, 1, 0)
        parts = (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return triangles


def _conditions() -> tuple[Inside, Inside]:
    # Return the conditions for closed-form and for all tensions. Mass and inertia do not matter without a wrench.
    robot, frame = centred(platform_robot(BASE, PLATFORM, mass=1.0, inertia=np.eye(3), z_axis="up"))
    wrenches = required_wrenches(robot, frame, points=np.zeros((1, 6)))
    demand = requirement(robot, FEASIBLE, Limits(tension_min=as_float64(LOW), tension_max=as_float64(HIGH)), wrenches)
    search, upright = WorkspaceSearch(robot, demand), frame.rotated_quaternions(np.array([[1.0, 0.0, 0.0, 0.0]]))
    rule = jax.vmap(lambda matrix: closed_form(matrix, np.zeros(6), LOW, HIGH).is_within)

    def poses(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(frame.inward(positions)), np.tile(upright, (len(positions), 1))

    def by_form(positions: np.ndarray) -> np.ndarray:
        matrices = np.asarray(geometry.wrench_matrices(robot, *poses(positions))) / search.unit[:, None]
        return in_batches(rule, matrices, batch_size=BATCH)

    return by_form, lambda positions: search(*poses(positions)).verdict == 0
