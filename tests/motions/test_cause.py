"""Causes in words."""

import pytest

from cspr_jax.motion.cause import Cause


@pytest.mark.parametrize("needed", [0.0, -0.0, 1e-17, -1e-12])
def test_a_pose_at_a_spool_is_on_the_plane(needed):
    """No height is told that is none, and none with the sign of zero."""
    assert Cause("above_spools", t=1.0, needed=needed, allowed=0.0, unit="m").text == (
        "on the plane of the spools at t = 1.00 s"
    )


def test_a_height_above_the_plane():
    text = Cause("above_spools", t=1.0, needed=-0.25, allowed=0.0, unit="m").text
    assert text == "0.25 m above the plane of the spools at t = 1.00 s"
    assert "-0 N" not in Cause("wrench_infeasible", needed=0.0, allowed=0.0, unit="N").text
