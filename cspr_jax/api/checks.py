"""Checks of motions from Python: does a motion always keep within the limits of a robot, and if not, where?"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import numpy as np

from cspr_jax.api.arguments.check_keys import NAME, check_keys
from cspr_jax.api.arguments.checks import LimitsOrSpec, MotionSource, RobotOrFile, checked
from cspr_jax.api.notebooks import Displayed
from cspr_jax.api.plans import Plan
from cspr_jax.build.robots import build_robot
from cspr_jax.build.scenes import scene_of
from cspr_jax.config.missing_cables import without_cables
from cspr_jax.config.motions.text import TooLongError
from cspr_jax.config.plan import PlanFile, checked_plan
from cspr_jax.config.reading import json_text
from cspr_jax.config.robot import resolve_robot
from cspr_jax.curves.files import reference_of, samples_of
from cspr_jax.curves.spline import Spline
from cspr_jax.errors import ConfigError, InputError
from cspr_jax.errors.arguments import Cables, Digits, Points, Positive, Quaternions
from cspr_jax.families.splines.functions import FunctionMotion, function_motion
from cspr_jax.motion.motion import Placed
from cspr_jax.numerics.elementary import double_precision
from cspr_jax.numerics.linear.frames import frame_of
from cspr_jax.outputs import check_report
from cspr_jax.outputs.limits_touched import TouchedLimit, limits_touched
from cspr_jax.plans import planning
from cspr_jax.plans.long_motions import long_plan
from cspr_jax.runtime.exact_arithmetic import need_exact
from cspr_jax.schema.limits import LIMITS
from cspr_jax.verification.proved_answers import MotionProof
from cspr_jax.verification.time_stretching import SLOWEST, least_stretching

if TYPE_CHECKING:
    from cspr_jax.store.reading.result import Result


@dataclasses.dataclass(frozen=True, repr=False)
class Check(Displayed):
    """A motion that was checked.

    Fields:
        plan: the motion as a plan of one segment, from which its files, films and models are written.
    """

    plan: Plan

    @cached_property
    def _object(self) -> dict[str, Any]:
        with double_precision():
            touched = [row.to_dict() for row in self._touched]
            return check_report.check_object(self.plan) | {"on_limit": touched}

    def to_dict(self) -> dict[str, Any]:
        """The check as plain values, for JSON.

        Returns:
            what `cspr check --json` prints.
        """
        return self._object

    def to_table(self) -> Any:
        """The check as the table that `cspr check` prints.

        Returns:
            a table of the package rich.
        """
        return check_report.check_table(self.plan)

    def lines(self) -> list[str]:
        """The verdict as text.

        Returns:
            the lines that `cspr check` prints above its table.
        """
        return check_report.check_lines(self.plan) + [row.text for row in self._touched]

    def _summary(self) -> list[str]:
        return [f"Check of {line}" if not i else f"  {line}" for i, line in enumerate(self.lines())]

    def _drawn_result(self) -> "Result":
        return self.plan.to_result()

    @property
    def verdict(self) -> str:
        """Verdict: "feasible" (proved), "undecided", or names of flags joined by "+"."""
        return self._object["verdict"]

    @property
    def feasible(self) -> bool:
        """Tell whether the motion is proved feasible."""
        return self.plan.feasible

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.plan.answers.duration[0])

    @property
    def margin(self) -> float:
        """Smallest distance of a tension from its limits, N; for redundant cables, the largest that all can keep."""
        return float(self.plan.answers.margin[0])

    @property
    def margin_bound(self) -> float:
        """Proved lower bound of `margin`, N."""
        return float(self.plan.answers.margin_bound[0])

    @property
    def cause(self) -> list[dict[str, Any]]:
        """Reasons why the motion is not feasible, the worst one first."""
        return self._object["cause"]

    @property
    def failing(self) -> np.ndarray:
        """Intervals of time in which the motion breaks a criterion, (m, 2) s."""
        return self._proof.failing

    @property
    def demands(self) -> dict[str, dict[str, Any]]:
        """Worst value for each limit or condition, with proved bound, allowed value, cable and time."""
        return self._object["demands"]

    @cached_property
    def _touched(self) -> list[TouchedLimit]:
        with double_precision():
            return limits_touched(self.plan, self._proof)

    @property
    def _proof(self) -> MotionProof:
        return check_report.shown_proof(self.plan)

    def slower(self) -> "Stretched":
        """Find the smallest uniform stretching of time that makes the motion feasible.

        Under limits of torque, power or load of winches, friction and its jump at standstill leave no certainty that a
        smaller one, or one where none is found, does not exist; what is found is proved.

        Returns:
            the factor, and the check of the stretched motion.
        """
        with double_precision():
            if not self.plan.legs[0].motions:
                raise InputError("slower", None, "absent: the motion is too long to be held", problem="asked for")
            motion = cast(Spline, self.plan.legs[0].motions[0])
            if not hasattr(motion, "stretched") or not hasattr(motion, "bounds"):
                raise InputError("motion", type(motion).__name__, "a spline or a file: of others nothing is proved")
            plan = self.plan
            scene = scene_of(plan.problem.robot, plan.robot_file, plan.frame, plan.keys, NAME, trajectory=plan.keys)
            from cspr_jax.verification.mean_torques import proof_with_means  # other checks do not need it

            minimum = least_stretching(lambda factor: proof_with_means(plan.problem, motion.stretched(factor), scene))
            if not np.isfinite(minimum.factor):
                return Stretched(np.nan, minimum.is_static, None)
            factor = minimum.factor * (self.plan.keys.stretch or 1.0)
            text = json_text(json.loads(self.plan.text) | {"stretch": factor})
            return Stretched(
                minimum.factor,
                minimum.is_static,
                _check_of(self.plan.keys.model_copy(update={"stretch": factor}), text),
            )


class Stretched(NamedTuple):
    """Motion that is slowed down uniformly.

    Fields:
        factor: stretching of the duration; 1 if the motion was feasible, NaN if no stretching makes it feasible.
        is_static: whether the robot can rest at every position of the motion, so that some stretching is feasible.
        check: check of the stretched motion, or None.
    """

    factor: float
    is_static: bool
    check: Check | None

    def to_dict(self) -> dict[str, Any]:
        """The stretching as plain values, for JSON.

        Returns:
            "factor", null if no stretching is feasible, "static" and the "check" of the stretched motion, or null.
        """
        factor = self.factor if np.isfinite(self.factor) else None
        return {"factor": factor, "static": self.is_static, "check": self.check and self.check.to_dict()}

    def lines(self) -> list[str]:
        """The stretching as text.

        Returns:
            the lines that `cspr check --slower` prints.
        """
        if self.check is None:
            why = "" if self.is_static else ": nor is the robot proved to stand still at every place of it"
            return [f"no uniform stretching of time, up to {SLOWEST:.0e} times, is proved feasible{why}"]
        return [
            f"{self.factor:.7g} times slower, in {self.check.duration:.7g} s, it is feasible, proved; "
            "one part in a million faster it is not proved"
        ]


@checked(motion="spline")
def check(  # noqa: PLR0913
    robot: RobotOrFile,
    times: MotionSource,
    positions: Points | None = None,
    quaternions: Quaternions | None = None,
    *,
    velocities: Points | None = None,
    accelerations: Points | None = None,
    interpolation: Literal["cubic", "quintic", "hermite"] | None = None,
    ends: Literal["rest", "natural", "periodic"] | None = None,
    smooth: Positive | None = None,
    point: Literal["mass-centre", "origin"] | None = None,
    trajectory: str | None = None,
    duration: Positive | None = None,
    limits: LimitsOrSpec = None,
    without: Cables | None = None,
    digits: Digits | None = None,
) -> Check:
    """Check with a proof whether a motion always keeps the limits of a robot.

    Args:
        robot: a robot, the name of one of the catalogue, or the path of a robot file.
        times: (n,) increasing, s. Instead of times and positions: the path of a file, a spline of SciPy, a motion of
            this package, or a function of jax whose values are positions (3,), of a platform positions and quaternions
            (7,). Functions are only sampled: they are refuted, or undecided.
        positions: (n, 3) positions of the mass centre, in the axes of the robot, m.
        quaternions: (n, 4) orientations of the platform, scalar first; None: its own axes.
        velocities: (n, 3) m/s, for Hermite pieces.
        accelerations: (n, 3) m/s^2, for Hermite pieces.
        interpolation: "cubic", "quintic" or "hermite"; None: as the file says, else "hermite" if there are velocities,
            else "cubic".
        ends: "rest", "natural" or "periodic"; None: as the file says, else "rest".
        smooth: standard deviation of the noise of positions, m, which a smoothing spline removes; None: 0.
        point: point of a platform whose positions are given, "mass-centre" or "origin" of its axes; None: as the file
            says, else the mass centre.
        trajectory: `id` of one of several trajectories in a file of CASPR; None for everything else.
        duration: duration of a function, s; None for everything else.
        limits: override those of the robot, one by one; a dictionary may hold all keys of [limits] of a plan.
        without: cables that are gone, from 0 on; limits of each cable still have one number per cable of the robot.
        digits: digits, 1 to 15, to which causes, demands and margins are exact, of a motion that is held as a spline;
            needs the package's extra `exact`. None: those of the proof and of samples.

    Returns:
        the check, feasible or not.

    Raises:
        ConfigError: a file has a mistake.
        InputError: samples that do not define a motion, or an impossible argument.
    """
    samples = {"quaternions": quaternions, "velocities": velocities, "accelerations": accelerations}
    _check_source(times, {"positions": positions, **samples}, duration)
    if trajectory is not None and not isinstance(times, str | Path):
        raise InputError("trajectory", trajectory, "absent but for a file of CASPR")
    settings: dict[str, Any] = {"interpolation": interpolation, "ends": ends, "smooth": smooth, "point": point}
    settings["without"] = None if without is None else [int(i) for i in without]
    spec = check_keys(robot, limits, trajectory=trajectory, **settings)
    with double_precision():
        if isinstance(times, str | Path):
            return check_file(Path(times), spec, digits=digits)
        plan = checked_plan(spec, NAME)
        if positions is not None:
            source: Any = samples_of(times, positions, quaternions, velocities, accelerations)
        elif hasattr(times, "state") or _is_curve(times):
            source = times
        else:
            source = _function(times, duration, plan)
        return _check_of(plan.with_source(str(NAME), source), json_text(spec), digits)


def _is_curve(times: Any) -> bool:
    # Piecewise polynomials of SciPy have an attribute x, B-splines t.
    return hasattr(times, "x") or hasattr(times, "t")


def _check_source(times: Any, samples: Mapping[str, Any], duration: float | None) -> None:
    # Only an array of times has samples, and only a function needs a duration.
    is_file, is_motion = isinstance(times, str | Path), hasattr(times, "state")
    if is_file or is_motion or callable(times):
        kind = "a file" if is_file else "a motion" if is_motion else "a curve or a function"
        for name in (name for name, rows in samples.items() if rows is not None):
            error = f"given beside {kind} in place of times"
            raise InputError(name, None, "must be absent; with an array of times (n,) s, samples", problem=error)
    if duration is not None and (is_file or is_motion or _is_curve(times) or not callable(times)):
        raise InputError("duration", duration, "absent but for a function of time")


def check_file(
    motion: Path,
    spec: Mapping[str, Any],
    *,
    outputs: Sequence[str] = (),
    limits: Path | None = None,
    digits: int | None = None,
) -> Check:
    """Check the motion of a file."""
    with double_precision():
        data = {"schema": 1, "family": "spline", **spec, "motion": str(motion)}
        plan = checked_plan(data, motion)
        try:
            return _check_of(plan, json_text(data), digits)
        except TooLongError as error:
            if outputs:
                held = f"must be absent: {motion} is too long to be held, and checked in windows"
                raise ConfigError(outputs[0], held) from error
            return _shown(long_plan(plan, motion), json_text(data))
        except ConfigError as error:
            raise _of_file(error, motion, limits) from error


def _of_file(error: ConfigError, motion: Path, limits: Path | None) -> ConfigError:
    # Errors about arguments name no file: name the given one.
    before = f"{NAME}: "
    if not error.args or not str(error.args[0]).startswith(before):
        return error
    first, *others = [line.removeprefix(before) for line in error.lines]
    is_limit = re.split(r"[ \[]", first.removeprefix("limits."))[0] in {row.name for row in LIMITS}
    return ConfigError(limits if limits is not None and is_limit else motion, first, others=others)


def _check_of(spec: PlanFile, text: str, digits: int | None = None) -> Check:
    planned = planning.plan_of(spec, NAME)
    if digits is not None:
        need_exact("digits")
        from cspr_jax.plans.exact_digits import with_digits  # other checks do not need the library

        around = planned.problem.robot, planned.robot_file, planned.frame, planned.keys, NAME
        planned = with_digits(planned, digits, scene_of(*around, trajectory=planned.keys))
    return _shown(planned, text)


def _shown(planned: planning.PlannedMotions, text: str) -> Check:
    # Files of the motion store the text, from which pictures take limits and obstacles.
    fields = {field.name: getattr(planned, field.name) for field in dataclasses.fields(planned)}
    return Check(Plan(**fields | {"text": text}))


def _function(function: Any, duration: float | None, spec: PlanFile) -> Placed[FunctionMotion]:
    if not callable(function):
        raise InputError("positions", None, "must be given beside times: (n, 3) m", problem="missing")
    if duration is None:
        raise InputError("duration", None, "must be given beside a function: s", problem="missing")
    file = without_cables(resolve_robot(spec.robot, NAME, Path(), spec.parameters), spec.without, NAME)
    frame, reference = frame_of(file.base_points, file.z_axis), reference_of(build_robot(file, spec, NAME))
    motion = function_motion(function, duration, frame=frame, reference=reference, is_platform=file.is_platform)
    return Placed(motion, frame)
