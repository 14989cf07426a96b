"""Requirements of all robots within an uncertainty: the lightest and the heaviest one, for all displaced mass centres.

At a pose with given spools, the wrenches that tensions within limits supply form a convex set, and the wrench that a
mass centre at a given position requires is linear in the mass: if the smallest and the largest mass can be held, so can
all masses between. A force f at a mass centre that is displaced by d adds d x f to the moment about the nominal
position. For a vertical force these moments fill a disk; for forces of all directions they lie in a ball, although not
every pair of force and moment occurs.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from cspr_jax.robots.bounds.uncertain_tensions import with_mass
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.limits import Uncertainty
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.workspaces.required_wrenches import RequiredWrenches
from cspr_jax.workspaces.requirements import CLOSURE, Requirement
from cspr_jax.workspaces.search import WorkspaceSearch


class MassSearch(NamedTuple):
    """Searches for robots of one mass, with spools at their nominal positions.

    Fields:
        enclosing: search with wrenches that include the wrenches for all positions of the mass centre.
        attained: search with wrenches each of which some position of the mass centre requires.
    """

    enclosing: WorkspaceSearch
    attained: WorkspaceSearch


@dataclasses.dataclass(frozen=True)
class AllRobots:
    """All robots within an uncertainty.

    Fields:
        spools: largest distance of each spool from its nominal position, m.
        searches: for each condition on the cables, searches for the decisive masses.
    """

    spools: float
    searches: Mapping[str, Sequence[MassSearch]]


def mass_searches(
    robot: AnyRobot,
    uncertainty: Uncertainty,
    ask: Callable[[AnyRobot], Requirement],
    *,
    has_weight: bool,
    acceleration: float,
) -> list[MassSearch]:
    """Searches of a condition for the decisive masses, the smallest and the largest."""
    is_closure = ask(robot).condition == CLOSURE
    total_acceleration = float(robot.gravity) * has_weight + acceleration
    factor = 1.0 if is_closure or total_acceleration == 0.0 else float(uncertainty.mass_factor)
    searches = []
    for ratio in sorted({1.0 / factor, factor}):
        other = with_mass(robot, jnp.asarray(ratio))
        requested = ask(other)
        radius = float(uncertainty.mass_centre) * float(other.mass) * total_acceleration
        enclosing, is_attained = _off_centre(other, requested.wrenches, radius, is_vertical=acceleration == 0.0)
        attained = WorkspaceSearch(other, requested)
        if is_closure or radius == 0.0:
            searches.append(MassSearch(attained, attained))
            continue
        all_of_them = WorkspaceSearch(other, dataclasses.replace(requested, wrenches=enclosing))
        searches.append(MassSearch(all_of_them, all_of_them if is_attained else attained))
    return searches


def _off_centre(
    robot: AnyRobot, wrenches: RequiredWrenches, radius: float, *, is_vertical: bool
) -> tuple[RequiredWrenches, bool]:
    # Wrenches that include those of displaced mass centres, with moments up to `radius`, and whether all are required.
    row = PATTERNS[robot.pattern]
    axes = np.zeros(robot.dof)
    axes[len(row.forces) :] = radius
    if not row.along_line and is_vertical:
        axes[len(row.forces) :] = [0.0 if axis == 2 else radius for axis in row.moments]
    wider = dataclasses.replace(wrenches, ellipsoids=(*wrenches.ellipsoids, axes))
    return wider, is_vertical and not row.along_line
