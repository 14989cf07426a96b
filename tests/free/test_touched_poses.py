"""Free motions between poses that touch limits: a pose, and no motion, decides what is reached there."""

import numpy as np
import pytest

import cspr_jax
from cspr_jax.errors import ConfigError

SMALL, RADIUS = 1e-6, 0.26
ROBOT = cspr_jax.load_robot("prototype")
SPOOLS = np.asarray(ROBOT.base_points)
TARGET, LEVEL, HANGING = [0.3, 0.2, 1.5], [0.05, 0.0, 1.5], [0.0, 0.0, 1.4]
# Largest length of a cable at the target; tensions of the mass that hangs below the middle of the spools.
LONGEST = np.linalg.norm(SPOOLS - TARGET, axis=1).max()
HELD = 0.198 * 9.81 / 3.0 * np.hypot(RADIUS, 1.4) / 1.4
# Poses, and a limit that they touch, less a share of it.
CASES = {
    "floor at the end": ([HANGING, TARGET], lambda share: {"floor": 1.5 - share * RADIUS}),
    "floor at both ends": ([LEVEL, TARGET], lambda share: {"floor": 1.5 - share * RADIUS}),
    "longest cable": ([HANGING, TARGET], lambda share: {"cable_length_max": LONGEST * (1.0 - share)}),
    "tension at rest": ([HANGING, [0.0, 0.0, 1.5]], lambda share: {"tension_max": HELD * (1.0 - share)}),
}


@pytest.mark.ci("floor at both ends", "tension at rest")
@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_poses_touch_limits(name):
    """A motion is found at the limit and a millionth inside; a millionth outside no motion can have the pose."""
    positions, limit = CASES[name]
    poses = [{"position": position} | ({"rest": True} if name == "tension at rest" else {}) for position in positions]
    keys = {"schema": 1, "robot": "prototype", "family": "free", "z0": 1.4, "pose": poses}
    for share in (-SMALL, 0.0):
        planned = cspr_jax.plan(keys | {"limits": {"tension_max": 1.6} | limit(share)})
        assert planned.feasible, (share, planned.warnings)
    with pytest.raises(ConfigError, match="must be"):
        cspr_jax.plan(keys | {"limits": {"tension_max": 1.6} | limit(SMALL)})
