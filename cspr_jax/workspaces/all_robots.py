"""Requirements of all robots within an uncertainty: of the lightest and the heaviest one, wherever mass centres are.

At a pose with given spools the wrenches that tensions within limits supply are a convex set, and those that a mass
needs with its centre at a given position are linear in the mass: what both the smallest and the largest mass have, all
masses between have. A force f that acts at a mass centre displaced by d adds d x f to the moment about its nominal
position. For a vertical force these moments fill a disk; for forces of all directions they lie in a ball, though not
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
    """Searches for robots of one mass, spools at their positions.

    Fields:
        enclosing: of wrenches that include those of all positions of the mass centre.
        attained: of wrenches each of which some position of the mass centre needs.
    """

    enclosing: WorkspaceSearch
    attained: WorkspaceSearch


@dataclasses.dataclass(frozen=True)
class AllRobots:
    """All robots within an uncertainty.

    Fields:
        spools: how far each spool may be from its position, m.
        searches: of each condition on the cables, for the masses that decide.
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
    """Searches of a condition for the masses that decide."""
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
    # Wrenches that include those of displaced mass centres, with moments up to `radius`; whether each is needed.
    row = PATTERNS[robot.pattern]
    axes = np.zeros(robot.dof)
    axes[len(row.forces) :] = radius
    if not row.along_line and is_vertical:
        axes[len(row.forces) :] = [0.0 if axis == 2 else radius for axis in row.moments]
    wider = dataclasses.replace(wrenches, ellipsoids=(*wrenches.ellipsoids, axes))
    return wider, is_vertical and not row.along_line
