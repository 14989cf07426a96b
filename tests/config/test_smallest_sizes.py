"""One rule for sizes, times, rates and limits: from 1e-9 to 1e9 in SI units, or zero where zero is allowed."""

import numpy as np
import pytest

import cspr_jax
from cspr_jax.errors import ConfigError, CsprError
from cspr_jax.runtime.process_environment import shortage

LINE = {"kind": "line", "points": [[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]]}
CIRCLE = {"centre": [0.0, 0.0, 2.0], "radius": 0.2}
ARC = {"kind": "arc", "centre": [0.0, 0.0, 1.0], "start": [0.1, 0.0, 1.0], "angle": 1.0}
QUINTIC = {"kind": "quintic", "points": [[0.0, 0.0, 1.0], [2e-9, 0.0, 1.0], [0.1, 0.0, 1.0]]}
BLEND = {"kind": "polyline", "points": [*LINE["points"], [0.1, 0.1, 1.2]], "corner": "blend"}


def of_path(**path):
    return {"family": "path", "path": path}


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (of_path(**LINE, ramp_time=1e-300), "path.ramp_time = 1e-300: must be at least 1e-09"),
        (of_path(**LINE, start_speed=1e-320), "path.start_speed = 1e-320: must be at least 1e-09"),
        (of_path(**BLEND, blend_tolerance=1e-300), "path.blend_tolerance = 1e-300: must be at least 1e-09"),
        (of_path(**ARC, normal=[0.0, 1e-300, 0.0]), "path.normal = [0.0, 1e-300, 0.0]: must be a direction, of length"),
        (of_path(**ARC | {"angle": 1e-300}), "path.angle = 1e-300: must be an angle of 1e-09 at least"),
        (of_path(**QUINTIC), "path.points[1] = [2e-09, 0.0, 1.0]: must be at least 1e-06 of the longest step"),
        (of_path(**LINE) | {"limits": {"cable_speed_max": 1e-320}}, "cable_speed_max = 1e-320: must be at least 1e-09"),
        (of_path(**LINE) | {"limits": {"tension_max": [1.0, 1e-320, 1.0]}}, "1e-320: must be at least 1e-09"),
        (of_path(**LINE) | {"limits": {"speed_max": 1e-10}}, "speed_max = 1e-10: must be at least 1e-09"),
        (
            {"family": "ellipse", "ellipse": CIRCLE | {"frequency": 1e-300}},
            "frequency = 1e-300: must be at least 1e-09",
        ),
        ({"family": "ellipse", "ellipse": CIRCLE | {"radius": 1e-300}}, "ellipse.radius = 1e-300: must be at least"),
        ({"family": "ellipse", "ellipse": CIRCLE | {"normal": [0.0, 1e-300, 0.0]}}, "must be a direction, of length"),
    ],
)
def test_keys_near_the_ends_of_the_floats(keys, line):
    with pytest.raises(ConfigError) as caught:
        cspr_jax.plan({"schema": 1, "robot": "prototype"} | keys)
    assert line in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [1e-320, 1e-10])
def test_arguments_near_the_ends_of_the_floats(value):
    times, places = np.arange(4.0), np.array([[0.0, 0.0, 1.5]] * 4)
    with pytest.raises(CsprError, match=r"cable_speed_max = .*: must be .*at least 1e-09"):
        cspr_jax.check("prototype", times=times, positions=places, limits={"cable_speed_max": value})
    with pytest.raises(CsprError, match=r"smooth = .*: must be .*1e-09"):
        cspr_jax.check("prototype", times=times, positions=places, smooth=value)


def test_too_little_memory_is_a_line():
    for error in (
        MemoryError(),
        ImportError("libjax_common.so: failed to map segment from shared object"),
        RuntimeError("INTERNAL: Unable to allocate section memory!"),
        RuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 800 bytes."),
    ):
        assert "ulimit -v" in (shortage(error) or "")
    assert shortage(ImportError("No module named 'jax'")) is None
