"""Bounds over cells of workspaces, beside exact algebra at corners and sampled positions; no jax."""

import numpy as np
import pytest

from cspr_jax.workspaces.cells.cells import cells_about
from cspr_jax.workspaces.cells.inside_cells import tension_bounds
from cspr_jax.workspaces.cells.outside_cells import are_beyond, lower_slacks, products_of

SIZES = [(1, 2), (3, 4), pytest.param(6, 6, marks=pytest.mark.soak), (6, 8)]
CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def drawn_cells(rng, count, components, cables):
    """Cells of cables of any wrenches, some of them flat; the largest as far as bounds reach."""
    exits = 3.0 * rng.normal(size=(cables, 3))
    forces = rng.normal(size=(3, components, cables))
    half = rng.uniform(0.0, 1.0, (count, 3)) * 10.0 ** rng.uniform(-3.0, -0.3, (count, 1))
    half *= rng.random((count, 3)) < 0.6
    centres = 0.5 * rng.normal(size=(count, 3))
    return centres, half, exits, forces, cells_of(centres, half, exits, forces)


def cells_of(centres, half, exits, forces):
    """Cells of cables that leave at fixed points."""
    shape = len(centres), len(exits)
    return cells_about(centres, half, np.broadcast_to(exits, (*shape, 3)), forces, np.zeros(shape))


def columns(exits, forces, place):
    """Z, lengths."""
    rays = exits - place
    return np.einsum("kmi,ik->mi", forces, rays), np.linalg.norm(rays, axis=1)


class Meant:
    """The force densities that differ from those of the centre by the least weighted sum, solved for exactly."""

    def __init__(self, matrix, density, weight, wrench, forces):
        self.density, self.wrench, self.forces = density, wrench, forces
        self.inverse = weight[:, None] ** 2 * matrix.T @ np.linalg.inv(matrix @ (weight[:, None] ** 2 * matrix.T))

    def tensions(self, place, exits):
        """Tensions at a place, with exits that may have moved."""
        matrix, lengths = columns(exits, self.forces, place)
        missing = self.wrench - matrix @ self.density
        moved = self.density + self.inverse @ np.linalg.solve(matrix @ self.inverse, missing)
        np.testing.assert_allclose(matrix @ moved, self.wrench, atol=1e-8)
        return lengths * moved


def places_in(rng, centre, half, inner=6):
    """All corners, and some inside."""
    return centre + half * np.concatenate([CORNERS, rng.uniform(-1.0, 1.0, (inner, 3))])


@pytest.mark.parametrize(("components", "cables"), SIZES)
def test_bounds_of_tensions_hold_those_that_are_meant(components, cables):
    rng, known, ratios = np.random.default_rng(cables), 0, []
    centres, half, exits, forces, cells = drawn_cells(rng, 120, components, cables)
    tensions = rng.uniform(0.5, 1.0, (120, cables))
    low, high = np.full(cables, 0.2), np.where(rng.random(cables) < 0.5, np.inf, 1.5)
    for i in range(120):
        one = cells.take(np.array([i]))
        start, lengths = columns(exits, forces, centres[i])
        density = tensions[i] / lengths
        wrench = start @ density * (1.0 + 1e-3 * (i % 2) * rng.normal())  # which tensions may miss
        least, most = (side[0] for side in tension_bounds(one, tensions[i : i + 1], wrench, low, high))
        if not np.isfinite(least).all():
            continue
        known += 1
        meant = Meant(start, density, np.minimum(tensions[i] - low, high - tensions[i]) / lengths, wrench, forces)
        seen = [meant.tensions(place, exits) for place in places_in(rng, centres[i], half[i])]
        if (least > 0.0).all():  # lengths are bounded from below by their tangents: of tensions that pull
            assert (np.min(seen, axis=0) >= least).all() and (np.max(seen, axis=0) <= most).all(), i
            ratios.append(np.max((most - least) / np.maximum(np.ptp(seen, axis=0), 1e-9)))
    assert known > 40 and len(ratios) > 30
    assert np.quantile(ratios, 0.3) < 1.2  # and are not much wider


@pytest.mark.parametrize(("components", "cables"), SIZES)
def test_bounds_of_tensions_hold_wherever_exits_are(components, cables):
    """Exits displaced in the directions in which they change a tension most, and in drawn ones."""
    rng, ratios = np.random.default_rng(cables), []
    centres, half, exits, forces, cells = drawn_cells(rng, 40, components, cables)
    distance = 10.0 ** rng.uniform(-4.0, -2.0, (40, cables))
    cells = cells._replace(moves=distance)
    tensions, low, high = rng.uniform(0.5, 1.0, (40, cables)), np.full(cables, 0.2), np.full(cables, 1.5)
    for i in range(40):
        start, lengths = columns(exits, forces, centres[i])
        density = tensions[i] / lengths
        wrench = start @ density
        one = cells.take(np.array([i]))
        least, most = (side[0] for side in tension_bounds(one, tensions[i : i + 1], wrench, low, high))
        if not (np.isfinite(least) & (least > 0.0)).all():
            continue
        meant = Meant(start, density, np.minimum(tensions[i] - low, high - tensions[i]) / lengths, wrench, forces)
        steps = 1e-7 * np.eye(3 * cables).reshape(-1, cables, 3)
        changes = np.array([meant.tensions(centres[i], exits + step) - tensions[i] for step in steps])
        changes = changes.T.reshape(cables, cables, 3)
        changes = np.concatenate([changes, -changes, rng.normal(size=(4, cables, 3))])
        moved = exits + distance[i, :, None] * changes / (np.linalg.norm(changes, axis=2, keepdims=True) + 1e-300)
        places = places_in(rng, centres[i], half[i], 1)
        seen = np.array([meant.tensions(place, displaced) for place in places for displaced in moved])
        assert (seen >= least).all() and (seen <= most).all(), i
        ratios.append(np.max((most - least) / np.ptp(seen, axis=0)))
    assert len(ratios) > 15
    assert np.quantile(ratios, 0.3) < 1.2  # and are not much wider


@pytest.mark.parametrize(("components", "cables"), SIZES)
def test_bounds_of_products_hold_those_of_the_normal_that_moves(components, cables):
    rng, known, ratios = np.random.default_rng(cables), 0, []
    centres, half, exits, forces, cells = drawn_cells(rng, 120, components, cables)
    held = np.tile(np.arange(components - 1), (120, 1))
    for i in range(120):
        one = cells.take(np.array([i]))
        start, lengths = columns(exits, forces, centres[i])
        normal = np.linalg.svd(start[:, : components - 1].T)[2][-1] if components > 1 else np.ones(1)
        wrench, limits = rng.normal(size=components), rng.uniform(0.0, 2.0, cables)
        limits[: components - 1] = 0.0
        found = products_of(one, normal[None], held[i : i + 1], wrench[None])
        least, most = (side[0] for side in found.ends)
        with np.errstate(invalid="ignore"):
            slack = lower_slacks(one, found, limits[None])[0]
        if not np.isfinite(slack):
            continue
        known, seen, slacks = known + 1, [], []
        for place in places_in(rng, centres[i], half[i]):
            matrix, own = columns(exits, forces, place)
            # c . c0 = 1, and c normal to the cables that are held.
            frame = np.c_[matrix[:, : components - 1], normal]
            moved = np.linalg.solve(frame.T, np.r_[np.zeros(components - 1), 1.0])
            seen.append(np.r_[moved @ matrix / lengths, moved @ wrench])
            slacks.append(moved @ wrench - limits @ (moved @ matrix / own))
        others = np.r_[components - 1 : cables, -1]
        assert (np.min(seen, axis=0) >= least)[others].all() and (np.max(seen, axis=0) <= most)[others].all(), i
        assert min(slacks) >= slack, i
        ratios.append((np.min(slacks) - slack) / max(np.ptp(slacks), 1e-9))
    assert known > 40
    assert np.quantile(ratios, 0.3) < 0.2


@pytest.mark.parametrize(("components", "cables", "moves"), [(3, 4, True), (3, 4, False), (6, 8, True)])
def test_wrenches_beyond_all_tensions(components, cables, moves):
    """Just beyond them at the centre, and at every sample by the same normal where that is proved."""
    rng, proved = np.random.default_rng(cables), 0
    centres, half, exits, forces, cells = drawn_cells(rng, 200, components, cables)
    free = np.arange(components - 1) if moves else np.arange(0)
    low, high = np.full(cables, 0.5), np.full(cables, 20.0)
    for i in range(200):
        start, lengths = columns(exits, forces, centres[i])
        normal = np.linalg.svd(start[:, : components - 1].T)[2][-1]
        along = np.delete(normal @ start / lengths, free)
        wanted = np.maximum(0.5 * along, 20.0 * along).sum() * (1.0 + 10.0 ** rng.uniform(-4.0, 0.0))
        wrench = normal * wanted
        one, held = cells.take(np.array([i])), free[None] if moves else None
        if not are_beyond(one, normal[None], held, wrench[None], low, high)[0]:
            continue
        proved += 1
        for place in places_in(rng, centres[i], half[i]):
            matrix, own = columns(exits, forces, place)
            moved = normal
            if moves:
                frame = np.c_[matrix[:, : components - 1], normal]
                moved = np.linalg.solve(frame.T, np.r_[np.zeros(components - 1), 1.0])
            along = np.delete(moved @ matrix / own, free)
            assert moved @ wrench > np.maximum(0.5 * along, 20.0 * along).sum(), i
    assert proved > 30


def test_nothing_is_known_where_a_cable_may_have_no_length():
    """A base point in the corner of a cell, of six cables that pull against each other."""
    exits = np.concatenate([4.0 * np.eye(3), -4.0 * np.eye(3), [[0.2, 0.2, 0.2]]])
    forces = np.repeat(np.eye(3)[..., None], 7, axis=2)
    normal, low, high = np.array([[0.0, 0.0, 1.0]]), np.zeros(7), np.full(7, np.inf)
    for size, is_known in ((0.05, True), (0.25, False)):
        cells = cells_of(np.zeros((1, 3)), np.full((1, 3), size), exits, forces)
        tensions = np.full((1, 7), 1.0)
        wrench = cells.matrices[0] @ (1.0 / cells.lengths[0])
        assert np.isfinite(tension_bounds(cells, tensions, wrench, low, high)[0]).all() == is_known
        beyond = are_beyond(cells, normal, None, np.array([[0.0, 0.0, 99.0]]), low, np.full(7, 1.0))
        assert beyond[0] == is_known
