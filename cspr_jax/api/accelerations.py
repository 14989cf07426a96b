"""Feasible accelerations of point masses from Python."""

import dataclasses

import numpy as np

from cspr_jax.api.argument_checks import checked
from cspr_jax.api.arguments import points_of
from cspr_jax.arithmetic.elementary import double_precision
from cspr_jax.arithmetic.frames import Frame
from cspr_jax.errors import InputError
from cspr_jax.motions.given_limits import limits_over
from cspr_jax.robots.kernel_axes import prepared
from cspr_jax.robots.limits import Limits
from cspr_jax.robots.point_mass import PointMassRobot
from cspr_jax.robots.wrench_sets import Faces, spanning
from cspr_jax.schema.verdicts import FLAGS
from cspr_jax.workspaces import acceleration_search as search


@dataclasses.dataclass(frozen=True)
class AvailableAccelerations:
    """Accelerations that the cables of a point mass can give at n places, as faces; float64.

    An acceleration a is feasible where `normals @ a >= offsets`.

    Fields:
        positions: (n, 3) in the robot's axes, m.
        normals: (n, n_faces, 3) unit normals that point inside, in the robot's axes; 0 of a face that bounds nothing.
        offsets: (n, n_faces) m/s^2; -inf of a face that bounds nothing.
        cables: (n_faces, dof - 1) numbers of the cables that are parallel to the face, from 0 on.
        of_largest: (n, n_faces) whether a cable has its largest tension on the face.
    """

    positions: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray
    cables: np.ndarray
    of_largest: np.ndarray
    _robot: PointMassRobot
    _faces: Faces
    _frame: Frame

    @checked
    def margin(self, accelerations) -> np.ndarray:
        """Distance of accelerations from the nearest face.

        Args:
            accelerations: (3,) one for all places, or (n, 3) one a place, in the robot's axes, m/s^2.

        Returns:
            (n,) m/s^2: positive where they are feasible, inf where nothing bounds them; negative where they are not,
            and then no smaller than the distance from those that are.

        Raises:
            InputError: another shape, or not finite.
        """
        return self._judged(accelerations)[0]

    @checked
    def verdict(self, accelerations) -> np.ndarray:
        """Verdicts of accelerations.

        Args:
            accelerations: as for `margin`.

        Returns:
            (n,) flags of `Verdict`; 0 is feasible. A margin within 1e-9 of gravity, or of its rounding, is undecided.

        Raises:
            InputError: another shape, or not finite.
        """
        return self._judged(accelerations)[1].astype(FLAGS)

    def _judged(self, accelerations) -> tuple[np.ndarray, np.ndarray]:
        vectors = np.asarray(accelerations, float)
        if vectors.shape not in ((3,), self.positions.shape):
            allowed = f"finite numbers of shape (3,) or {self.positions.shape}"
            raise InputError("accelerations", f"shape {vectors.shape}", allowed)
        if self._robot.dof == 2 and vectors[..., 1].any():
            raise InputError("accelerations", "y not 0", "y = 0: the plane of a planar robot")
        turned = np.asarray(self._frame.turned(np.broadcast_to(vectors, self.positions.shape)))
        with double_precision():
            return search.judged(self._robot, self._faces, self._frame.inward(self.positions), turned)


@checked
def available_accelerations(
    robot: PointMassRobot, positions, *, tension_min=None, tension_max=None
) -> AvailableAccelerations:
    """Feasible accelerations of a point mass on any number of cables, Boralugoda (2) to (6) and beyond.

    Args:
        robot: a point mass in space or in a plane.
        positions: (n, 3) in the robot's axes, m.
        tension_min: smallest tension, () or (n_cables,) N; None: the robot's, else 0.
        tension_max: largest tension, likewise; None: the robot's, else none.

    Returns:
        the set at each place.

    Raises:
        InputError: another kind of robot, shapes that do not fit, values that are not finite, tensions that contradict
            each other.
    """
    if not isinstance(robot, PointMassRobot):
        raise InputError("robot", getattr(robot, "name", robot), "a point mass")
    places = points_of("positions", positions)
    if robot.dof == 2 and places[:, 1].any():
        raise InputError("positions", "y not 0", "y = 0: the plane of a planar robot")
    with double_precision():
        limits = limits_over(robot, Limits(tension_min=tension_min, tension_max=tension_max))
        prepared_robot, frame = prepared(robot)
        faces = search.faces_of(prepared_robot, limits, frame.inward(places))
    cables = np.tile(spanning(robot.n_cables, robot.dof), (2, 1))
    normals, offsets, of_largest = map(np.asarray, (frame.turned(faces.normals), faces.offsets, faces.of_largest))
    return AvailableAccelerations(places, normals, offsets, cables, of_largest, prepared_robot, faces, frame)
