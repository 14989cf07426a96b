"""Natural frequencies of plans whose robots have elastic cables, and warnings about swings near them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cspr_jax.build.robots import build_robot
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile
from cspr_jax.machine.motion_frequencies import NOT_TAUT, FrequenciesAt, MotionFrequencies, motion_frequencies
from cspr_jax.motion.leg import JoinedLeg
from cspr_jax.motion.motion import Motion, states_at
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.robots.elasticity.natural_frequencies import modes_in, tensions_in
from cspr_jax.robots.model.state import State
from cspr_jax.robots.statics.kernel_axes import centred
from cspr_jax.runtime.stages import stage
from cspr_jax.schema.families import FAMILIES

SAMPLES = 64  # smallest number of samples of a segment
OF_ARC = 16  # likewise of an arc


def segment_frequencies(
    problem: Problem, robot_file: RobotFile, frame: Frame, legs: Sequence[JoinedLeg], plan_file: PlanFile, z0: float
) -> tuple[MotionFrequencies, ...]:
    """Natural frequencies along the segments of a plan on cables that stretch."""
    ask, frequencies = _asking(problem, robot_file, frame, plan_file), list[MotionFrequencies]()
    for leg in legs:
        for i, motion in enumerate(leg.motions):
            stage(f"natural frequencies of segment {len(frequencies) + 1}")
            if not math.isfinite(float(leg.answers.duration[i])):
                frequencies.append(NOT_TAUT)
                continue
            samples = max(SAMPLES, plan_file.samples, OF_ARC * int(leg.answers.tried_arcs[i])) + 1
            frequencies.append(motion_frequencies(motion, ask(motion), samples, _swing(problem, leg, i, z0)))
    return tuple(frequencies)


def frequency_warnings(frequencies: Sequence[MotionFrequencies]) -> list[str]:
    """Lines about segments in which elastic cables may resonate, or in which they do not hold the effector."""
    lines = []
    for i, segment in enumerate(frequencies, start=1):
        nearest, where = segment.nearest, f"before pose[{i}]: " if len(frequencies) > 1 else ""
        if segment.lowest == 0.0:
            lines.append(f"{where}with these elastic cables the effector is not stable at t = {segment.t:.4g} s")
        elif nearest is not None and nearest.is_near:
            lines.append(
                f"{where}a natural frequency of the elastic cables, {nearest.natural:.4g} rad/s at "
                f"t = {nearest.t:.4g} s, is within a factor of two of the motion's, {nearest.swing:.4g} rad/s"
            )
    return lines


def _swing(problem: Problem, leg: JoinedLeg, i: int, z0: float) -> float:
    # Frequency of an ellipse, else that of the swings of families that swing about P0, sqrt(g / z0).
    frequency = leg.answers.details(i).get("frequency")
    if frequency is not None:
        return float(frequency)
    return math.nan if FAMILIES[leg.family].rests_anywhere else math.sqrt(float(problem.robot.gravity) / z0)


def _asking(problem: Problem, robot_file: RobotFile, frame: Frame, plan_file: PlanFile) -> Any:
    # Function that gives frequencies along a motion. A platform in parallel pairs can turn on elastic cables: its six
    # cables count, not the three of the equivalent point mass.
    robot, pairs = problem.robot, robot_file.pairs
    written, inner_frame = robot, frame
    if pairs is not None:
        written, inner_frame = centred(build_robot(robot_file.as_written, plan_file, Path("plan")))

    def along(motion: Motion) -> FrequenciesAt:
        def frequencies(tau: np.ndarray) -> np.ndarray:
            states = states_at(motion, tau)
            tensions = tensions_in(robot, states, problem.limits, plan_file.tension_rule)
            if pairs is not None:
                states, tensions = _of_platform(states, frame, inner_frame), pairs.tensions(tensions)
            return modes_in(written, states, tensions).frequencies

        return frequencies

    return along


def _of_platform(states: State, frame: Frame, inner_frame: Frame) -> State:
    # States of a platform that only translates, in the axes of its own kernels.
    count = len(states.position)
    turn, zero = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
    position: Any = inner_frame.inward(frame.outward(states.position))
    return State(position, states.velocity, states.acceleration, turn, zero, zero)  # type: ignore[arg-type]
