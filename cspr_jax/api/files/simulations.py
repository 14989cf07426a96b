"""Simulations of plans that winches drive, from Python, as by `cspr simulate`."""

from __future__ import annotations

import dataclasses

from matplotlib.figure import Figure

from cspr_jax.api.arguments.checks import checked
from cspr_jax.api.files.pictured import Pictured
from cspr_jax.api.files.replays import PlanOrFile
from cspr_jax.api.plans import NAME, Plan, plan
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import NotNegative, NotNegativeOrNone, Positive, Seed
from cspr_jax.errors.suggestions import with_suggestions
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.outputs.mujoco import simulation
from cspr_jax.outputs.mujoco.closed_loop import Loop
from cspr_jax.outputs.mujoco.module import need_mujoco
from cspr_jax.outputs.plots.films.simulation import simulation_figure

DEFAULT = Loop()


@with_suggestions
@dataclasses.dataclass(frozen=True)
class Simulation(Pictured, simulation.Simulated):
    """A plan, and its motion as winches drive it; see `cspr_jax.outputs.mujoco.simulation.Simulated` for the fields."""

    def _figure(self) -> Figure:
        return simulation_figure(self)


@checked()
def simulate(  # noqa: PLR0913
    given: PlanOrFile,
    *,
    rate: Positive = DEFAULT.rate,
    bandwidth: NotNegative = DEFAULT.bandwidth,
    delay: NotNegative = DEFAULT.delay,
    encoder_counts: NotNegativeOrNone = None,
    noise: NotNegative = DEFAULT.noise,
    damping_time: NotNegative = DEFAULT.damping_time,
    mass_factor: Positive = DEFAULT.mass,
    friction_factor: NotNegative = DEFAULT.friction,
    stiffness_factor: Positive = DEFAULT.stiffness,
    seed: Seed = DEFAULT.seed,
    anyway: bool = False,
) -> Simulation:
    """Drive a plan by its winches in MuJoCo: motors under control turn drums, and elastic cables move the effector.

    Each motor gets the torque of its set points, and in proportion to the errors of its measured angle and speed what
    makes a rotor with its part of the effector's mass a critically damped oscillator.

    Args:
        given: a plan, a plan file, or a dictionary, as for `plan`; its robot has `axial_stiffness` and `[winch]` with
            `motor_inertia`.
        rate: ticks of the controller a second, Hz.
        bandwidth: natural frequency of the position loop of each motor, rad/s; 0: set points alone, without feedback.
        delay: time from a measurement to the torque that follows from it, s.
        encoder_counts: counts of the encoders a turn; 0: exact angles; None: those of the robot file, else 4096.
        noise: standard deviation of measured angles, rad.
        damping_time: time constant of the damping of cables, s: a rate of stretch v counts as a stretch of v times it.
        mass_factor: mass and inertia of the effector over those of the plan.
        friction_factor: friction of the winches over that of the set points.
        stiffness_factor: stiffness of the cables over that of the robot file.
        seed: seed of the noise.
        anyway: whether to drive a plan even if it is not feasible.

    Returns:
        planned and driven motion, tensions and torques at the ticks.

    Raises:
        ConfigError: MuJoCo is not installed; the plan has a mistake, is not feasible or has no finite motion; its robot
            lacks numbers of cables or winches; or the rate gives too many ticks.
    """
    need_mujoco()
    planned = given if isinstance(given, Plan) else plan(given)
    if not (planned.feasible or anyway):
        raise ConfigError(NAME, "not driven, since a segment is not proved feasible (anyway=True drives it)")
    if delay > simulation.LARGEST_DELAY:
        raise InputError("delay", delay, f"a number from 0 to {simulation.LARGEST_DELAY:g}, in s")
    factors = {"mass": mass_factor, "friction": friction_factor, "stiffness": stiffness_factor}
    loop = Loop(rate, bandwidth, delay, encoder_counts, noise, damping_time, **factors, seed=seed)
    with double_precision():
        simulation_result = simulation.simulate(planned, loop)
    return Simulation(
        **{field.name: getattr(simulation_result, field.name) for field in dataclasses.fields(simulation_result)}
    )
