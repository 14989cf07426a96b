"""What the cables do at still poses of a platform, and between neighbouring ones, thesis section 3.10.2."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from cspr_jax.feasibility import contact_lanes
from cspr_jax.feasibility.interference import Contacts, cables_cross, contacts, platform_hit
from cspr_jax.grids import in_batches
from cspr_jax.lanes import dot, stored
from cspr_jax.platforms import PlatformRobot
from cspr_jax.robots import centroid, plane_normal
from cspr_jax.wrench_lanes import cables, determinant
from cspr_jax.wrenches import conditioning

BATCH = 4096
# Determinants below this part of that of the reference orientation count as singular, of whichever sign rounding makes
# them.
SINGULAR = 1e-6
# Steps between neighbours that are held at a time.
STEPS = 65536


class Sights(NamedTuple):
    """What is seen of n poses.

    Fields:
        share: (n,) determinant over that of the reference orientation at the same place; NaN where that is singular
            itself, or the place is not below the spools.
        gaps: (n, n_pairs, 3) shortest vectors between cables, m.
        views: (n, 6, 3) cables seen from the platform, m.
    """

    share: np.ndarray
    gaps: np.ndarray
    views: np.ndarray

    def rows(self, which: np.ndarray) -> "Sights":
        """Some of them: indices, or (n,) a mask."""
        return Sights(*(x[which] for x in self))


@partial(jax.jit, static_argnames="pairs")
def _sights(robot: PlatformRobot, poses: tuple[Array, Array], *, pairs: tuple) -> tuple[Array, Array, Array]:
    places, quaternions = poses
    one = jnp.where(robot.mass > 0.0, 1.0, 2.0)
    w, x, y, z = (quaternions[:, i] for i in range(4))
    turn = stored(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        ),
        one,
    )
    wires = cables(robot, [places[:, i] for i in range(3)], turn)
    wires = wires._replace(rays=stored(wires.rays, one))
    product = jnp.sqrt(jnp.prod(jnp.stack([dot(ray, ray) for ray in wires.rays]), axis=0))
    size = jnp.sqrt(jnp.mean(jnp.sum(robot.platform_points**2, axis=1)))
    apart, seen = contact_lanes.gaps(robot.base_points, pairs, wires), contact_lanes.views(wires, turn)
    stacked = [jnp.stack([jnp.stack(v, -1) for v in vectors], 1) for vectors in (apart, seen) if vectors]
    gaps = stacked[0] if apart else jnp.zeros((len(w), 0, 3))
    return determinant(wires) / (size**3 * product), gaps, stacked[-1]


def reference_share(robot: PlatformRobot, place: np.ndarray) -> float:
    """Determinant of the reference orientation at a place, if it has the sign that it has in the middle.

    Args:
        robot: in its reference axes.
        place: (3,) m.

    Returns:
        of `wrenches.conditioning`; NaN if it has not, or the place is not below the spools.
    """
    centre, upright = centroid(robot), jnp.eye(3)
    depth = plane_normal(robot) @ (jnp.asarray(place) - centre)
    here = float(conditioning(robot, jnp.asarray(place), upright))
    middle = float(conditioning(robot, centre.at[2].add(depth), upright))
    return here if float(depth) > 0.0 and here / middle > SINGULAR else np.nan


class Watch:
    """Looks at the orientations of a platform at one place.

    Args:
        robot: in its reference axes.
        place: (3,) of the mass centre, m.
    """

    def __init__(self, robot: PlatformRobot, place: np.ndarray) -> None:
        """Find what can meet."""
        self._robot, self._place = robot, np.asarray(place, float)
        self._contacts: Contacts = contacts(robot)
        self._pairs = tuple((int(i), int(j)) for i, j in self._contacts.pairs)
        self._reference = reference_share(robot, self._place)

    def at(self, quaternions: np.ndarray) -> Sights:
        """What is seen of orientations.

        Args:
            quaternions: (n, 4) unit.

        Returns:
            the sights.
        """
        places = np.broadcast_to(self._place, (len(quaternions), 3))
        found = in_batches(
            partial(_sights, self._robot, pairs=self._pairs), (places, np.asarray(quaternions)), size=BATCH
        )
        return Sights(found[0] / self._reference, *found[1:])

    def regular(self, sights: Sights) -> np.ndarray:
        """Orientations that are not beyond a singularity.

        Args:
            sights: of n orientations.

        Returns:
            (n,).
        """
        return sights.share > SINGULAR

    def passable(self, before: Sights, after: Sights) -> np.ndarray:
        """Whether one can go from one orientation to a neighbouring one.

        Args:
            before: of n orientations.
            after: of n orientations.

        Returns:
            (n,) whether both are regular, no cables cross, and no cable sweeps over the platform.
        """
        ways = np.flatnonzero(self.regular(before) & self.regular(after))
        free = np.zeros(len(before.share), bool)
        for some in np.array_split(ways, max(1, -(-len(ways) // STEPS))):
            one, two = before.rows(some), after.rows(some)
            met = cables_cross(one.gaps, two.gaps).any(1)
            hit = platform_hit(self._contacts.sides, self._contacts.normal, one.views, two.views).any(1)
            free[some] = ~met & ~hit
        return free

    def edges(self, sights: Sights, pairs: np.ndarray) -> np.ndarray:
        """Which steps between neighbours can be made.

        Args:
            sights: of all orientations.
            pairs: (m, 2) indices of neighbours.

        Returns:
            (m,).
        """
        both = self.regular(sights)[pairs].all(1)
        free = np.zeros(len(pairs), bool)
        for some in np.array_split(np.flatnonzero(both), max(1, -(-int(both.sum()) // STEPS))):
            free[some] = self.passable(sights.rows(pairs[some, 0]), sights.rows(pairs[some, 1]))
        return free
