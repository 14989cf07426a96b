"""Bounds of clearances over blocks of random motions against the clearances of dense samples."""

import itertools
from functools import partial

import jax
import numpy as np
import pytest
from oracles import clearance as oracle
from support.platforms import crossed_robot
from support.splines import random_spline, states_of

import cspr_jax
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.bounds.affine_bounds import AffineBounds, constant
from cspr_jax.numerics.bounds.function_bounds import changes_sign, determinant, magnitude_range
from cspr_jax.robots.bounds.contact_bounds import contact_bounds, corner_depths, passings
from cspr_jax.robots.bounds.state_bounds import StateBounds, cable_bounds
from cspr_jax.robots.contacts import clearance, convex_gaps
from cspr_jax.robots.contacts.clearance import clearances, scene
from cspr_jax.robots.contacts.contact_bodies import bodies_of, contact_pairs
from cspr_jax.robots.model import shapes
from cspr_jax.robots.statics.kernel_axes import prepared

S = np.linspace(-1.0, 1.0, 21)
# Rounding of clearances of lengths of some metres, m.
EXACT = 1e-11


def moving(rng, corners, half: float):
    """Corners on parabolas over a block of a length of 2 `half`: their bounds, and their places at S."""
    speed, second_derivative = half * rng.normal(size=corners.shape), 0.5 * half**2 * rng.normal(size=corners.shape)
    s = S.reshape(-1, *(1,) * corners.ndim)
    return AffineBounds(
        corners + 0.5 * second_derivative, speed, 0.5 * np.abs(second_derivative)
    ), corners + s * speed + s**2 * second_derivative


def gaps(count: int, half: float, seed: int):
    """Bounds of segments from boxes that move, and their distances at instants."""
    rng = np.random.default_rng(seed)
    sizes = rng.uniform(0.1, 1.0, (count, 1, 3))
    segments, lines = moving(rng, rng.uniform(-3.0, 3.0, (count, 2, 3)), half)
    away, centres = moving(rng, rng.uniform(-2.0, 2.0, (count, 1, 3)), half)
    boxes = away.each(lambda x: np.broadcast_to(x, (count, 8, 3))) + convex_gaps.BOX_SIGNS * sizes
    starts, ends = (lines[..., k, :] - centres[..., 0, :] for k in range(2))
    halves = np.broadcast_to(sizes[:, 0], starts.shape)
    flat = (x.reshape(-1, 3) for x in (starts, ends - starts, halves))
    return GAPS(segments, boxes), oracle.outside_box(*flat).astype(float).reshape(len(S), count)


@jax.jit
@jax.vmap
def GAPS(segment, box):
    return convex_gaps.clearance_bounds(
        convex_gaps.Solid(segment, *convex_gaps.SEGMENT), convex_gaps.Solid(box, *convex_gaps.BOX)
    )


def test_gaps_of_bodies_that_move():
    """Bounds hold at each instant, and close with the square of the length of the block."""
    closeness = []
    for half in (0.2, 0.1, 0.05):
        (low, high), distance = gaps(300, half, 1)
        low, high = np.asarray(low), np.asarray(high)
        assert (low <= distance.min(0) + EXACT).all() and (high >= distance.max(0) - EXACT).all()
        known = (distance.min(0) > 0.3) & np.isfinite(low)
        assert known.sum() > 150
        closeness.append([np.median((distance.min(0) - low)[known]), np.median((high - distance.max(0))[known])])
    assert (np.divide(*closeness[:2]) > 3.3).all() and (np.divide(*closeness[1:]) > 3.3).all()
    assert (np.array(closeness[2]) < 0.01).all()
    (low, high), distance = gaps(300, 1e-9, 1)
    apart = distance.min(0) > 1e-3
    for side in (low, high):
        np.testing.assert_allclose(np.asarray(side)[apart], distance[0, apart], rtol=0, atol=1e-7)


def test_faces_of_boxes_look_outward():
    for face in convex_gaps.BOX[1]:
        a, b, c = convex_gaps.BOX_SIGNS[face]
        assert np.cross(b - a, c - a) @ (a + b + c) > 0.0
    assert (np.abs(np.diff(convex_gaps.BOX_SIGNS[convex_gaps.BOX[0]], axis=1)).sum((1, 2)) == 2.0).all()


def test_depths_of_bodies_that_meet():
    """An upper bound below zero means that a fixed point of the segment is inside throughout."""
    rng = np.random.default_rng(2)
    box = shapes.box([0.1, -0.2, 0.3], [1.0, 1.4, 0.8], np.array([0.8, 0.6, 0.0, 0.0]))
    solid = bodies_of(cspr_jax.load_robot("prototype"), scene(cspr_jax.load_robot("prototype"), obstacles=[box])).boxes
    planes = jax.tree.map(lambda x: x[0], solid.planes)
    bands, lines = moving(rng, rng.uniform(-1.5, 1.5, (300, 2, 3)), 0.05)
    bound = jax.vmap(lambda x: convex_gaps.depth_bound(convex_gaps.Solid(x, *convex_gaps.SEGMENT), planes))
    depth = jax.jit(bound)(bands)
    inner = (lines - box.centre) @ box.rotation
    part = [oracle.chord(x[:, 0], x[:, 1] - x[:, 0], np.broadcast_to(box.half, (300, 3))) for x in inner]
    meets, is_deep = np.min(part, axis=0) > 0.0, np.asarray(depth) < 0.0
    assert meets[is_deep].all() and is_deep.sum() > 0.7 * meets.sum() > 40


def surrounded(name: str, body, diameter: float):
    robot = prepared(cspr_jax.load_robot(name))[0]
    size = float(np.abs(np.asarray(robot.base_points)).max())
    far = np.array([[0.3, 0.2, 0.3], [-0.4, 0.1, 0.4], [0.2, -0.5, 0.5], [0.0, 0.3, 0.6]]) * size
    bodies = [
        shapes.box(far[0], np.array([0.1, 0.2, 0.15]) * size, np.array([0.8, 0.0, 0.36, 0.48])),
        shapes.sphere(far[1], 0.06 * size),
        shapes.cylinder(far[2], far[2] + [0.1 * size, 0.3 * size, 0.0], 0.03 * size),
        shapes.box(far[3], [0.2 * size, 0.0, 0.1 * size]),
    ]
    return robot, scene(robot, diameter=diameter, obstacles=bodies, body=body)


@jax.jit
def BOUNDS(robot, bodies, states):
    return jax.vmap(lambda state: contact_bounds(robot, bodies, state, cable_bounds(robot, state)))(states)


@jax.jit
def PASSINGS(robot, bodies, state):
    known = cable_bounds(robot, state)
    return contact_bounds(robot, bodies, state, known), passings(robot, bodies, state, known)


HULL = shapes.hull(np.array([[0.3, 0.3, 0.3], [-0.3, 0.3, 0.2], [0.3, -0.3, 0.2], [-0.3, -0.3, 0.4], [0.0, 0.0, -0.4]]))
CASES = {
    "prototype": ((0.0, 0.0, 0.3), 0.2, None),
    "cogiro": ((0.0, 0.0, 4.0), 1.5, HULL),
    "laval-mssm": ((0.0, 0.0, 1.3), 0.9, shapes.box([0.0, 0.0, 0.05], [0.3, 0.3, 0.2])),
}


def instants(robot, around, seed: int, middle, size: float, count: int):
    """Clearances at instants of the blocks of a random motion, (count, n_instants), and bounds of each meeting."""
    spline, table = random_spline(seed, middle=middle, size=size, tilt=0.1)
    edges = np.linspace(0.0, table.x[-1], count + 1)
    times = 0.5 * (edges[:-1] + edges[1:])[:, None] + 0.5 * np.diff(edges)[:, None] * S
    state = states_of(spline, times.ravel())
    exact = clearances(around, state.position, None if around.body is None else state.quaternion)
    blocks, kernel = spline.bounds(edges[:-1], edges[1:]), partial(BOUNDS, robot, bodies_of(robot, around))
    return [x.reshape(count, -1) for x in exact[:5]], in_batches(kernel, blocks, batch_size=40)


@pytest.mark.ci("prototype")
@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", ["prototype", *(pytest.param(name, marks=pytest.mark.thorough) for name in ("cogiro", "laval-mssm"))]
)
def test_clearances_of_motions(name, monkeypatch):
    monkeypatch.setattr(clearance, "BATCH", 1024)
    middle, size, body = CASES[name]
    robot, around = surrounded(name, body, 0.01)
    rows = contact_pairs(robot, around)
    is_brick = np.array([row.kind == "platform-obstacle" and row.other in (0, 3) for row in rows])
    closeness, decided = {40: [], 160: []}, 0
    for count, seed in itertools.product(closeness, range(2)):
        (value, place, *_), (low, high) = instants(robot, around, seed, middle, size, count)
        assert low.shape == high.shape == (count, len(rows))
        block = np.arange(count)[:, None]
        # Bounds of the bodies that are nearest at each instant; of two boxes samples know the sign alone.
        apart = value > 0.0
        assert (low[block, place] <= value + EXACT)[apart & ~is_brick[place]].all()
        assert (high[block, place] >= value - EXACT)[apart].all()
        assert (low[block, place] <= 0.0)[~apart].all()
        # No meeting comes nearer than the nearest one.
        assert (high.min(1) >= np.where(apart, value, -np.inf).max(1) - EXACT)[apart.all(1)].all()
        closeness[count].append(np.where(apart, value, 0.0).min(1) - np.maximum(low.min(1), 0.0))
        decided += (high.min(1) < 0.0).sum()
        assert not apart[high.min(1) < 0.0].any()
    means = [np.median(np.concatenate(parts)) for parts in closeness.values()]
    assert means[1] < means[0] / 8.0 + 1e-5 and means[1] < 0.01 * size
    assert decided > 5


def still(value) -> AffineBounds:
    return constant(np.asarray(value, float))


def lifted(rate: float, height: float = 0.0) -> StateBounds:
    """A block in which the platform tilts about x, so that two cables pass through each other in its middle."""
    turn = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -rate], [0.0, rate, 0.0]])
    second_derivative = AffineBounds(np.eye(3), turn, np.full((3, 3), 0.5 * rate**2 + rate**3))
    nothing = still(np.zeros(3))
    return StateBounds(still([0.0, 0.0, height]), nothing, nothing, second_derivative, nothing, nothing)


@pytest.mark.parametrize(("offset", "does"), [(0.0, True), (0.2, False)])
def test_cables_that_pass_through_each_other(offset, does):
    """Of two cables from a symmetric platform the second is above the first before, and below it afterwards."""
    robot = crossed_robot(offset)
    around = scene(robot)
    bodies, state = bodies_of(robot, around), lifted(0.01)
    (low, high), through = jax.tree.map(np.asarray, PASSINGS(robot, bodies, state))
    place = contact_pairs(robot, around).index(("cables", 0, 1))
    assert bool(through[place]) == does and through.sum() == int(does)
    assert (float(low[place]) > 0.0) != does and float(high[place]) > 0.0


def test_cables_are_as_thick_as_both_of_their_radii():
    robot, diameters = crossed_robot(0.2), np.linspace(0.01, 0.06, 6)
    scenes = [scene(robot, diameter=diameter) for diameter in (0.0, diameters)]
    thin, thick = (PASSINGS(robot, bodies_of(robot, around), lifted(0.01))[0] for around in scenes)
    pairs = np.array(scenes[0].pairs)
    for before, after in zip(thin, thick, strict=True):
        lost = np.asarray(before - after)[: len(pairs)]
        np.testing.assert_allclose(lost, 0.5 * diameters[pairs].sum(1), atol=1e-12)


def test_determinants_over_blocks():
    rng = np.random.default_rng(5)

    @jax.jit
    def found(bands):
        value = jax.vmap(determinant)(bands)
        return value, magnitude_range(value), changes_sign(value)

    for n in (1, 2, 6):
        middle, slope = rng.normal(size=(2, 40, n, n))
        bands = AffineBounds(middle, 0.01 * slope, np.full(middle.shape, 1e-5))
        value, (low, high), does = jax.tree.map(np.asarray, found(bands))
        noise = 1e-5 * rng.uniform(-1.0, 1.0, (len(S), *middle.shape))
        exact = np.linalg.det(middle + 0.01 * S[:, None, None, None] * slope + noise)
        over = np.abs(exact - value.middle - value.linear * S[:, None]) - value.radius
        assert not (over > 1e-12 * np.abs(exact).max()).any()
        assert (low <= np.abs(exact).min(0)).all() and (high >= np.abs(exact).max(0)).all()
        closed = np.nanmedian(value.radius / np.abs(value.middle))
        assert closed < 0.05
        assert ((exact[0] * exact[-1] < 0.0) | ~does).all()


def test_corners_of_a_platform():
    """Depths of the corners of a box that hangs level, and of one that is tilted."""
    robot, around = surrounded("cogiro", shapes.box([0.0, 0.0, 0.2], [0.4, 0.4, 0.4]), 0.0)
    body = bodies_of(robot, around).body
    depths = jax.tree.map(np.asarray, jax.jit(corner_depths)(body.corners, lifted(0.05, height=2.0)))
    np.testing.assert_allclose(depths.linear, 0.05 * body.corners[:, 1], atol=1e-15)
    assert float(depths.middle.max()) == pytest.approx(2.4) and float(depths.high().max()) > 2.4 + 0.05 * 0.2
