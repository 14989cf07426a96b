"""Bounds of clearances over whole cells, beside dense samples by an oracle that shares nothing with the package."""

import numpy as np
import pytest
from oracles import clearance as oracle
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cspr_jax.numerics.elementary import double_precision
from cspr_jax.robots.cables import with_cables
from cspr_jax.robots.contacts.clearance import clearances, scene
from cspr_jax.robots.model.platform import platform_robot
from cspr_jax.robots.model.pulleys import exits
from cspr_jax.robots.model.shapes import Box, Cylinder, Sphere, hull
from cspr_jax.workspaces.cells.contact_cells import clearance_bounds
from cspr_jax.workspaces.cells.shifts import shifts

N_CABLES = 8


class Drawn:
    """A random robot among a sphere, a cylinder and a box, z down, and an orientation."""

    def __init__(self, rng, body, pulley_radius=0.0):
        # Cables lead outward from the corners of the platform.
        self.house = np.array([0.02, -0.01, 0.03]), np.array([0.25, 0.3, 0.2])
        signs = oracle.corners(np.ones((1, 3)))[0]
        base = np.c_[signs[:, :2] * rng.uniform(1.5, 3.0, (N_CABLES, 2)), rng.uniform(-3.0, -1.0, N_CABLES)]
        smaller = 1.0 if body == "box" else rng.uniform(0.7, 1.0, (N_CABLES, 3))
        self.points = self.house[0] + signs * smaller * self.house[1]
        robot = platform_robot(base, self.points, mass=2.0, inertia=np.eye(3))
        self.robot = with_cables(robot, pulley_radius=pulley_radius) if pulley_radius else robot
        self.base, self.radius, self.body = base, pulley_radius, body
        self.turn = Rotation.from_rotvec(rng.normal(0.0, 0.15, 3))
        self.quaternion = self.turn.as_quat(scalar_first=True)
        self.ball = rng.uniform(-1.5, 1.5, 3), rng.uniform(0.05, 0.2)
        self.rod = rng.uniform(-1.5, 1.5, 3) + rng.uniform(-0.3, 0.3, (2, 3)), rng.uniform(0.02, 0.1)
        self.block = rng.uniform(-1.5, 1.5, 3), rng.uniform(0.05, 0.2, 3), Rotation.from_rotvec(rng.normal(size=3))
        self.diameters = rng.uniform(0.0, 0.04, N_CABLES)
        shapes = {"none": None, "hull": hull(self.points, name="h"), "box": Box(*self.house, np.eye(3))}
        centre, half, turn = self.block
        obstacles = Sphere(*self.ball), Cylinder(*self.rod[0], self.rod[1]), Box(centre, half, turn.as_matrix())
        self.scene = scene(self.robot, diameter=self.diameters, obstacles=obstacles, body=shapes[body])

    def exits(self, positions):
        """Points at which cables leave, (n, n_cables, 3)."""
        targets = positions[:, None] + self.turn.apply(self.points)
        base = np.broadcast_to(self.base, targets.shape)
        if not self.radius:
            return base
        up = np.broadcast_to([0.0, 0.0, -1.0], targets.shape)
        return np.asarray(exits(base, up, np.full(targets.shape[:2], self.radius), targets).point)

    def bounds(self, positions, half):
        with double_precision():
            turns = np.tile(self.quaternion, (len(positions), 1))
            moved = shifts(self.robot, positions, turns, np.linalg.norm(half, axis=1))
            moves = np.broadcast_to(moved.exits[:, None], (len(positions), N_CABLES))
            place = positions, half, self.exits(positions), moves
            return clearance_bounds(self.robot, self.scene, self.quaternion, *place)

    def distance(self, positions):
        """Least distance of all that can meet, (n,), 0 or less where two meet; not of platform and box."""
        leaving, turn = self.exits(positions), self.turn.as_matrix()
        ends, wide = positions[:, None] + self.points @ turn.T, np.zeros_like(positions)
        rays, found = leaving - ends, []
        centre, half, block_turn = self.block
        for i in range(N_CABLES):
            thick, start, ray = 0.5 * self.diameters[i], ends[:, i], rays[:, i]
            found += [
                oracle.segments(start, ray, ends[:, j], rays[:, j]) - thick - 0.5 * self.diameters[j] for j in range(i)
            ]
            found.append(oracle.point_to_segment(self.ball[0] + wide, start, ray) - self.ball[1] - thick)
            (first, last), radius = self.rod
            found.append(oracle.segments(first + wide, last - first + wide, start, ray) - radius - thick)
            local = (start - centre) @ block_turn.as_matrix(), ray @ block_turn.as_matrix()
            found.append(oracle.outside_box(*local, half + wide) - thick)
            if self.body != "none":
                length = np.linalg.norm(ray, axis=1)[:, None]
                part = self.scene.leave / length
                found.append(self.from_body(self.points[i] + part * ray @ turn, (1.0 - part) * ray @ turn) - thick)
        if self.body != "none":
            (first, last), radius = self.rod
            found.append(self.from_body((self.ball[0] - positions) @ turn, wide) - self.ball[1])
            found.append(self.from_body((first - positions) @ turn, (last - first) @ turn + wide) - radius)
        return np.min(found, axis=0).astype(float)

    def from_body(self, start, ray):
        """Distance of segments from the platform, in its axes, 0 where they meet."""
        if self.body == "box":
            middle, half = self.house
            return oracle.outside_box(start - middle, ray, half + np.zeros_like(start))
        solid = ConvexHull(self.points)
        far = oracle.outside_triangles(start, ray, self.points[solid.simplices])
        points = start[:, None] + np.linspace(0, 1, 101)[None, :, None] * ray[:, None]
        depth = (points @ solid.equations[:, :3].T + solid.equations[:, 3]).max(2).min(1)
        return np.where(depth <= 0.0, 0.0, far)


def check(rng, body, cells, samples, pulley_radius=0.0):
    """Cells of a random robot beside samples: how many are proved free, and how many samples find free."""
    drawn = Drawn(rng, body, pulley_radius)
    positions = rng.uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 1.0], (cells, 3))
    half = 10.0 ** rng.uniform(-2.5, -0.7, (cells, 1)) * rng.uniform(0.0, 1.0, (cells, 3))
    low, high = drawn.bounds(positions, half)
    corners = oracle.corners(np.ones((1, 3)))[0]
    steps = np.concatenate([np.tile(corners, (cells, 1, 1)), rng.uniform(-1.0, 1.0, (cells, samples, 3))], axis=1)
    spots = (positions[:, None] + steps * half[:, None]).reshape(-1, 3)
    far = drawn.distance(spots)
    nearer = far
    if body != "none":
        # Of platform and box the sign alone is that of the distance, which is no smaller.
        with double_precision():
            turns = np.tile(drawn.quaternion, (len(spots), 1))
            found = clearances(drawn.scene, spots, turns, ends=drawn.exits(spots) if pulley_radius else None)
        nearer, far = np.minimum(far, found.obstacles), np.where(found.obstacles <= 0.0, np.minimum(far, 0.0), far)
    far, nearer = far.reshape(cells, -1), nearer.reshape(cells, -1).max(1)
    assert (low <= far.min(1) + 1e-9).all()
    # The oracle knows no depths.
    assert ((high >= nearer - 1e-9) | (nearer <= 0.0)).all()
    assert not ((high < 0.0) & (far > 0.0).any(1)).any()
    return (low > 0.0).sum(), (far > 0.0).all(1).sum(), (high < 0.0).sum(), (far <= 0.0).all(1).sum()


@pytest.mark.ci("hull-0.0-2-6", "none-0.05-2-6")
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("body", "pulley_radius", "robots", "samples"),
    [
        ("box", 0.0, 2, 6),
        ("none", 0.05, 2, 6),
        ("hull", 0.0, 2, 6),
        pytest.param("none", 0.0, 30, 100, marks=pytest.mark.soak),
        pytest.param("none", 0.08, 30, 100, marks=pytest.mark.soak),
        pytest.param("box", 0.05, 30, 60, marks=pytest.mark.soak),
        pytest.param("hull", 0.0, 15, 30, marks=pytest.mark.soak),
    ],
)
def test_no_position_of_a_cell_is_beyond_its_bounds(body, pulley_radius, robots, samples):
    """A cell that is proved free has no position that collides, and the other way round; most free ones are proved."""
    rng = np.random.default_rng(robots + len(body))
    counts = np.sum([check(rng, body, 60, samples, pulley_radius) for _ in range(robots)], axis=0)
    print(f"{body} {pulley_radius}: {counts[0]} of {counts[1]} free, {counts[2]} of {counts[3]} not free")
    assert counts[0] > 0.7 * counts[1] > 5 and counts[2] > 0.3 * counts[3]
