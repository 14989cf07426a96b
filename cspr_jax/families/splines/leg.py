"""Leg of splines: poses at given times, joined by piecewise polynomials, or motions from files."""

from typing import Any

import numpy as np

from cspr_jax.build.orientations import pose_quaternions
from cspr_jax.build.robots import build_robot
from cspr_jax.build.scenes import scene_of_leg
from cspr_jax.config.motions.table import MotionPieces, MotionTable, unit_hints
from cspr_jax.curves.files import centre_from, kept_to, moving_ends, placed_inward, reference_of, source_spline
from cspr_jax.curves.interpolation import interpolated
from cspr_jax.curves.noise import noise_notes
from cspr_jax.curves.reading import pieces_of
from cspr_jax.curves.spline import Spline, part
from cspr_jax.errors import ConfigError, InputError, shown
from cspr_jax.motion.answers import Answers
from cspr_jax.motion.leg import Leg
from cspr_jax.motion.motion import Motion, Placed
from cspr_jax.motion.problem import Problem
from cspr_jax.motion.waypoints import Waypoints
from cspr_jax.numerics.linear.frames import IDENTITY
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.store.reading.motion_samples import read_motion
from cspr_jax.verification.proved_answers import proved_answers


class Splines(Leg):
    """Poses at given times, and files of samples, joined by piecewise polynomials; see `Leg`."""

    def __init__(self, waypoints: Waypoints) -> None:
        """Refuse poses without times, and keys of other families."""
        super().__init__(waypoints)
        self._notes: list[str] = []
        self._points: set[str] = set()
        self._refuse("arcs", "beta_hat")
        for i, pose in enumerate(waypoints.poses):
            if pose.trajectory is not None and pose.motion is None:
                name = f"{waypoints.name(i)}.trajectory = {shown(pose.trajectory)}"
                raise ConfigError(waypoints.path, f"{name}: must be beside motion, the file that holds it")
            if pose.motion is not None and i:
                self._check_file(i)
        for first, last in self._runs:
            if not self._is_file(first):
                self._check_times(first, last)
                self._check_rates(first, last)

    def join(self, problem: Problem, z0: float) -> tuple[Answers, list[Motion]]:
        """Join the poses; see `Leg.join`."""
        motions: list[Any] = []
        for first, last in self._runs:
            if self._is_file(first):
                motions.append(self._of_file(first + 1))
            else:
                curve = self._curve(problem, z0, first, last)
                motions += [part(curve, i, i + 1) for i in range(last - first)]
        if self.waypoints.plan_file.stretch is not None:
            motions = [motion.stretched(self.waypoints.plan_file.stretch) for motion in motions]
        waypoints = self.waypoints
        scene = scene_of_leg(problem.robot, waypoints)
        return proved_answers(problem, motions, scene), list(motions)

    def warnings(self, problem: Problem) -> list[str]:
        """Notes about files, and hints at probable mistakes in their samples; see `Leg.warnings`."""
        return self._notes

    @property
    def _runs(self) -> list[tuple[int, int]]:
        # Indices of the first and the last pose of each curve: one of a file, or poses up to one with a given velocity.
        poses, ends = self.waypoints.poses, []
        for i in range(1, len(self) + 1):
            stops_here = poses[i].rest or (poses[i].velocity is not None and not self._is_hermite)
            if stops_here or i == len(self) or self._is_file(i - 1) or self._is_file(i):
                ends.append(i)
        return list(zip([0, *ends[:-1]], ends, strict=True))

    @property
    def _is_hermite(self) -> bool:
        return self.waypoints.plan_file.interpolation == "hermite"

    def _is_file(self, segment: int) -> bool:
        return self.waypoints.poses[segment + 1].motion is not None

    def _of_file(self, i: int) -> Any:
        waypoints = self.waypoints
        name = waypoints.poses[i].motion or ""
        source = waypoints.plan_file.source(name)
        if source is None:
            source = read_motion(waypoints.path.parent / name, waypoints.poses[i].trajectory)
        try:
            self._refuse_keys_of_samples(source)
            if isinstance(source, Placed):
                return source.motion
            if not isinstance(source, MotionTable | MotionPieces | Spline):
                source = pieces_of(source)
            source = self._cleaned(name, source)
            curve = source_spline(
                source,
                z_axis=waypoints.robot_file.z_axis,
                is_platform=waypoints.robot_file.is_platform,
                interpolation=waypoints.plan_file.interpolation,
                ends=waypoints.plan_file.ends,
            )
            is_planar = getattr(source, "is_planar", False)
            curve = kept_to(waypoints.robot_file.own_pattern, curve, is_planar=is_planar)
        except InputError as error:
            raise ConfigError(name, str(error)) from error
        reference = np.array(IDENTITY)
        if not getattr(source, "from_reference", False):
            reference = reference_of(build_robot(waypoints.robot_file, waypoints.plan_file, waypoints.path))
        return placed_inward(
            curve, waypoints.frame, reference, centre_from(waypoints.robot_file, self._point(name, source))
        )

    def _point(self, name: str, source: Any) -> str:
        point, centre = self.waypoints.plan_file.point or getattr(source, "point", None), None
        if point is None:
            centre = centre_from(self.waypoints.robot_file, "origin")
        if centre is not None and centre.any():
            self._notes.append(
                f"{name}: hint: positions are taken as those of the mass centre, {centre.tolist()} m from the origin "
                'of the platform\'s axes; if they are those of the origin, say point = "origin"'
            )
        self._points.add(point or "mass-centre")
        self.point = point if len(self._points) == 1 else None
        return point or "mass-centre"

    def _refuse_keys_of_samples(self, source: Any) -> None:
        for key in ("interpolation", "ends", "smooth") if not isinstance(source, MotionTable) else ():
            if getattr(self.waypoints.plan_file, key) is not None:
                raise InputError(key, getattr(self.waypoints.plan_file, key), "absent for a motion without samples")
        if isinstance(source, Placed) and self.waypoints.plan_file.point == "origin":
            raise InputError("point", "origin", '"mass-centre", whose positions functions and motions give')

    def _cleaned(self, name: str, source: Any) -> Any:
        # Remove the noise if the plan states its size, else report it.
        lines: list[str] = []
        if isinstance(source, MotionTable):
            lines += [f"hint: {line}" for line in unit_hints(source, np.asarray(self.waypoints.robot_file.base_points))]
            noise, settings = list[str](), self.waypoints.plan_file
            if settings.smooth is not None:
                from cspr_jax.curves.smoothing import smoothed  # slow to import, and few records are noisy

                source = smoothed(source, settings.smooth, interpolation=settings.interpolation, ends=settings.ends)
            elif source.velocities is None:
                noise = noise_notes(source)
            # Speeds at the ends of a noisy record have no meaning.
            lines += noise or moving_ends(source, settings.ends)
        self._notes += [f"{name}: {line}" for line in (*getattr(source, "notes", ()), *lines)]
        return source

    def _check_file(self, i: int) -> None:
        pose = self.waypoints.poses[i]
        for key in ("position", "quaternion", "tilt_torsion", "time"):
            if getattr(pose, key) is not None:
                name = f"{self.waypoints.name(i)}.{key}"
                raise ConfigError(self.waypoints.path, f"{name}: must be absent where a file leads to the pose")

    def _check_times(self, first: int, last: int) -> None:
        waypoints, previous = self.waypoints, None
        for i in range(first, last + 1):
            time = waypoints.poses[i].time
            if time is None and (i > first or first > 0):
                raise ConfigError(waypoints.path, f"{waypoints.name(i)}.time is missing: that of the pose, s")
            time = 0.0 if time is None else time
            if previous is not None and not time > previous:
                raise ConfigError(
                    waypoints.path,
                    f"{waypoints.name(i)}.time = {time:g}: must be above that of {waypoints.name(i - 1)}, {previous:g}",
                )
            previous = time

    def _check_rates(self, first: int, last: int) -> None:
        poses = self.waypoints.poses[first : last + 1]
        needed = ["velocity"] + ["acceleration"] * any(pose.acceleration is not None for pose in poses)
        for key in needed if self._is_hermite else ():
            for i, pose in enumerate(poses, start=first):
                if getattr(pose, key) is None and not pose.rest:
                    unit = "m/s" if key == "velocity" else "m/s^2"
                    raise ConfigError(
                        self.waypoints.path,
                        f"{self.waypoints.name(i)}.{key} is missing: [x, y, z] in {unit}, for interpolation = "
                        '"hermite"',
                    )

    def _curve(self, problem: Problem, z0: float, first: int, last: int) -> Spline:
        waypoints, spec = self.waypoints, self.waypoints.plan_file
        chosen, frame = slice(first, last + 1), waypoints.frame
        poses, points = waypoints.poses[chosen], waypoints.points(z0)
        interpolation = spec.interpolation or "cubic"
        rates = {name: np.array([self._rate(pose, name) for pose in poses]) for name in ("velocity", "acceleration")}
        velocities, accelerations = (frame.rotated(values) for values in rates.values())
        if self._is_hermite:
            derivatives = {"velocities": velocities}
            derivatives |= {} if np.isnan(accelerations).all() else {"accelerations": accelerations}
        else:
            derivatives = {"end_velocities": velocities[[0, -1]], "end_accelerations": accelerations[[0, -1]]}
        try:
            curve = interpolated(
                np.array([pose.time or 0.0 for pose in poses]),
                points[chosen],
                pose_quaternions(waypoints, points)[chosen] if isinstance(problem.robot, PlatformRobot) else None,
                interpolation=interpolation,
                ends=spec.ends or "rest",
                **derivatives,
            )
            pattern = waypoints.robot_file.own_pattern
            return kept_to(pattern, curve, is_planar=False) if PATTERNS[pattern].is_jointed else curve
        except InputError as error:
            raise ConfigError(waypoints.path, f"{waypoints.name(first)} to {waypoints.name(last)}: {error}") from error

    def _rate(self, pose, name: str) -> list[float]:
        # A pose at rest has zero velocity and acceleration.
        value = getattr(pose, name)
        return value if value is not None else [0.0 if pose.rest else np.nan] * 3
