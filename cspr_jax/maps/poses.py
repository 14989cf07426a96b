"""Maps of smallest numbers of arcs of platforms to poses."""

import numpy as np

from cspr_jax.arithmetic.batches import in_parts
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.config.trajectory import WITHOUT_BETA_HAT
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.feasibility.platform.checker import MANY, PoseChecker
from cspr_jax.feasibility.platform.end_acceleration import AT_REST
from cspr_jax.maps.grid_map import PlatformMap
from cspr_jax.problem import given_quaternion, motion_kind, orientations
from cspr_jax.robots.point_mass import rest_point
from cspr_jax.robots.reference_pose import reference_pose
from cspr_jax.schema.tiles import Grid
from cspr_jax.search.answers import joined
from cspr_jax.search.beta_hat import OPTIONS
from cspr_jax.search.platform_answers import PoseAnswers, reached
from cspr_jax.search.platform_arcs import CANDIDATES, Candidates
from cspr_jax.search.pose_ends import end_options

# Time functions of the rotation with a beta-hat of its own at each end.
_OWN = (None, "beta_ff")
TILT_TORSION = ("tilt_azimuth", "tilt", "torsion")


class PosesMap(PlatformMap):
    """The smallest number of arcs to each pose; see `GridMap`."""

    def __init__(self, spec: RobotFile, keys: SweepFile, file: object) -> None:
        """Refuse a start that is no pose."""
        super().__init__(spec, keys, file)
        start = keys.trajectory.start
        self._quaternion = given_quaternion(
            None if start is None else start.quaternion, "trajectory.from.quaternion", file
        )
        from_rest = start is None or start.rest
        self._checker = PoseChecker(self._problem, motion_kind(keys.trajectory, from_rest=from_rest), batch=MANY)

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        at_a_time = CANDIDATES // (OPTIONS if self._keys.trajectory.beta_hat is None else 1)

        def part(which: slice) -> PoseAnswers:
            return self._answers({name: x[which] for name, x in cells.items()})

        found = joined(in_parts(part, len(cells["z0"]), at_a_time))
        return vars(found) | {"beta_hat": found.beta_hat[:, 1]}

    def _answers(self, cells: dict[str, np.ndarray]) -> PoseAnswers:
        z0, targets = np.asarray(cells["z0"], float), self._targets(cells)
        angles = np.stack([cells.get(name, np.zeros(len(z0))) for name in TILT_TORSION], axis=1)
        poses = (targets, orientations(self._frame, targets, angles))
        given, beat = self._keys.trajectory.beta_hat, self._keys.trajectory.beat
        values, can_end = end_options(self._problem.robot, *poses, z0, 1 if given == "preferred" else OPTIONS)
        if beat in WITHOUT_BETA_HAT:
            values = np.zeros((len(z0), 1))
        elif isinstance(given, float):
            values = np.full((len(z0), 1), given)
        values = np.where(can_end[:, None], values, np.nan)
        every = self._candidates(z0, poses)
        return reached(self._checker, every, values, max_arcs=self._keys.trajectory.max_arcs, same=beat not in _OWN)

    def _candidates(self, z0: np.ndarray, ends: tuple[np.ndarray, np.ndarray]) -> Candidates:
        # One of each cell.
        count, start = len(z0), self._keys.trajectory.start
        if start is None or start.position is None:
            first, bend = (rest_point(z0), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))), np.full(count, AT_REST)
        else:
            depths, own = np.unique(z0, return_inverse=True)
            place = np.tile(self._frame.inward(start.position), (len(depths), 1))
            turned = np.tile(self._frame.turned_quaternions(self._quaternion), (len(depths), 1))
            if start.tilt_torsion is not None:
                angles = np.tile(start.tilt_torsion, (len(depths), 1))
                turned = orientations(self._frame, place, angles)
            values = end_options(self._problem.robot, place, turned, depths, 1)[0][:, 0]
            chosen = np.where(np.isnan(values), AT_REST, values)
            bend = chosen[own] if start.beta_hat is None else np.full(count, start.beta_hat)
            first = (place[own], turned[own])
        return Candidates(first, ends, z0, np.arange(count), (bend, bend))

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse targets that are all out of reach, and a robot that hangs nowhere; see `GridMap.refuse_hopeless`."""
        super().refuse_hopeless(grid)
        errors = []
        for z0 in grid.axes["z0"]:
            try:
                reference_pose(self._problem.robot, float(z0))
            except InputError as error:
                errors.append(error)
        if len(errors) == len(grid.axes["z0"]):
            raise ConfigError(self._file, f"robot.{errors[0]}") from errors[0]
