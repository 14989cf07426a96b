"""Number of cells of a tile, by the cost of cells.

A killed run loses at most a tile, and a run reports nothing while a tile is computed. Costs come from a table that was
measured once, since the shape of tiles is part of a sweep's identity, which must be the same on every machine.
"""

import math

from cspr_jax.config.sweep import Orientations, SweepFile
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.map_kinds import MapKind
from cspr_jax.sweep.checks import is_given

# Time for a tile on one core, s; two cores need half of it, a slow core twice as much.
TILE_SECONDS = 40.0
# Smallest number of tiles of a run, unless each would take less than a few seconds: tiles pad their last batches, and
# even a small tile of a platform's poses takes half a second.
FEWEST_TILES, SHORTEST_SECONDS = 20, 5.0
# Additional time for a cell with 30 arcs and an uncertainty, s; `CellCost` has factors for kinds of maps.
UNCERTAINTY_SECONDS = 1e-2
# Additional times for a cell of a workspace, s, by further computations.
WORKSPACE_SECONDS = {"prove": 2e-4, "obstacle": 5e-5, "platform_hull": 5e-5, "platform_box": 5e-5}
# Additional times for motions among obstacles, s, for each proof and each obstacle: all motions that are feasible
# without obstacles are proved.
PROOF_SECONDS, OBSTACLE_SECONDS = 5e-3, 1e-3
ARCS = 30


def cell_seconds(kind: MapKind, spec: SweepFile) -> float:
    """Estimate the time that a cell takes on one core."""
    limits = kind.cost.limits * sum(limit.seconds for limit in LIMITS if is_given(spec, f"limits.{limit.name}"))
    if is_given(spec, "limits.uncertainty"):
        limits += kind.cost.uncertainty * UNCERTAINTY_SECONDS
    conditions = sum(cost for name, cost in WORKSPACE_SECONDS.items() if is_given(spec, f"workspace.{name}"))
    if spec.obstacle_keys:
        conditions += PROOF_SECONDS + OBSTACLE_SECONDS * len(spec.obstacle or ())
    divisions = (spec.orientations or Orientations()).divisions
    motion = (kind.cost.seconds + limits) * (spec.trajectory.max_arcs / ARCS if kind.families else 1.0)
    return motion + conditions + kind.cost.orientation * 4 * divisions**3


def tile_cells(kind: MapKind, spec: SweepFile, cells: int) -> int:
    """Choose the largest number of cells of a tile."""
    seconds = cell_seconds(kind, spec)
    maximum = min(kind.cells, math.ceil(TILE_SECONDS / seconds))
    return min(maximum, max(math.ceil(cells / FEWEST_TILES), math.ceil(SHORTEST_SECONDS / seconds)))
