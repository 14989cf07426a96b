"""Enclosures of a robot in motion: bounds of its state over blocks of time, for proofs about slightly different robots.

NumPy throughout, since blocks are few and LAPACK inverts the structure matrix. All vectors are in the axes of the
platform, in which the attachment points do not move; for a point mass, these are the fixed axes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cspr_jax.numerics.shapes import Bool, Float


class Distances(NamedTuple):
    """Distances that shrink as spools move, m.

    Fields:
        bound: (k, m) lower bounds in the middle of each block, along some unit vectors.
        change: (k, m) largest decrease of the distances within the block.
        tilt: (k, m) gain of the bounds, per displacement of the spools, from tilting the unit vectors against it.
        sine: (k, m) sine of the angle of that tilt per displacement, 1/m; the bounds shrink by its cosine.
        swing: (k, m) further decrease of the tilted bounds within the block, per displacement.
        spools: (m,) largest loss of each distance, per largest displacement of a spool.
        middle: (k, l) distances in the middle.
        middle_spools: (k, l) loss of the distances in the middle for the worst displacements, per displacement.
    """

    bound: np.ndarray
    change: np.ndarray
    tilt: np.ndarray
    sine: np.ndarray
    swing: np.ndarray
    spools: np.ndarray
    middle: np.ndarray
    middle_spools: np.ndarray

    def hold(self, spools: Float[np.ndarray, "k"]) -> Bool[np.ndarray, "k"]:
        """Tell whether all distances are proved positive within blocks, for all displacements of the spools."""
        far = spools[:, None]
        cosine = np.sqrt(np.maximum(1.0 - (far * self.sine) ** 2, 0.0))
        low = cosine * self.bound - self.change + far * (self.tilt - self.swing)
        return ((low > self.spools * far) & (far * self.sine < 1.0)).all(1)

    def fail(self, spools: Float[np.ndarray, "k"]) -> Bool[np.ndarray, "k"]:
        """Tell whether the worst displacements of the spools reduce a distance to zero in the middle of each block."""
        return (self.middle < self.middle_spools * spools[:, None]).any(1)


class Rates(NamedTuple):
    """Motion of the attachment points, for rates of cables.

    Fields:
        velocity: (k, n_cables, 3) in the middle, m/s.
        acceleration: (k, n_cables, 3) m/s^2.
        velocity_change: (k, n_cables) largest change of the velocity from the middle, within the block, m/s.
        acceleration_change: (k, n_cables) largest change of the acceleration likewise, m/s^2.
    """

    velocity: np.ndarray
    acceleration: np.ndarray
    velocity_change: np.ndarray
    acceleration_change: np.ndarray


class Enclosure(NamedTuple):
    """Middle states and bounds of k blocks of motions; "in the middle" means at the middle time.

    Fields:
        rays: (k, n_cables, 3) vectors from spool to attachment point in the middle, m.
        arms: (n_cables, 3) attachment points from the mass centre, m; zero for a point mass.
        force: (k, 3) force that the cables supply, per mass, in the middle, m/s^2.
        moment: (k, 3) moment of the cables about the mass centre, per mass, in the middle, m^2/s^2.
        acceleration_matrix: (k, 3, 3) matrix from a point of the platform, relative to the mass centre, to its relative
            acceleration, 1/s^2.
        tangent: (k, n_cables, 3) change of the rays along their tangents from the middle to the end of the block, m.
        deviation: (k, n_cables) largest distance of the rays from their tangents within the block, m.
        force_change: (k,) largest change of the force from the middle, within the block, m/s^2.
        acceleration_matrix_change: (k,) largest change of `acceleration_matrix` likewise, 1/s^2.
        low: (k, n_cables) lower bounds of the tensions per mass and length within the block, 1/s^2.
        high: (k, n_cables) upper bounds of the tensions per mass and length, 1/s^2.
        distances: distances that shrink as spools move.
        rates: motion of the attachment points.
    """

    rays: np.ndarray
    arms: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    acceleration_matrix: np.ndarray
    tangent: np.ndarray
    deviation: np.ndarray
    force_change: np.ndarray
    acceleration_matrix_change: np.ndarray
    low: np.ndarray
    high: np.ndarray
    distances: Distances
    rates: Rates

    @property
    def moved(self) -> np.ndarray:
        """Largest change of the rays from the middle, within the block, (k, n_cables) m."""
        return largest_moves(self.tangent, self.deviation)

    def part(self, rows: np.ndarray) -> "Enclosure":
        """Blocks chosen by indices, or by a mask (k,)."""
        distances = self.distances._replace(
            **{name: value[rows] for name, value in self.distances._asdict().items() if name != "spools"}
        )
        rates = Rates(*(x[rows] for x in self.rates))
        fields = {
            name: value[rows] for name, value in self._asdict().items() if name not in ("arms", "distances", "rates")
        }
        return self._replace(**fields, distances=distances, rates=rates)

    def middle(self, mu: Float[np.ndarray, "k n_cables"]) -> "Enclosure":
        """Enclosure of the middle times alone, with blocks of length zero."""
        names = "tangent", "deviation", "force_change", "acceleration_matrix_change"
        changes = {name: np.zeros_like(getattr(self, name)) for name in names}
        static = {name: np.zeros_like(getattr(self.rates, name)) for name in ("velocity_change", "acceleration_change")}
        nothing = np.zeros_like(self.distances.change)
        distances = self.distances._replace(change=nothing, swing=nothing)
        return self._replace(**changes, low=mu, high=mu, distances=distances, rates=self.rates._replace(**static))


def largest_moves(tangent: Float[np.ndarray, "... 3"], deviation: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Largest changes of rays from the middles of blocks."""
    return np.linalg.norm(tangent, axis=-1) + deviation


def structure(
    rays: Float[np.ndarray, "k n_cables 3"], arms: Float[np.ndarray, "n_cables 3"], *, is_platform: bool
) -> np.ndarray:
    """Structure matrices: the wrenches per mass of tensions per mass and length."""
    forces = -rays
    if not is_platform:
        return np.swapaxes(forces, 1, 2)
    return np.swapaxes(np.concatenate([forces, np.cross(arms, forces)], axis=2), 1, 2)


class Influence(NamedTuple):
    """First-order influence of displaced spools, and of a displaced mass centre, on tensions in the middle of k blocks.

    With e_j the displacement of spool j and delta that of the mass centre,
    mu_k changes by -(sum over j of g_kj . e_j mu_j) + h_k . delta.

    Fields:
        spools: (k, n_cables, n_cables, 3) g_kj, 1/m.
        across: likewise the part of g_kj across ray j, since displacements along the ray change no tension.
        centre: (k, n_cables, 3) h_k, 1/(m s^2).
        forces: (k, n_cables, 3) mu_k for unit forces per mass, 1/m.
        moments: (k, n_cables, 3) mu_k for unit moments per mass, 1/m^2.
        lengths: (k, n_cables) lengths of the cables, m.
        mu: (k, n_cables) tensions per mass and length, 1/s^2.
    """

    spools: np.ndarray
    across: np.ndarray
    centre: np.ndarray
    forces: np.ndarray
    moments: np.ndarray
    lengths: np.ndarray
    mu: np.ndarray

    def part(self, rows: np.ndarray) -> "Influence":
        """Blocks chosen by indices, or by a mask (k,)."""
        return Influence(*(x[rows] for x in self))


def influence(enclosure: Enclosure) -> Influence:
    """Influence in the middle of blocks."""
    is_platform = bool(enclosure.arms.any())
    inverse = inverted(structure(enclosure.rays, enclosure.arms, is_platform=is_platform))
    forces = inverse[..., :3]
    moments = inverse[..., 3:] if is_platform else np.zeros_like(forces)
    spools = forces[:, :, None] + np.cross(moments[:, :, None], enclosure.arms)
    lengths = np.linalg.norm(enclosure.rays, axis=2)
    units = enclosure.rays / lengths[..., None]
    across = spools - np.sum(spools * units[:, None], axis=3, keepdims=True) * units[:, None]
    centre = forces @ enclosure.acceleration_matrix + np.cross(enclosure.force[:, None], moments)
    wrench = (
        np.concatenate([enclosure.force, enclosure.moment], axis=1)[..., None]
        if is_platform
        else enclosure.force[..., None]
    )
    return Influence(spools, across, centre, forces, moments, lengths, (inverse @ wrench)[..., 0])


def inverted(matrices: Float[np.ndarray, "k m n"]) -> Float[np.ndarray, "k n m"]:
    """Inverse matrices; pseudo-inverses for two cables in the plane y = 0, which supply no force normal to it."""
    if matrices.shape[1] == matrices.shape[2]:
        is_regular = np.isfinite(matrices).all((1, 2)) & (np.linalg.det(matrices) != 0.0)
        safe = np.where(is_regular[:, None, None], matrices, np.eye(matrices.shape[1]))
        return np.where(is_regular[:, None, None], np.linalg.inv(safe), np.nan)
    finite = np.isfinite(matrices).all((1, 2))[:, None, None]
    return np.where(finite, np.linalg.pinv(np.where(finite, matrices, 1.0)), np.nan)
