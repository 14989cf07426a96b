"""Wrenches that cables must supply; no jax."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from cspr_jax.numerics.shapes import Float

NO_POINTS = "the weight of a body on a joint is known at a pose: see about()"


@dataclasses.dataclass(frozen=True)
class RequiredWrenches:
    """Wrenches that cables must supply: all sums of a wrench of a finite set, one of a box and one of each ellipsoid.

    Fields:
        points: (k, dof) the finite set, N and N m, or with moments over a length for kernels; None: the weight of a
            body on a joint, which depends on the orientation.
        box: (dof,) half widths of a box about zero; None: there is none.
        ellipsoids: (dof,) semi-axes of each ellipsoid about zero.
    """

    points: np.ndarray | None
    box: np.ndarray | None = None
    ellipsoids: tuple[np.ndarray, ...] = ()

    def over(self, unit: Float[np.ndarray, "dof"]) -> "RequiredWrenches":
        """The same wrenches in other units."""
        box = None if self.box is None else self.box / unit
        points = None if self.points is None else self.points / unit
        return RequiredWrenches(points, box, tuple(axes / unit for axes in self.ellipsoids))

    def about(self, wrench: Float[np.ndarray, "dof"]) -> "RequiredWrenches":
        """The same box and ellipsoids about one wrench, which replaces the finite set."""
        return dataclasses.replace(self, points=wrench[None])

    @property
    def corners(self) -> np.ndarray:
        """Sums of each wrench of the finite set and each corner of the box, (n, dof)."""
        if self.points is None:
            raise TypeError(NO_POINTS)
        half = np.zeros(self.points.shape[1]) if self.box is None else self.box
        signs = itertools.product(*[(-1.0, 1.0) if h else (0.0,) for h in half])
        return np.concatenate([self.points + np.array(sign) * half for sign in signs])

    @property
    def enclosing(self) -> "RequiredWrenches":
        """Larger set of wrenches, in which a box about each ellipsoid replaces it."""
        if not self.ellipsoids:
            return self
        box = sum(self.ellipsoids) if self.box is None else self.box + sum(self.ellipsoids)
        return dataclasses.replace(self, box=np.asarray(box), ellipsoids=())

    def supports(self, normals: Float[np.ndarray, "n dof"]) -> Float[np.ndarray, "n"]:
        """Largest product of each normal with the wrenches."""
        if self.points is None:
            raise TypeError(NO_POINTS)
        products = (self.points @ normals.T).max(0)
        if self.box is not None:
            products = products + np.abs(normals) @ self.box
        return products + sum(np.linalg.norm(normals * axes, axis=1) for axes in self.ellipsoids)

    @property
    def spanning(self) -> list[np.ndarray]:
        """Wrenches (n, dof) that span the space of all wrenches of the set."""
        spreads = [axes for axes in (self.box, *self.ellipsoids) if axes is not None]
        return [*([] if self.points is None else [self.points]), *(np.diag(axes) for axes in spreads)]

    @property
    def is_one(self) -> bool:
        """Tell whether a single wrench is required at each pose."""
        return (self.points is None or len(self.points) == 1) and self.box is None and not self.ellipsoids

    @property
    def magnitude(self) -> float:
        """Largest absolute component; 0 for a weight that depends on the orientation."""
        return max((float(np.abs(part).max()) for part in self.spanning), default=0.0)
