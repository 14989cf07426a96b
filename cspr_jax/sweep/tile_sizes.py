"""Number of cells of a tile, by what they cost.

A killed run loses at most a tile, and a run is silent for as long as a tile takes. The costs are a table that was
measured once: the shape of the tiles is part of a sweep's identity, which must be the same on every machine.
"""

import math

from cspr_jax.config.sweep import Orientations, SweepFile
from cspr_jax.schema.limits import LIMITS
from cspr_jax.schema.map_kinds import MapKind
from cspr_jax.sweep.checks import is_given

# Seconds of a tile on one core; two cores need half of it, a slow core twice as much.
TILE_SECONDS = 40.0
# A run has at least so many tiles, unless these would take less than a few seconds: each pads its last batches, and
# even a small tile of a platform's poses takes half a second.
FEWEST_TILES, SHORTEST_SECONDS = 20, 5.0
# Seconds that uncertainty takes a cell with 30 arcs, before what `CellCost` says of a kind of map.
UNCERTAINTY_SECONDS = 1e-2
# Likewise for a workspace, by what else is computed for each cell.
WORKSPACE_SECONDS = {"prove": 2e-4, "obstacle": 5e-5, "platform_hull": 5e-5, "platform_box": 5e-5}
# Likewise for motions among obstacles, by how many there are: each motion that is feasible without them is proved.
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
