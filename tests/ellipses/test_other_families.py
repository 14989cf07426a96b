"""Ellipses between legs of other families: states meet, and what does not meet is refused."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from support.commands import plan as command

import cspr_jax
from cspr_jax.errors import ConfigError

TARGET, NATURAL = [0.6, 0.3, 1.7], np.sqrt(9.81 / 2.0)
LINE = {"centre": [0.0, 0.0, 1.7], "half_axes": [[0.6, 0.3, 0.0]]}
SWINGS = [
    {"rest": True},
    {"position": TARGET, "ellipse": LINE},
    {"family": "ellipse", "turns": 2.0, "position": TARGET},
    {"rest": True},
]
ON_ELLIPSE = {
    "position": [0.1, 0.0, 2.0],
    "time": 3.0,
    "velocity": [0.0, 0.08 * NATURAL, 0.0],
    "acceleration": [-0.1 * NATURAL**2, 0.0, 0.0],
    "ellipse": {"centre": [0.0, 0.0, 2.0], "half_axes": [[0.1, 0.0, 0.0], [0.0, 0.08, 0.0]]},
}


def swings(**changes):
    return {"schema": 1, "robot": "prototype", "family": "transition", "z0": 1.7, "pose": SWINGS} | changes


def assert_meeting(motions):
    for before, after in itertools.pairwise(motions):
        last, first = before.state(jnp.asarray(1.0)), after.state(jnp.asarray(0.0))
        for a, b in zip(last[:3], first[:3], strict=True):
            np.testing.assert_allclose(a, b, atol=1e-9)


@pytest.mark.thorough
def test_swings_go_over_into_a_line():
    """A transition ends with the acceleration of the pendulum that the line at its natural frequency is."""
    result = cspr_jax.plan(swings())
    assert result.feasible and [leg.family for leg in result.legs] == ["transition", "ellipse", "transition"]
    assert_meeting(result.motions)
    assert result.answers.duration[1] == pytest.approx(2.0 * 2.0 * np.pi / np.sqrt(9.81 / 1.7))


@pytest.mark.thorough
def test_a_spline_goes_over_into_an_ellipse():
    poses = [{"position": [0.0, 0.0, 2.0]}, ON_ELLIPSE, {"family": "ellipse", "turns": 1.0}]
    result = cspr_jax.plan(
        {"schema": 1, "robot": "prototype", "family": "spline", "interpolation": "quintic", "pose": poses}
    )
    assert result.feasible
    assert_meeting(result.motions)


def test_another_frequency_does_not_meet_a_swing():
    poses = [SWINGS[0], SWINGS[1] | {"ellipse": LINE | {"frequency": 2.0}}, *SWINGS[2:]]
    with pytest.raises(ConfigError, match="acceleration goes on"):
        cspr_jax.plan(swings(pose=poses))


def test_places_of_ellipses_alone_are_refused(tmp_path):
    content = (
        'schema = 1\nrobot = "prototype"\nfamily = "ellipse"\n[[pose]]\n'
        "ellipse = { centre = [0, 0, 2], radius = 1 }\n[[pose]]\nturns = 1\nposition = [1, 0, 2]\n"
    )
    code, _, error = command(tmp_path, content)
    assert code == 2 and "pose[1].position" in error and "must be absent on an ellipse" in error
