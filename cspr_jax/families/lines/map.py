"""Maps of least durations along straight lines from one position."""

import numpy as np

from cspr_jax.families.lines.least_time import least_times
from cspr_jax.maps.from_positions import FromPositionsMap
from cspr_jax.schema.verdicts import Verdict


class LeastTimeMap(FromPositionsMap):
    """The least duration of the S-model to each target; see `GridMap`."""

    proves = True

    any_cables = True

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        spec = self._keys.trajectory
        largest = np.inf if spec.max_acceleration is None else spec.max_acceleration
        starts, ends = self._starts(cells), self._targets(cells)
        return least_times(self._problem, starts, ends, max_acceleration=largest).arrays()

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        feasible, duration, minimum = answers["verdict"] == 0, answers["duration"], answers["least_duration"]
        p, undecided = answers["acceleration_time"], answers["verdict"] == Verdict.UNDECIDED.value
        return {
            "a feasible cell without a duration": feasible & ~(duration >= 0.0),
            "a duration below the least one": feasible & ~(duration >= minimum * (1.0 - 1e-9)),
            "a time of acceleration outside of the duration": feasible & ~((p >= 0.0) & (p <= duration)),
            "an infeasible cell with a duration": ~feasible & ~undecided & np.isfinite(duration),
            "rest at both ends of a feasible cell is none": feasible & ~(answers["rest_margin"] > 0.0),
        }
