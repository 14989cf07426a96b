"""What motions along paths miss between nodes: bounds against samples by a reference, of several motions as of each."""

from functools import partial

import numpy as np
import pytest
from oracles import any_motion_cases, least_time_bounds, path_rows
from support.least_time import robot_of, sampled_states, section_of

from cspr_jax.families.paths.geometry.section import SectionSettings
from cspr_jax.families.paths.least_time.discrete import discretes
from cspr_jax.families.paths.least_time.jumping import jumping_motions
from cspr_jax.families.paths.least_time.tightening import Trial, cell_slacks
from cspr_jax.families.paths.least_time.timed import timed
from cspr_jax.motion.amplitudes import named
from cspr_jax.motion.motion import Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.elementary import as_float64, double_precision
from cspr_jax.robots.model.limits import Limits
from cspr_jax.robots.statics.kernel_axes import centred

CELLS, SHARES = 40, np.linspace(1e-9, 1.0 - 1e-9, 9)


class Called:
    """A motion as the reference takes it."""

    def __init__(self, motion):
        self.state = motion


@pytest.mark.parametrize("kind", ["3T-3", pytest.param("3T-4", marks=pytest.mark.thorough)])
def test_bounds_over_cells_hold_the_smallest_slacks(kind):
    rng = np.random.default_rng(5)
    robot, reference, ranges, _ = any_motion_cases.random_robot(rng, kind)
    prepared, frame = centred(robot_of(robot))
    weight, ones = robot["mass"] * robot["gravity"], np.ones(prepared.n_cables)
    pace = np.sqrt(9.81 * np.max(ranges))
    values = {
        "tension_min": 0.02 * weight * ones,
        "tension_max": 2.0 * weight * ones,
        "cable_speed_max": 0.6 * pace * ones,
        "cable_acceleration_max": 0.5 * 9.81 * ones,
    }
    problem = Problem(prepared, Limits(**{name: as_float64(value) for name, value in values.items()}), named("A1"))
    points = [reference + 0.5 * ranges * rng.uniform(-1.0, 1.0, (5, 3)) for _ in range(2)]
    with double_precision():
        sections = [section_of(path_rows.through(each), frame) for each in points]
        paths = discretes(problem, sections, [SectionSettings(CELLS, 0.0)] * 2)
        motions = [
            timed(path.section, path.grid, motion.run)
            for path, motion in zip(paths, jumping_motions(paths), strict=True)
        ]
        trials = [Trial(motion, np.full(len(motion.knots) - 1, np.inf)) for motion in motions]
        together, alone = cell_slacks(problem, trials), [cell_slacks(problem, [trial])[0] for trial in trials]
    assert len(motions[0].knots) != len(motions[1].knots) or not np.array_equal(motions[0].knots, motions[1].knots)
    for motion, slacks, same in zip(motions, together, alone, strict=True):
        np.testing.assert_allclose(slacks.low, same.low, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(slacks.high, same.high, rtol=1e-9, atol=1e-12)
        knots = np.asarray(motion.knots)
        times = knots[:-1, None] + np.diff(knots)[:, None] * SHARES
        sampled = least_time_bounds.slacks(
            robot, values, Called(partial(sampled_states, Placed(motion, frame))), times.ravel()
        )
        units = {"N": ("tension", weight), "m/s": ("cable_speed_max", 0.6 * pace)}
        units["m/s^2"] = ("cable_acceleration_max", 0.5 * 9.81)
        for unit, (name, scale) in units.items():
            of_unit = [row.unit == unit for row in slacks.criteria]
            least = np.asarray(sampled[name]).reshape(len(times), -1).min(1) / scale
            low, high = slacks.low[:, of_unit].min(1), slacks.high[:, of_unit].min(1)
            assert (low <= least + 1e-9).all()
            # Slacks between the samples are smaller by little.
            assert (high >= least - 1e-3).all()
            assert np.median(high - low) < 2e-3
    assert any((slacks.low < 0.0).any() for slacks in together)
