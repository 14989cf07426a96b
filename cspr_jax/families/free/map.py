"""Maps of the least durations of free motions from one position to each target."""

import numpy as np
from jax import Array

from cspr_jax.config.keys.path import SAME_PLACE
from cspr_jax.config.robot import RobotFile
from cspr_jax.config.sweep import SweepFile
from cspr_jax.curves.spline import Spline, SplineBatch
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.families.free.batch import free_motions
from cspr_jax.families.free.poses import FreePoses, check_searched
from cspr_jax.families.free.search.time_bounds import time_bounds
from cspr_jax.families.free.static_poses import OF_POSITIONS
from cspr_jax.maps.proved_map import ProvedMap, proved_columns
from cspr_jax.motion.answers import Answers
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.robots.model.point_mass import rest_point
from cspr_jax.schema.verdicts import FLAGS, Verdict
from cspr_jax.verification.proved_answers import answers_of, proofs_of, verify_all_robots


class FreeMap(ProvedMap):
    """The least duration that a search finds among all motions to each target; see `GridMap`."""

    from_rest = True
    motors = True

    def __init__(self, robot_file: RobotFile, spec: SweepFile, file: object) -> None:
        """Refuse a rest without a position, and cables without a largest tension; see `ProvedMap`."""
        super().__init__(robot_file, spec, file)
        start = spec.trajectory.start
        self._rests = start is not None and start.rest
        if self._rests and spec.axes.z0 is None:
            raise ConfigError(file, "axes.z0 is missing: depth of P0, m, in which trajectory.from.rest = true is")
        try:
            check_searched(self._problem)
        except InputError as error:
            raise ConfigError(file, str(error)) from error

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        ends, z0 = self._targets(cells), cells.get("z0")
        starts = rest_point(np.asarray(z0)) if self._rests else self._start_positions(cells)
        at_ends, at_starts = self._at_rest(ends), self._at_rest(starts)
        stays = np.linalg.norm(ends - starts, axis=1) <= SAME_PLACE
        out = np.array(
            [(a.verdict | b.verdict) & OF_POSITIONS for a, b in zip(at_ends.proof, at_starts.proof, strict=True)]
        )
        columns = proved_columns(at_ends)
        for name, column in columns.items():
            column[~stays] = 0 if name == "verdict" else np.nan
        columns["verdict"][~stays] = np.where(out == 0, Verdict.UNDECIDED, out)[~stays].astype(FLAGS)
        for name in ("duration", "lower_bound"):
            columns[name] = np.where(stays & at_ends.feasible, 0.0, np.nan)
        moves = np.flatnonzero(~stays & (out == 0))
        if len(moves):
            self._search(columns, moves, starts, ends, z0)
        return columns

    def _search(
        self,
        columns: dict[str, np.ndarray],
        cells: np.ndarray,
        starts: np.ndarray,
        ends: np.ndarray,
        z0: np.ndarray | None,
    ) -> None:
        # Fill in the answers of some cells.
        pairs = np.stack([starts[cells], ends[cells]], axis=1)
        units = None if self._unit is None else self._frame.rotated_quaternions(np.tile(self._unit, (2, 1)))
        accelerations = np.full((2, 3 if units is None else 6), np.nan)
        accelerations[:1] = 0.0 if self._rests else np.nan
        depths = pairs[..., 2].mean(1) if z0 is None else z0[cells]
        poses = [
            FreePoses(pair, units, np.zeros((2, 3)), accelerations, depth)
            for pair, depth in zip(pairs, depths.tolist(), strict=True)
        ]
        lines = [Spline(as_float64(np.array([0.0, 1.0])), as_float64(pair[None]), self._turning()) for pair in pairs]
        columns["lower_bound"][cells] = time_bounds(self._problem, lines)
        motions = free_motions(self._problem, self._scene, poses)
        if len(motions.indices):
            reached, answers = cells[motions.indices], motions.answers
            columns["duration"][reached] = np.where(answers.feasible, answers.duration, np.nan)
            for name, column in proved_columns(answers).items():
                columns[name][reached] = column

    def _at_rest(self, positions: np.ndarray) -> Answers:
        # Return motions that stay at rest for one second at each position.
        motions = [
            Spline(as_float64(np.array([0.0, 1.0])), as_float64(position[None, None]), self._turning())
            for position in positions
        ]
        splines = SplineBatch(motions)
        proofs = proofs_of(self._problem, splines.bounds, splines.durations, self._scene, splines.jumps)
        answers = answers_of(proofs, splines.durations)
        verify_all_robots(self._problem, answers, motions, self._scene)
        return answers

    def _turning(self) -> Array | None:
        if self._unit is None:
            return None
        return as_float64(self._frame.rotated_quaternions(self._unit[None])[None])
