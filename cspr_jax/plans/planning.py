"""Plans: sequences of poses; each segment has its smallest number of arcs and its peak values."""

import dataclasses
import itertools
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cspr_jax.build.problems import build_problem
from cspr_jax.config.equivalents import as_moved
from cspr_jax.config.keys.trajectory import NamedAmplitude
from cspr_jax.config.plan import PlanFile, read_plan
from cspr_jax.config.reading import read_text
from cspr_jax.config.robot import RobotFile, resolve_robot
from cspr_jax.errors import ConfigError
from cspr_jax.motion.answers import Answers, joined
from cspr_jax.motion.cause import Cause
from cspr_jax.motion.leg import JoinedLeg, Leg, LegResult
from cspr_jax.motion.motion import Motion, Placed, states_at
from cspr_jax.motion.peaks import SAMPLES, Peaks, peaks
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.linear.frames import Frame
from cspr_jax.plans.choices import best_amplitude, chosen_depth, nearly_resting
from cspr_jax.plans.motor_torques import with_mean_torques
from cspr_jax.plans.sequence import PlanLegs
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.point_mass import spool_radius
from cspr_jax.robots.model.tension_rule_table import TENSION_RULES
from cspr_jax.robots.statics.wrench_sets import tension_range
from cspr_jax.runtime.exact_arithmetic import HOW, has_exact
from cspr_jax.schema.families import FAMILIES
from cspr_jax.schema.verdicts import Verdict

if TYPE_CHECKING:
    from cspr_jax.machine.motion_frequencies import MotionFrequencies

# Details of segments that hold only if cables run from points, not over pulleys.
FROM_POINTS = (
    "det_margin",
    "det_sign_constant",
    "cable_interference",
    "cable_distance_min",
    "platform_interference",
    "refuted_at",
    "envelope_oscillations",
    "least_oscillations",
)
# Epsilon with which z0 is searched for before a "best" epsilon is chosen.
FIRST_EPSILON = 0.2
# Relative jumps allowed where families change: of positions over the robot's radius, of accelerations over gravity.
CONTINUOUS = 1e-9


@dataclasses.dataclass(frozen=True)
class PlannedMotions:
    """A planned sequence.

    Fields:
        robot_file: the robot as its file has it, or its equivalent from `config.equivalents`.
        keys: content of the plan file.
        problem: robot (centred), limits and amplitude function.
        z0: depth of P0, m.
        frame: frame of the robot file.
        points: (n + 1, 3) positions of the poses in the axes of the robot file, m.
        legs: consecutive segments of one family each; n segments in all.
        demands: peaks of the n segments; `lowest` is z in the axes of the robot file.
        outcomes: results of the legs that have more than a motion, as launches do.
        causes: for each of the n segments, why it is not feasible, the worst cause first.
        warnings: what the user should know, one line each.
        text: text of the plan file; empty for a plan without a file.
        point: point of the platform whose positions files and pictures hold, one of `config.motions.table.POINTS`.
        frequencies: natural frequencies along the n segments; None on cables that do not stretch.
        digits: digits to which causes, demands and margins are exact; None: those of the proof and of samples.
    """

    robot_file: RobotFile
    keys: PlanFile
    problem: Problem
    z0: float
    frame: Frame
    points: np.ndarray
    legs: tuple[JoinedLeg, ...]
    demands: Peaks
    outcomes: tuple[LegResult, ...] = ()
    causes: tuple[tuple[Cause, ...], ...] = ()
    warnings: tuple[str, ...] = ()
    text: str = ""
    point: str = "mass-centre"
    frequencies: "tuple[MotionFrequencies, ...] | None" = None
    digits: int | None = None

    @property
    def is_at_origin(self) -> bool:
        """Tell if files hold poses of the platform's axes, not of its mass centre; joints are at their origin."""
        row = PATTERNS[self.robot_file.own_pattern]
        return self.point == "origin" and row.is_body and not row.is_jointed

    @cached_property
    def answers(self) -> Answers:
        """Answers of the n segments; for several legs, those columns that all families have."""
        if len(self.legs) == 1:
            return self.legs[0].answers
        names = [field.name for field in dataclasses.fields(Answers)]
        return joined([Answers(**{name: getattr(leg.answers, name) for name in names}) for leg in self.legs])

    def details(self, i: int) -> dict[str, Any]:
        """Details of a segment that only its family reports."""
        for leg in self.legs:
            if i < len(leg.motions):
                details, pulleys = leg.answers.details(i), self.problem.robot.pulleys
                return {name: value for name, value in details.items() if pulleys is None or name not in FROM_POINTS}
            i -= len(leg.motions)
        raise IndexError(i)

    @property
    def motions(self) -> list[Placed]:
        """Motions of the n segments, in the axes of the robot file."""
        return [Placed(motion, self.frame) for leg in self.legs for motion in leg.motions]

    @property
    def is_redundant(self) -> bool:
        """Tell whether the robot has more cables than degrees of freedom."""
        return self.problem.robot.n_cables > self.problem.robot.dof

    @cached_property
    def tension_margin(self) -> np.ndarray:
        """Smallest distance of tensions from their limits, (n,) N: from proofs, else by a search between samples."""
        margins = self.demands.tension_margin.copy()
        for i, proof in enumerate(self.answers.proof):
            if proof is not None and proof.parts.usual:
                margins[i] = proof.margin
        return np.where(np.isfinite(self.answers.duration), margins, np.nan)

    @property
    def outcome_columns(self) -> dict[str, np.ndarray]:
        """Datasets that the results of the legs add to a motion file."""
        return {name: values for result in self.outcomes for name, values in result.columns().items()}

    @property
    def feeds(self) -> list[np.ndarray | None]:
        """Largest speeds on the pieces of each motion, of G-code and the like; None: a motion keeps none."""
        return [getattr(proof, "feeds", None) for leg in self.legs for proof in leg.answers.proof]

    @property
    def feasible(self) -> bool:
        """Tell whether every segment is proved feasible."""
        return bool(self.is_feasible.all())

    @property
    def is_feasible(self) -> np.ndarray:
        """Tell whether each of the n segments is feasible."""
        return np.concatenate([leg.answers.feasible for leg in self.legs])


def plan(path: Path) -> PlannedMotions:
    """Plan the sequence of a plan file."""
    text = read_text(path)
    return dataclasses.replace(plan_of(read_plan(text, path), path), text=text)


def plan_of(plan_file: PlanFile, path: Path) -> PlannedMotions:
    """Plan the sequence of a plan file's content."""
    legs_of = [FAMILIES[name].legs for name in plan_file.families]
    robot_file = resolve_robot(plan_file.robot, path, path.parent, plan_file.parameters, plan_file.parameter)
    robot_file = as_moved(robot_file, legs_of, plan_file.without, path)
    if plan_file.point == "origin":
        from cspr_jax.plans.given_points import with_mass_centres  # loads parts of SciPy

        plan_file = with_mass_centres(robot_file, plan_file, path)
    sequence = PlanLegs(robot_file, plan_file, path)
    any_cables = all(robot_file.own_pattern in FAMILIES[name].any_cables for name in plan_file.families)
    problem = build_problem(
        robot_file, plan_file, plan_file, path, epsilon=FIRST_EPSILON, any_cables=any_cables, pulleys=True
    )
    _check_rule(problem, plan_file, path)
    for leg in sequence.legs:
        leg.check(problem)
    z0 = chosen_depth(problem, sequence)
    if isinstance(plan_file.amplitude, NamedAmplitude) and plan_file.amplitude.epsilon == "best":
        amplitude, z0 = best_amplitude(problem, sequence, z0)
        problem = problem._replace(amplitude=amplitude)
    legs = tuple(JoinedLeg(leg.waypoints.family, *leg.join(problem, z0)) for leg in sequence.legs)
    _refuse_jumps(problem, sequence, legs)
    frame = sequence.waypoints.frame
    legs = tuple(_with_proofs(problem, *each) for each in zip(legs, sequence.legs, strict=True))
    legs = with_mean_torques(problem, legs, lambda: _scene(problem, sequence.waypoints))
    why, extremes = _causes(frame, legs), _extremes(problem, robot_file, frame, legs, plan_file)
    frequencies, resonances = _frequencies(problem, robot_file, frame, legs, plan_file, z0)
    lines = [line for leg in sequence.legs for line in leg.warnings(problem)] + resonances
    lines += nearly_resting(sequence.waypoints, z0) + _renumbered(robot_file)
    lines += _missed(plan_file, np.concatenate([leg.answers.feasible for leg in legs]), extremes) + _undecided(legs)
    return PlannedMotions(
        robot_file=robot_file,
        keys=plan_file,
        problem=problem,
        z0=z0,
        frame=frame,
        points=_points(sequence, legs, z0),
        legs=legs,
        demands=extremes,
        outcomes=_results(problem, sequence, legs, extremes),
        causes=why,
        warnings=tuple(dict.fromkeys(lines)),
        point=_point(plan_file, sequence),
        frequencies=frequencies,
    )


def _renumbered(robot_file: RobotFile) -> list[str]:
    gone = robot_file.missing_cables
    if not gone:
        return []
    left = [str(i + 1) for i in range(len(robot_file.base_points) + len(gone)) if i not in gone]
    return [f"without = {list(gone)}: cables 1, 2, ... of the results are cables {', '.join(left)} of the robot file"]


def _point(plan_file: PlanFile, sequence: PlanLegs) -> str:
    # Take the point that the plan names, else the point of its motion files if all name the same one.
    points = {leg.point for leg in sequence.legs}
    return plan_file.point or (points.pop() if len(points) == 1 else None) or "mass-centre"


def _with_proofs(problem: Problem, joined: JoinedLeg, leg: Leg) -> JoinedLeg:
    # Families prove feasible motions faster, but only the general proof says why a motion is not feasible.
    if joined.answers.feasible.all() and not any(proof is not None for proof in joined.answers.proof):
        return joined
    from cspr_jax.verification.attained import with_attained  # feasible plans do not need it

    case = joined.motions, _scene(problem, leg.waypoints), leg.waypoints.arcs
    return dataclasses.replace(joined, answers=with_attained(problem, joined.answers, *case))


def _scene(problem: Problem, waypoints: Waypoints) -> Any:
    from cspr_jax.build.scenes import scene_of_leg  # nor this

    return scene_of_leg(problem.robot, waypoints)


def with_motions(
    plan: PlannedMotions, answers: Answers, motions: list[Motion], lines: list[str], scene: Any
) -> PlannedMotions:
    """A plan with other motions between its poses."""
    legs = with_mean_torques(plan.problem, [JoinedLeg(plan.keys.family, answers, motions)], lambda: scene)
    answers = legs[0].answers
    why, extremes = _causes(plan.frame, legs), _extremes(plan.problem, plan.robot_file, plan.frame, legs, plan.keys)
    frequencies, resonances = _frequencies(plan.problem, plan.robot_file, plan.frame, legs, plan.keys, plan.z0)
    planned = _frequency_warnings(plan.frequencies)
    earlier = [line for line in plan.warnings if line not in planned]
    lines = [*earlier, *lines, *resonances, *_missed(plan.keys, answers.feasible, extremes)]
    changes: dict[str, Any] = {"legs": legs, "demands": extremes, "causes": why, "frequencies": frequencies}
    return dataclasses.replace(plan, warnings=tuple(dict.fromkeys(lines)), **changes)


def _frequencies(
    problem: Problem, robot_file: RobotFile, frame: Frame, legs: tuple[JoinedLeg, ...], plan_file: PlanFile, z0: float
) -> "tuple[tuple[MotionFrequencies, ...] | None, list[str]]":
    # Natural frequencies along the segments, and lines about them; none on cables that do not stretch.
    if problem.robot.axial_stiffness is None:
        return None, []
    from cspr_jax.plans.elastic_cables import segment_frequencies  # few robots have such cables

    frequencies = segment_frequencies(problem, robot_file, frame, legs, plan_file, z0)
    return frequencies, _frequency_warnings(frequencies)


def _frequency_warnings(frequencies: "tuple[MotionFrequencies, ...] | None") -> list[str]:
    if frequencies is None:
        return []
    from cspr_jax.plans.elastic_cables import frequency_warnings  # nor this

    return frequency_warnings(frequencies)


def _causes(frame: Frame, legs: tuple[JoinedLeg, ...]) -> tuple[tuple[Cause, ...], ...]:
    return tuple(leg.answers.causes_of(i, frame) for leg in legs for i in range(len(leg.motions)))


def _extremes(
    problem: Problem, robot_file: RobotFile, frame: Frame, legs: tuple[JoinedLeg, ...], plan_file: PlanFile
) -> Peaks:
    # Convert heights to the axes of the robot file.
    extremes = _peaks(problem, legs, plan_file, _shape(problem, robot_file, frame, plan_file))
    return dataclasses.replace(extremes, lowest=frame.height(extremes.lowest))


def _shape(problem: Problem, robot_file: RobotFile, frame: Frame, plan_file: PlanFile) -> np.ndarray | None:
    # Return the corners of a platform's shape; None if the plan gives no shape.
    if plan_file.platform_box is None and plan_file.platform_hull is None:
        return None
    from cspr_jax.build.scenes import scene_of  # few plans have a shape
    from cspr_jax.robots.contacts.contact_bodies import shape_corners

    scene = scene_of(problem.robot, robot_file, frame, plan_file, Path("plan"), trajectory=plan_file)
    return shape_corners(problem.robot, scene)


def _points(sequence: PlanLegs, legs: tuple[JoinedLeg, ...], z0: float) -> np.ndarray:
    # Return the positions of all poses in the axes of the robot file, even those that only a motion determines.
    waypoints = sequence.waypoints
    points = np.array(waypoints.frame.outward(waypoints.points(z0)))
    motions = [motion for leg in legs for motion in leg.motions]
    for i in waypoints.plan_file.resulting_poses:
        # The first pose is the start of its segment, all others are ends.
        segment, end = (i - 1, 1.0) if i else (0, 0.0)
        points[i] = waypoints.frame.outward(states_at(motions[segment], np.array([end])).position[0])
    return points


def _results(
    problem: Problem, sequence: PlanLegs, legs: tuple[JoinedLeg, ...], extremes: Peaks
) -> tuple[LegResult, ...]:
    results, first, start = [], 0, 0.0
    for leg, joined_leg in zip(sequence.legs, legs, strict=True):
        tension_min = extremes.tension_min[first : first + len(leg)]
        results.append(leg.result(problem, joined_leg, tension_min, start))
        first, start = first + len(leg), start + float(joined_leg.answers.duration.sum())
    return tuple(result for result in results if result is not None)


def _check_rule(problem: Problem, plan_file: PlanFile, path: Path) -> None:
    robot, rule = problem.robot, plan_file.tensions
    if rule is None:
        return
    if robot.n_cables == robot.dof:
        raise ConfigError(
            path,
            f'tensions = "{rule}": must be absent: on {robot.n_cables} cables, as many as degrees of freedom, the '
            "motion determines them",
        )
    if TENSION_RULES[rule].is_bounded and not np.isfinite(np.asarray(tension_range(robot, problem.limits)[1])).all():
        others = " or ".join(f'"{name}"' for name, row in TENSION_RULES.items() if not row.is_bounded)
        raise ConfigError(path, f'tensions = "{rule}": must be {others} without tension_max of every cable')


def _undecided(legs: tuple[JoinedLeg, ...]) -> list[str]:
    # How to decide segments that are left open.
    is_open = any((leg.answers.verdict & Verdict.UNDECIDED.value).any() for leg in legs)
    return [f"undecided: exact arithmetic decides most such motions: {HOW}"] if is_open and not has_exact() else []


def _missed(plan_file: PlanFile, is_feasible: np.ndarray, extremes: Peaks) -> list[str]:
    # A rule that is not exact may find no tensions within the limits although there are some.
    if TENSION_RULES[plan_file.tension_rule].is_exact:
        return []
    missed = np.flatnonzero(is_feasible & (extremes.are_found == 0.0)) + 1
    if not len(missed):
        return []
    names = ", ".join(f"pose[{i}]" for i in missed.tolist())
    return [
        f'tensions = "{plan_file.tension_rule}": finds none within their limits somewhere before {names}, where there '
        "are some: those of least norm stand in for them"
    ]


def _peaks(problem: Problem, legs: tuple[JoinedLeg, ...], plan_file: PlanFile, corners: np.ndarray | None) -> Peaks:
    motions = [motion for leg in legs for motion in leg.motions]
    counts = np.concatenate([_counts(leg, plan_file) for leg in legs]).tolist()
    return peaks(problem.robot, motions, counts, problem.limits, plan_file.tension_rule, corners)


def _counts(leg: JoinedLeg, plan_file: PlanFile) -> np.ndarray:
    # Return the number of times at which the search for extremes starts.
    return np.maximum(SAMPLES * leg.answers.tried_arcs, plan_file.samples) + 1


def _refuse_jumps(problem: Problem, sequence: PlanLegs, legs: tuple[JoinedLeg, ...]) -> None:
    # Positions, velocities and accelerations must be continuous where the family changes.
    length, gravity = float(spool_radius(problem.robot)), float(problem.robot.gravity)
    scales = {"position": length, "velocity": np.sqrt(length * gravity), "acceleration": gravity}
    for leg, (before, after) in zip(sequence.legs[1:], itertools.pairwise(legs), strict=True):
        ends = (before.motions[-1], 1.0), (after.motions[0], 0.0)
        last, first = (states_at(motion, np.array([tau]))[:3] for motion, tau in ends)
        if not np.isfinite([np.asarray(values) for values in (*last, *first)]).all():
            continue  # the verdict says why there is no motion
        for (name, scale), a, b in zip(scales.items(), last, first, strict=True):
            jump = float(np.abs(np.asarray(a) - np.asarray(b)).max())
            if not jump <= CONTINUOUS * scale:
                raise ConfigError(
                    sequence.waypoints.path,
                    f'pose[{leg.waypoints.first + 1}].family = "{after.family}": must be one whose {name} goes on from '
                    f'"{before.family}": it jumps by {jump:.2g} at pose[{leg.waypoints.first}]',
                )
