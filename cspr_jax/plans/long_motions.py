"""Motions from tables too long to hold in memory: checked window by window, reported as a plan of one segment."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cspr_jax.build.problems import build_problem
from cspr_jax.build.robots import build_robot
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.plan import PlanFile
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.curves.files import centre_from, kept_to, placed_inward, reference_of
from cspr_jax.curves.reading import window_splines
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.motion.leg import JoinedLeg
from cspr_jax.motion.peaks import EXTREMES, SAMPLES, Peaks, peaks
from cspr_jax.motion.problem import Problem
from cspr_jax.numerics.bounds.intervals import united
from cspr_jax.numerics.linear.frames import IDENTITY, Frame, frame_of
from cspr_jax.plans.planning import PlannedMotions
from cspr_jax.robots.contacts.contact_bodies import shape_corners
from cspr_jax.schema.families import FAMILIES
from cspr_jax.store.reading.motion_samples import motion_windows
from cspr_jax.verification.attained import attained
from cspr_jax.verification.proved_answers import MotionProof, answers_of, proof_of
from cspr_jax.verification.time_proof import TimeProof

# The smallest value of these quantities counts, of all others the largest.
SMALLEST = ("tension_min", "mu_min", "depth_min", "tension_margin", "are_found")


class _Window(NamedTuple):
    start: float
    duration: float
    proof: MotionProof
    peaks: Peaks
    interpolation: str
    ends: str


def long_plan(plan_file: PlanFile, path: Path) -> PlannedMotions:
    """Plan of one motion from a long table. It does not hold the motion, so no files can be written from it."""
    for key in ("smooth", "stretch"):
        if getattr(plan_file, key) is not None:
            raise ConfigError(path, f"{key}: must be absent in a table of so many rows")
    robot_file = resolve_robot(plan_file.robot, path, Path(), plan_file.parameters)
    robot_file = as_moved(robot_file, [FAMILIES["spline"].legs], plan_file.without, path)
    problem = build_problem(robot_file, plan_file, plan_file, path, any_cables=True)
    if problem.limits.uncertainty is not None:
        raise ConfigError(path, "uncertainty: must be absent in a table of so many rows")
    if problem.limits.motor_torque_rms_max is not None:
        raise ConfigError(path, "motor_torque_rms_max: must be absent in a table of so many rows")
    frame, notes = frame_of(robot_file.base_points, robot_file.z_axis), dict[str, None]()
    try:
        windows = list(_windows(problem, robot_file, frame, plan_file, path, notes))
    except InputError as error:
        raise ConfigError(path, str(error)) from error
    duration = np.array([windows[-1].start + windows[-1].duration])
    answers = answers_of([_merged(windows)], duration)
    extremes = _reduced([window.peaks for window in windows], [window.start for window in windows])
    return PlannedMotions(
        robot_file=robot_file,
        keys=plan_file.model_copy(update={"interpolation": windows[0].interpolation, "ends": windows[0].ends or None}),
        problem=problem,
        z0=float("nan"),
        frame=frame,
        points=np.full((2, 3), np.nan),
        legs=(JoinedLeg("spline", answers, []),),
        demands=dataclasses.replace(extremes, lowest=frame.height(extremes.lowest)),
        causes=(answers.causes_of(0, frame),),
        warnings=tuple(f"{path}: {note}" for note in notes),
    )


def _windows(
    problem: Problem, robot_file: RobotFile, frame: Frame, plan_file: PlanFile, path: Path, notes: dict[str, None]
) -> Iterator[_Window]:
    scene = scene_of(problem.robot, robot_file, frame, plan_file, path, trajectory=plan_file)
    corners = shape_corners(problem.robot, scene)
    axes = reference_of(build_robot(robot_file, plan_file, path))
    tables = motion_windows(path)
    says: dict[str, Any] = {}

    def noted():
        for window in tables:
            notes.update(dict.fromkeys(window.table.notes))
            says.update(point=window.table.point, is_written=window.table.from_reference)
            says.update(is_planar=getattr(window.table, "is_planar", False))
            yield window

    settings = {"z_axis": robot_file.z_axis, "interpolation": plan_file.interpolation, "ends": plan_file.ends}
    for start, curve in window_splines(noted(), **settings):
        reference = np.array(IDENTITY) if says["is_written"] else axes
        centre = centre_from(robot_file, plan_file.point or says["point"])
        curve = kept_to(robot_file.own_pattern, curve, is_planar=bool(says["is_planar"]))
        motion: Spline = placed_inward(curve, frame, reference, centre)
        extremes = peaks(problem.robot, [motion], [SAMPLES + 1], problem.limits, plan_file.tension_rule, corners)
        proof = attained(problem, motion, proof_of(problem, motion, scene), scene)
        yield _Window(start, float(motion.duration()), proof, extremes, curve.interpolation, curve.ends)


def _merged(windows: list[_Window]) -> MotionProof:
    proofs = [window.proof.proof for window in windows]
    sides = {name: np.array([getattr(proof, name) for proof in proofs]) for name in ("low", "high", "when")}
    sides["when"] += np.array([[window.start] for window in windows])
    worst, columns = sides["high"].argmin(0), np.arange(sides["high"].shape[1])

    def shifted(name: str) -> list[np.ndarray]:
        parts = [[rows + window.start for rows in getattr(window.proof.proof, name)] for window in windows]
        return [united(np.concatenate(rows)) for rows in zip(*parts, strict=True)]

    proof = TimeProof(
        low=sides["low"].min(0),
        high=sides["high"].min(0),
        when=sides["when"][worst, columns],
        failing=shifted("failing"),
        open=shifted("open"),
        blocks=sum(proof.blocks for proof in proofs),
    )
    return windows[0].proof._replace(proof=proof)


def _reduced(each: list[Peaks], starts: list[float]) -> Peaks:
    # Extremes over windows that begin at these times, s.
    columns, worst = {}, []
    for name in EXTREMES:
        values = np.array([getattr(one, name)[0] for one in each])
        worst.append(int(values.argmin() if name in SMALLEST else values.argmax()))
        columns[name] = values[worst[-1:]]
    when = np.array([starts[k] + each[k].when[0, i] for i, k in enumerate(worst)])
    cables = np.array([each[k].cables[0, i] for i, k in enumerate(worst)])
    samples = np.array([sum(int(one.samples[0]) for one in each)])
    columns["motor_torque_rms"] = np.array([np.nan])  # windows do not keep it for each motor
    return Peaks(**columns, samples=samples, when=when[None], cables=cables[None])
