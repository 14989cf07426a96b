"""Checks of the arguments of all public functions, by their names: kinds, shapes and ranges, before anything runs.

Conditions on several arguments, a robot or a file are checked by the function itself. Arguments of the functions
that jax may trace pass where jax traces them.
"""

import functools
import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np

from cspr_jax.api.arguments.rules import (
    DIFFERENTIABLE,
    INSTEAD,
    Rule,
    choice,
    instants,
    integer,
    kind_of,
    many,
    real,
    refuse_tracers,
    word,
)
from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import ask_about_keywords
from cspr_jax.schema.given_numbers import ANY
from cspr_jax.schema.limits import LARGEST_GRID, LARGEST_MAX_ARCS, LIMITS, UNCERTAINTIES

Function = TypeVar("Function", bound=Callable[..., Any])

LARGEST_LENGTH = 1e6  # m
LARGEST_POPULATION, LARGEST_DIVISIONS, LARGEST_SAMPLES = 4096, 128, 1_000_000
MOST = 10**9  # for numbers that functions bound more narrowly by themselves


def checked(function: Function, name: str = "", module: str = "") -> Function:
    """A function that checks its arguments first."""
    signature, own_name = inspect.signature(function), name or function.__qualname__
    instead = INSTEAD.get(own_name, "jax differentiates single motions with slacks, sampled_margin and tensions")
    rules = {
        key: OF_FUNCTIONS.get(f"{own_name}.{key}") or ARGUMENTS[key] for key in signature.parameters if key != "self"
    }

    @functools.wraps(function)
    def with_checks(*arguments: Any, **keywords: Any) -> Any:
        try:
            bound = signature.bind(*arguments, **keywords).arguments
        except TypeError:
            ask_about_keywords(own_name, keywords, signature.parameters)
            return function(*arguments, **keywords)  # which says what is missing, or too many, in its own name
        for key, value in bound.items():
            if own_name not in DIFFERENTIABLE:
                refuse_tracers(key, value, instead)
            if key in rules:
                try:
                    rules[key](key, value)
                except InputError:
                    refuse_tracers(key, value, "jax may trace other arguments of this function alone")
                    raise
        return function(*arguments, **keywords)

    if name:
        with_checks.__name__, with_checks.__qualname__, with_checks.__module__ = name, name, module
    return with_checks  # type: ignore[return-value]


def _record(allowed: str, names: Iterable[str]) -> Rule:
    # An object whose attributes of these names are real numbers.
    kind, field = kind_of(allowed, has=tuple(names)), real("real numbers", traced=True, none=True, infinite=True)

    def check(key: str, value: Any) -> None:
        kind(key, value)
        for name in names:
            field(f"{key}.{name}", getattr(value, name))

    return check


def _limits(key: str, value: Any) -> None:
    if value is not None:
        _record("Limits(...), or None", [row.name for row in LIMITS])(key, value)
        if value.uncertainty is not None:
            names = [row.name for row in UNCERTAINTIES]
            _record("Uncertainty(...), or None", names)(f"{key}.uncertainty", value.uncertainty)


def _pose(key: str, value: Any) -> None:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise InputError(key, value, "a position (3,) in m, and a unit quaternion (4,), scalar first")
    real("a position: three finite numbers, m", (3,))(key, value[0])
    real("a unit quaternion: four numbers, scalar first", (4,))(key, value[1])


def _coordinates(key: str, value: Any) -> None:
    if value is None:
        return
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise InputError(key, value, "a number by the name of each axis")
    for name, number in value.items():
        real("a finite number", ())(f"{key}[{name!r}]", number)


def _results(key: str, value: Any) -> None:
    if isinstance(value, list | tuple):
        for i, one in enumerate(value):
            _RESULT(f"{key}[{i}]", one)
    else:
        _RESULT(key, value)


def _result(key: str, value: Any) -> None:
    if not hasattr(value, "data_vars"):  # of xarray
        _RESULT(key, value)


def _size(key: str, value: Any) -> None:
    if value is not None and not isinstance(value, str):
        real('a width and a height in cm, as (16, 10) or "16x10"', (2,))(key, value)


def _names(key: str, value: Any) -> None:
    # An iterator can be read only once: the function that reads it looks at its names.
    if not isinstance(value, str | Iterator):
        many(kind_of("a string", str), "a name, or several")(key, value)


def _limits_or_keys(key: str, value: Any) -> None:
    if not isinstance(value, Mapping):
        _limits(key, value)


def _instants(key: str, value: Any) -> None:  # or what has a motion in itself: a file, a spline, a function
    if not (isinstance(value, str | os.PathLike) or callable(value) or hasattr(value, "state")):
        instants("(n,) in s, a path, a spline of SciPy, or a motion", (ANY,))(key, value)


_NUMBER = real("a number", (), infinite=True, nan=True)
_NUMBER_OR_NONE = real("a number, or None", (), none=True, infinite=True, nan=True)
_TEXT = kind_of("a string", str)
_TEXT_OR_NONE = kind_of("a string, or None", str, none=True)
_FLAG = kind_of("True or False", bool, np.bool_)
_PATH = kind_of("a path", str, os.PathLike)
_PATH_OR_NONE = kind_of("a path, or None", str, os.PathLike, none=True)
_FILE = kind_of("the path of a file, or a dictionary of what it holds", str, os.PathLike, Mapping)
_RESULT = kind_of("a result, or the path of one", str, os.PathLike, has=("data", "axes"))
_ROBOT = kind_of(
    "a point mass or a platform, as load_robot, point_mass or platform gives it",
    has=("base_points", "n_cables", "limits", "pattern"),
)
_ROBOT_OR_NAME = kind_of("a robot, the name of one, or its file", str, os.PathLike, has=("base_points", "limits"))
_ROBOT_NAME_OR_NONE = kind_of(
    "a robot, the name of one, its file, or None", str, os.PathLike, none=True, has=("base_points", "limits")
)
_Z_AXIS = word("down", "up")
_MANY_POINTS = real("None, or finite numbers of shape (k, n, 3)", (ANY, ANY, 3), none=True)
_ENDS = word("rest", "natural", "periodic")
_PLAN = ("answers", "points", "robot_file")  # attributes of a plan
_MOTION = ("state", "duration")
_POSITIVE = real("a finite number > 0", (), least=0.0, above=True)
_POSITIVE_OR_NONE = real("a finite number > 0, or None", (), least=0.0, above=True, none=True)
_TIME = real("a finite number > 0, s", (), least=0.0, above=True, traced=True, none=True)
LENGTHS: dict[str, Any] = {"least": -LARGEST_LENGTH, "largest": LARGEST_LENGTH}
_POINT = real("three finite numbers, at most 1e6 m", (3,), traced=True, **LENGTHS)
_POINT_OR_NONE = real("three finite numbers, at most 1e6 m, or None", (3,), traced=True, none=True, **LENGTHS)
POINTS_WORDS = "finite numbers of shape (n, 3), n >= 1, at most 1e6 m"
_POINTS = real(POINTS_WORDS, (ANY, 3), **LENGTHS)
_POINTS_OR_NONE = real(f"{POINTS_WORDS}, or None", (ANY, 3), none=True, **LENGTHS)
_TRACED_POINTS = real(POINTS_WORDS, (ANY, 3), traced=True, **LENGTHS)
_TRACED_POINTS_OR_NONE = real(f"{POINTS_WORDS}, or None", (ANY, 3), traced=True, none=True, **LENGTHS)
_STARTS = real("finite numbers of shape (3,) or (n, 3), at most 1e6 m", (3,), (ANY, 3), **LENGTHS)
_STARTS_OR_NONE = real(
    "None, or finite numbers of shape (3,) or (n, 3), at most 1e6 m", (3,), (ANY, 3), none=True, **LENGTHS
)
_AXES = real("finite numbers of shape (3,) or (n, 3), at most 1e6 m", (3,), (ANY, 3), traced=True, **LENGTHS)
_GEOMETRY = real("finite numbers of shape (n, 3), one row a cable, at most 1e6 m", (ANY, 3), traced=True, **LENGTHS)
DEPTH: dict[str, Any] = {"least": 0.0, "above": True, "largest": LARGEST_LENGTH}
DEPTH_WORDS = "a number > 0, at most 1e6 m"
_QUATERNIONS = real("None, or unit quaternions of shape (n, 4), scalar first", (ANY, 4), none=True)
_TENSIONS = real("a number in N, or one a cable", (), (ANY,), none=True, infinite=True)
_RANGE = real("[least, largest], at most 1e6 m", (2,), none=True, **LENGTHS)
_AMPLITUDE = kind_of("the name of an amplitude function, or one of amplitude(...)", str, has=("coefficients", "knots"))
_ARCS = integer(1, LARGEST_MAX_ARCS)
_WORKERS = integer(-MOST, MOST, none=True)

# Rules by the names of arguments, for all functions with an argument of this name.
ARGUMENTS: dict[str, Rule] = {
    "a": _AXES,
    "acceleration": real("a number >= 0, in m/s^2, or None", (), least=0.0, none=True),
    "acceleration_time": _TIME,
    "accelerations": _POINTS_OR_NONE,
    "accept_environment_change": _FLAG,
    "amplitude": _AMPLITUDE,
    "anyway": _FLAG,
    "arcs": real("a whole number from 1 on", (), least=1.0, largest=MOST, traced=True),
    "at": _coordinates,
    "b": _AXES,
    "base_points": _GEOMETRY,
    "best": _names,
    "beta_hat": choice(
        real('a finite number, "preferred", or None', (), least=-100.0, largest=100.0), "preferred", None
    ),
    "cable_diameter": real("a number >= 0, in m, or None", (), least=0.0, none=True),
    "cable_error": real("a number >= 0, in m, or one a place", (), (ANY,), least=0.0),
    "cable_set": _TEXT_OR_NONE,
    "capacity_length": real("a number > 0, in m, or None", (), least=0.0, above=True, none=True),
    "cells": many(_coordinates, "a list of coordinates by axis"),
    "centre": _POINT,
    "centre_of_mass": real("three coordinates, at most 1e6 m, or None", (3,), none=True, **LENGTHS),
    "centres": _POINTS,
    "condition": _TEXT,
    "control_point": _POINT,
    "control_points": _POINTS_OR_NONE,
    "definition": _TEXT,
    "directory": _PATH_OR_NONE,
    "divisions": integer(4, LARGEST_DIVISIONS),
    "dpi": _NUMBER_OR_NONE,
    "drum_radius": _POSITIVE,
    "duration": real("a finite number > 0, s", (), least=0.0, above=True, traced=True),
    "durations": real("finite numbers > 0 of shape (n,), s", (ANY,), least=0.0, above=True),
    "end": _POINT,
    "ends": _POINTS,
    "envelope": _FLAG,
    "epsilon": _NUMBER_OR_NONE,
    "errors": kind_of("LaunchErrors(...)", has=("throws", "encoder", "seed")),
    "family": _TEXT,
    "fine": _FLAG,
    "again": _FLAG,
    "folder": _PATH,
    "font_size": _NUMBER_OR_NONE,
    "frequencies": real("numbers > 0, rad/s", (), (ANY,), least=0.0, above=True),
    "frequency": choice(
        real(
            'a number > 0, rad/s, or "natural", "best", "fastest" or "slowest"', (), least=0.0, above=True, traced=True
        ),
        *("natural", "best", "fastest", "slowest"),
    ),
    "given": _FILE,
    "grid": integer(2, LARGEST_GRID),
    "gravity": _POSITIVE,
    "inertia": real("three rows of three finite numbers, kg m^2", (3, 3), traced=True),
    "interpolation": word("cubic", "quintic", "hermite"),
    "kernels": _PATH_OR_NONE,
    "law": _TEXT,
    "like": _TEXT,
    "limits": _limits,
    "lines": _TEXT_OR_NONE,
    "map": _TEXT,
    "mass": _POSITIVE,
    "max_acceleration": _POSITIVE_OR_NONE,
    "max_arcs": _ARCS,
    "max_duration": _POSITIVE_OR_NONE,
    "motion": kind_of("a motion, as hypocycloid, a plan or answers give it", has=_MOTION),
    "name": _TEXT,
    "names": _names,
    "on_tile": kind_of("a function, or None", none=True, has=("__call__",)),
    "orientations": _QUATERNIONS,
    "oscillations": real("a number > 0", (), least=0.0, above=True, largest=MOST, traced=True),
    "output": _PATH_OR_NONE,
    "path": _PATH,
    "pattern": _TEXT_OR_NONE,
    "paths": many(kind_of("a path", str, os.PathLike), "paths of run directories and results"),
    "phase": real("a finite number, rad", (), traced=True),
    "place": real("three finite numbers, at most 1e6 m", (3,), **LENGTHS),
    "plan": _PATH_OR_NONE,
    "planar": _FLAG,
    "platform_points": _GEOMETRY,
    "platform_radius": _POSITIVE,
    "point": word("mass-centre", "origin"),
    "population": integer(16, LARGEST_POPULATION),
    "positions": _POINTS,
    "precision": _TEXT,
    "preset": _TEXT_OR_NONE,
    "quaternions": _QUATERNIONS,
    "problem": kind_of("a problem, as make_problem gives it", has=("robot", "limits", "amplitude")),
    "prune": _FLAG,
    "pulley_axes": real("a vector [x, y, z], or one a cable, or None", (3,), (ANY, 3), none=True),
    "pulley_radius": real("a number >= 0, in m, or one a cable, or None", (), (ANY,), none=True),
    "pulses": _POSITIVE,
    "quantity": _TEXT_OR_NONE,
    "ramp_time": real("a finite number >= 0, s", (), least=0.0),
    "rate": _NUMBER_OR_NONE,
    "ratio": _FLAG,
    "reference": _PATH,
    "release_x": _RANGE,
    "release_y": _RANGE,
    "release_z": _RANGE,
    "result": _result,
    "results": _results,
    "robot": _ROBOT,
    "rule": _TEXT,
    "samples": integer(1, LARGEST_SAMPLES),
    "scheduler": _TEXT_OR_NONE,
    "size": _size,
    "smooth": _POSITIVE_OR_NONE,
    "solid": _FLAG,
    "speed": _NUMBER,
    "spool_radius": _POSITIVE,
    "start": _POINT_OR_NONE,
    "starts": _POINTS,
    "state": _record("a state, as a motion gives it", ("position", "velocity", "acceleration")),
    "step": _NUMBER,
    "target": _POINT,
    "targets": _POINTS,
    "tau": real("a number from 0 to 1", (), least=0.0, largest=1.0, traced=True),
    "tension_max": _TENSIONS,
    "tension_min": _TENSIONS,
    "times": _instants,
    "title": _FLAG,
    "trajectories": integer(-MOST, MOST),
    "trajectory": _TEXT_OR_NONE,
    "turns": real("a number > 0", (), least=0.0, above=True, largest=MOST, traced=True),
    "values": integer(1, MOST, none=True),
    "velocities": _POINTS_OR_NONE,
    "variable": _FLAG,
    "what": _TEXT,
    "workers": _WORKERS,
    "wrench_box": real("finite numbers, one a degree of freedom, or None", (ANY,), none=True),
    "wrench_ellipsoid": real("finite numbers, one a degree of freedom, or None", (ANY,), none=True),
    "wrenches": real("finite numbers of shape (k, dof), or None", (ANY, ANY), none=True),
    "z0": real(f"{DEPTH_WORDS}, or (n,) of them", (), (ANY,), **DEPTH),
    "z_axis": choice(kind_of('"down" or "up"'), "down", "up"),
}
# These rules hold for functions whose argument differs from the usual one of the same name.
_ONE_DEPTH = real(DEPTH_WORDS, (), traced=True, **DEPTH)
OF_FUNCTIONS: dict[str, Rule] = {
    "AvailableAccelerations.margin.accelerations": real("finite numbers of shape (3,) or (n, 3)", (3,), (ANY, 3)),
    "AvailableAccelerations.verdict.accelerations": real("finite numbers of shape (3,) or (n, 3)", (3,), (ANY, 3)),
    "attainable.z0": real(f"{DEPTH_WORDS}, or None", (), none=True, **DEPTH),
    "bezier.start": _POINT,
    "check.duration": _POSITIVE_OR_NONE,
    "check.ends": _ENDS,
    "check.limits": _limits_or_keys,
    "check.positions": _POINTS_OR_NONE,
    "check.robot": _ROBOT_OR_NAME,
    "check_many.accelerations": _MANY_POINTS,
    "check_many.ends": _ENDS,
    "check_many.limits": _limits_or_keys,
    "check_many.positions": real("finite numbers of shape (k, n, 3), at most 1e6 m", (ANY, ANY, 3), **LENGTHS),
    "check_many.quaternions": real("None, or quaternions of shape (k, n, 4)", (ANY, ANY, 4), none=True),
    "check_many.robot": _ROBOT_OR_NAME,
    "check_many.times": instants("(n,) or (k, n), s", (ANY,), (ANY, ANY)),
    "check_many.velocities": _MANY_POINTS,
    "hypocycloid.z0": _ONE_DEPTH,
    "keep_compiled_code.folder": _PATH_OR_NONE,
    "launch_range.start": _STARTS,
    "list_robots.names": many(kind_of("a string, or a path", str, os.PathLike), "names and paths of robots"),
    "least_time.start": _STARTS,
    "least_time_paths.blend_tolerance": _POSITIVE_OR_NONE,
    "least_time_paths.corner": word("stop", "blend"),
    "least_time_paths.kind": word("line", "polyline", "cubic", "quintic"),
    "least_time_paths.limits": _limits_or_keys,
    "least_time_paths.paths": kind_of("arrays (k, 3) of points, m", list, tuple, np.ndarray),
    "least_time_paths.quaternions": kind_of("arrays (k, 4), or None", list, tuple, np.ndarray, none=True),
    "least_time_paths.robot": _ROBOT_OR_NAME,
    "minimum_arcs.amplitude": choice(_AMPLITUDE, None),
    "minimum_arcs.start": _STARTS_OR_NONE,
    "minimum_pose_arcs.start": choice(_pose, None),
    "parallel_pair_robot.inertia": real("three rows of three finite numbers, kg m^2, or None", (3, 3), none=True),
    "platform.pattern": _TEXT,
    "point_mass_robot.pattern": _TEXT,
    "platform_motion.beta_hat": real("two finite numbers", (2,), traced=True),
    "platform_motion.orientations": real("two unit quaternions, scalar first", (2, 4), traced=True),
    "platform_motion.z0": _ONE_DEPTH,
    "plot.robot": _ROBOT_NAME_OR_NONE,
    "plot.z_axis": _Z_AXIS,
    "replay.given": kind_of("a plan, its file, or a dictionary of that", str, os.PathLike, Mapping, has=_PLAN),
    "report.given": kind_of("a result, a plan, or the path of one", str, os.PathLike, has=("to_xarray",)),
    "report.output": _PATH,
    "report.robot": _ROBOT_NAME_OR_NONE,
    "report.z_axis": _Z_AXIS,
    "retime.plan": kind_of("a plan, or a check", has=("feasible", "to_table")),
    "merge.directory": _PATH,
    "run.tiles": real("two integers, first and end, or None", (2,), none=True),
    "status.directory": _PATH,
    "spline.accelerations": _TRACED_POINTS_OR_NONE,
    "spline.ends": _ENDS,
    "spline.positions": _TRACED_POINTS,
    "spline.times": instants("(n,), s", (ANY,)),
    "spline.velocities": _TRACED_POINTS_OR_NONE,
    "straight_line.start": _POINT,
    "swing_range.start": _STARTS,
    "table.amplitude": _TEXT_OR_NONE,
    "table.definition": _TEXT_OR_NONE,
    "table.name": _TEXT_OR_NONE,
    "table.max_arcs": integer(1, LARGEST_MAX_ARCS, none=True),
    "transition.z0": _ONE_DEPTH,
}
