"""Sample CSPR3DOF of batotp: a point mass on three cables along a cubic spline, from rest to rest in the least time.

`batotp_sample.toml` holds data and settings, and names their source. The motion found here takes less time than
batotp's and is proved to keep all limits; the output of batotp (not in this package) breaks some of them. A lower bound
holds for all motions along the same path.
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from cspr_jax.config.reading import read_toml
from cspr_jax.curves.spline import Spline
from cspr_jax.families.paths.geometry.section import Section, SectionSettings
from cspr_jax.families.paths.least_time.least_time import least_time_motion
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds.piecewise_bounds import bernstein_of_powers
from cspr_jax.numerics.elementary import as_float64
from cspr_jax.published.chapter_1 import Key
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.model.point_mass import point_mass_robot
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.verification.proved_answers import proved_answers

# 200 cells for each segment, as in the sample of batotp.
CELLS = 3800
VARIANT = "batotp's sample CSPR3DOF"
PUBLISHED = {
    ("least time along the path", "T, s, as shipped", VARIANT): "19.900",
    ("least time along the path", "T, s, finest step", VARIANT): "19.876",
}


def sample() -> dict[str, Any]:
    """Data of the sample."""
    return read_toml(Path(__file__).with_name("batotp_sample.toml"))


def least_time(cells: int = CELLS) -> dict[Key, float | None]:
    """The proved time along the path, under both printed ones as keys, and a lower bound of the time of all motions."""
    spec = sample()
    robot, frame = centred(point_mass_robot(spec["base_points"], mass=1.0, gravity=spec["gravity"]))
    problem = Problem(robot, _limits(spec["limits"], robot.n_cables), named("quintic"))
    segments = np.arange(float(len(spec["points"])))
    powers = np.moveaxis(CubicSpline(segments, spec["points"]).c[::-1], 0, 1)
    curve = Spline(as_float64(segments), as_float64(frame.inward(bernstein_of_powers(powers))), None)
    section = Section(curve, np.full(len(powers), np.inf), segments)
    minimum = least_time_motion(problem, section, SectionSettings(cells, 0.0))
    is_proved = proved_answers(problem, [minimum.motion], None).verdict[0] == 0
    values = dict.fromkeys(PUBLISHED, minimum.duration if is_proved else None)
    bound = minimum.lower_bound if np.isfinite(minimum.lower_bound) else None
    return values | {("least time along the path", "lower bound, s", VARIANT): bound}


def _limits(spec: dict[str, float], n_cables: int) -> Limits:
    # Limits are tensions over the mass; with a mass of 1 kg they are tensions.
    def of_cables(name: str):
        return as_float64(np.full(n_cables, spec[name]))

    return Limits(
        tension_min=of_cables("tension_min_per_mass"),
        tension_max=of_cables("tension_max_per_mass"),
        cable_speed_max=of_cables("cable_speed_max"),
        cable_acceleration_max=of_cables("cable_acceleration_max"),
        speed_max=as_float64(spec["speed_max"]),
    )
