"""Maps of the oscillations needed at each time of a transition, and of the envelopes."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from cspr_jax.errors import ConfigError
from cspr_jax.families.swings.decide import BATCH
from cspr_jax.families.swings.transitions import envelope_oscillations as counts
from cspr_jax.families.swings.transitions.envelopes import lower_envelope
from cspr_jax.families.swings.transitions.oscillations import transitions_to
from cspr_jax.families.swings.transitions.oscillations_map import MinimumOscillationsMap
from cspr_jax.families.swings.transitions.transition import inclination, weights
from cspr_jax.motion.amplitudes import Amplitude
from cspr_jax.numerics.batches import in_batches
from cspr_jax.numerics.elementary import maximum_of, minimum_of
from cspr_jax.schema.tiles import Grid

# An envelope may lie below zero by this much at the number of oscillations that keeps it positive.
_CHECK_ERROR = 1e-7


@jax.jit
def _at_times(amplitude: Amplitude, arguments) -> tuple[jax.Array, ...]:
    def one(w, v, tau, cable):
        inside = jnp.abs(v) < 1.0
        v = jnp.where(inside, v, 0.0)
        n = counts.least_oscillations(amplitude, w, v)
        squared = jax.vmap(lambda k: counts.squared_oscillations_at(amplitude, k, v, tau))(w)
        envelope = jax.vmap(lambda k: lower_envelope(amplitude, k, v, n, tau))(w)
        # Cable 0 means all cables.
        index = jnp.maximum(cable - 1, 0)
        numbers = (
            n,
            jnp.where(cable > 0, squared[index], maximum_of(squared)),
            jnp.where(cable > 0, envelope[index], minimum_of(envelope)),
        )
        return tuple(jnp.where(inside, value, jnp.nan) for value in numbers)

    return jax.vmap(one)(*arguments)


class TransitionEnvelopesMap(MinimumOscillationsMap):
    """Squared numbers of oscillations, and envelopes, at each time; see `GridMap`."""

    proves = False
    any_cables = False  # envelopes need pseudotensions that the motion determines

    def __call__(self, cells: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Answers of the cells of a tile; see `GridMap.__call__`."""
        targets = self._targets(cells)
        z0 = self._depths(cells, targets)
        segments = transitions_to(self._problem, targets, z0)
        v, w = np.asarray(inclination(segments)), np.asarray(weights(segments))
        cable = np.asarray(cells.get("cable", np.zeros(len(v)))).astype(int)
        kernel = partial(_at_times, self._problem.amplitude)
        n, squared, envelope = in_batches(kernel, (w, v, cells["tau"], cable), batch_size=BATCH)
        return {
            "least_oscillations": n,
            "squared_oscillations": squared,
            "lower_envelope": envelope,
            "used_inclination": v,
            "used_z0": z0,
        }

    def refuse_hopeless(self, grid: Grid) -> None:
        """Refuse cables that the robot does not have; see `GridMap.refuse_hopeless`."""
        n_cables = self._problem.robot.n_cables
        if "cable" in grid.axes and not np.isin(grid.axes["cable"], np.arange(1, n_cables + 1)).all():
            raise ConfigError(self._file, f"axes.cable: must be numbers of cables, from 1 to {n_cables}")
        super().refuse_hopeless(grid)

    def contradictions(self, answers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells whose numbers contradict each other; see `GridMap.contradictions`."""
        return {"an envelope below zero at its own number of oscillations": answers["lower_envelope"] < -_CHECK_ERROR}
