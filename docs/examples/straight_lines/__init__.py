"""Straight lines at a mean speed: a family in one folder.

Files, each importing only from those above it:

    motion      position and its derivatives along a line
    leg         lines in a plan
    map         map of the durations of lines

The rows below tell the program of the family and of its map.
"""

from cspr_jax.schema.families import Family
from cspr_jax.schema.map_kinds import MapKind
from cspr_jax.schema.quantities import Quantity

FAMILY = Family("straight-line", "straight lines at a mean speed", {"3T": "straight_lines.leg:Lines"})
QUANTITIES = (Quantity("line_duration", "s", "duration of the line", "Duration of the line from P0 to the target."),)
KIND = MapKind(
    name="line-durations",
    title="Durations of straight lines from P0",
    description="duration of the straight line from P0 to each target",
    implementation="straight_lines.map:LineDurationsMap",
    quantities=("line_duration",),
    stored=("line_duration",),
    pictured=("line_duration",),
    motionless=("line_duration",),
    families=("straight-line",),
    takes=("axes.z0",),
    cells=64,
)
