"""States of motions at many instants: motions of one kind share what is compiled, and so do numbers of instants."""

import jax
import numpy as np

from cspr_jax.motion.motion import Motion, common_shape
from cspr_jax.robots.model.state import State

# Instants that are computed together.
FEW, MANY = 64, 1024


@jax.jit
def _states(motion: Motion, tau) -> State:
    return jax.vmap(motion.state)(tau)


def states_along(motion: Motion, tau) -> State:
    """States at normalised times of any shape, NumPy."""
    tau = np.asarray(tau, float)
    size = FEW if tau.size <= FEW else -(-tau.size // MANY) * MANY
    found = _states(common_shape(motion), np.resize(tau, size))
    return jax.tree.map(lambda x: np.asarray(x)[: tau.size].reshape(*tau.shape, *x.shape[1:]), found)
