"""Types of the arguments of public functions, with the rules that they must satisfy: numbers, words and paths.

A rule is called with the name of an argument, for errors, and its value, and refuses what the argument may not be.
`api.arguments.checks` reads the rules from signatures.
"""

import dataclasses
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from cspr_jax.errors import InputError
from cspr_jax.errors.given_numbers import ANY, Numbers, checked_integer
from cspr_jax.errors.suggestions import one_of

Rule = Callable[[str, Any], None]

LARGEST_LENGTH = 1e6  # m
LARGEST_TIME = 1e12  # s; powers of times must not overflow
LARGEST_POPULATION = 4096
LARGEST_DIVISIONS = 128
MAX_CABLES = 1000
MOST_DIGITS = 15  # decimal digits of a floating-point number
LARGEST_SAMPLES = 1_000_000
UNBOUNDED = 10**9  # maximum of numbers that the function itself bounds more narrowly


@dataclasses.dataclass(frozen=True)
class Integer:
    """Rule of whole numbers."""

    minimum: int
    maximum: int

    def __call__(self, key: str, value: Any) -> None:
        """Refuse other values."""
        checked_integer(key, value, self.minimum, self.maximum)


@dataclasses.dataclass(frozen=True)
class Kind:
    """Rule of values of some types, or with some attributes, where importing the type would take time."""

    allowed: str
    kinds: tuple[type, ...] = ()
    has: tuple[str, ...] = ()

    def __call__(self, key: str, value: Any) -> None:
        """Refuse other values."""
        if not (isinstance(value, self.kinds) or (self.has and all(hasattr(value, name) for name in self.has))):
            raise InputError(key, value, self.allowed)
        if isinstance(value, str | os.PathLike) and "\0" in str(value):
            raise InputError(key, value, f"{self.allowed}, without a NUL character")


@dataclasses.dataclass(frozen=True)
class Choice:
    """Rule that lets some strings or None pass, and applies another rule to all else."""

    rule: Rule
    others: tuple[str | None, ...]

    def __call__(self, key: str, value: Any) -> None:
        """Refuse other values."""
        if (value is None or isinstance(value, str)) and value in self.others:
            return
        try:
            self.rule(key, value)
        except InputError as error:
            if not isinstance(value, str) or error.problem:
                raise
            raise InputError(key, value, one_of(value, filter(None, self.others), error.allowed)) from None


@dataclasses.dataclass(frozen=True)
class Many:
    """Rule of collections, each item of which another rule checks."""

    rule: Rule
    allowed: str

    def __call__(self, key: str, value: Any) -> None:
        """Refuse other values."""
        is_scalar = getattr(value, "shape", None) == ()
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Collection) or is_scalar:
            raise InputError(key, value, self.allowed)
        for i, one in enumerate(value):
            self.rule(f"{key}[{i}]", one)


def or_none(rule: Rule) -> Choice:
    """Rule of an argument that may be None, too, and says so."""
    if isinstance(rule, Choice):
        return Choice(or_none(rule.rule).rule, (*rule.others, None))
    if isinstance(rule, Numbers | Kind) and "None" not in rule.allowed:
        rule = dataclasses.replace(rule, allowed=f"{rule.allowed}, or None")
    return Choice(rule, (None,))


def _names(key: str, value: Any) -> None:
    # An iterator can be read only once: the function that reads it checks its names.
    if not isinstance(value, str | Iterator):
        Many(TEXT, "a name, or several")(key, value)


def _robot_names(key: str, value: Any) -> None:
    one = Kind("a string, or a path", (str, os.PathLike))
    (one if isinstance(value, str | os.PathLike) else Many(one, "names and paths of robots"))(key, value)


def _picture_size(key: str, value: Any) -> None:
    if not isinstance(value, str):
        Numbers('a width and a height in cm, as (16, 10) or "16x10"', ((2,),))(key, value)


def _coordinates(key: str, value: Any) -> None:
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise InputError(key, value, "a number by the name of each axis")
    for name, number in value.items():
        Numbers("a finite number")(f"{key}[{name!r}]", number)


def _pose(key: str, value: Any) -> None:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise InputError(key, value, "a position (3,) in m, and a unit quaternion (4,), scalar first")
    Numbers("a position: three finite numbers, m", ((3,),))(key, value[0])
    Numbers("a unit quaternion: four numbers, scalar first", ((4,),))(key, value[1])


TEXT = Kind("a string", (str,))
PATH = Kind("a path", (str, os.PathLike))
Names = Annotated[str | Iterable[str], _names]
PathNames = Annotated[Sequence[str | Path], Many(PATH, "paths of run directories and results")]
RobotNames = Annotated[str | Path | Iterable[str | Path], _robot_names]
Coordinates = Annotated[Mapping[str, float], _coordinates]
CellCoordinates = Annotated[Sequence[Mapping[str, float]], Many(_coordinates, "a list of coordinates by axis")]
PictureSize = Annotated[str | tuple[float, float], _picture_size]
Definition = Annotated[Literal["grid", "scan", "equal-volume"], TEXT]
Pose = Annotated[tuple[ArrayLike, ArrayLike], _pose]
File = Annotated[
    str | Path | Mapping[str, Any],
    Kind("the path of a file, or a dictionary of what it holds", (str, os.PathLike, Mapping)),
]
Parameters = Annotated[Mapping[str, float] | None, Kind("a dictionary of parameters and their values", (Mapping,))]

Divisions = Annotated[int, Integer(4, LARGEST_DIVISIONS)]
Cables = Annotated[Sequence[int], Many(Integer(0, MAX_CABLES - 1), "a list of cables, from 0 on")]
Population = Annotated[int, Integer(16, LARGEST_POPULATION)]
Samples = Annotated[int, Integer(1, LARGEST_SAMPLES)]
Count = Annotated[int, Integer(1, UNBOUNDED)]
Seed = Annotated[int, Integer(0, UNBOUNDED)]
AnyInteger = Annotated[int, Integer(-UNBOUNDED, UNBOUNDED)]
TileRange = Annotated[tuple[int, int], Numbers("two integers, first and end", ((2,),))]

NUMBER = Numbers("a number", infinite=True, nan=True)
Digits = Annotated[int, Integer(1, MOST_DIGITS)]
Positive = Annotated[float, Numbers("a finite number > 0", positive=True)]
NotNegative = Annotated[float, Numbers("a finite number >= 0", minimum=0.0)]
NotNegativeOrNone = Annotated[float | None, Choice(Numbers("a finite number >= 0", minimum=0.0), (None,))]
Length = Annotated[float, Numbers("a number > 0, in m", positive=True)]
Diameter = Annotated[float, Numbers("a number >= 0, in m", minimum=0.0)]
CableErrors = Annotated[ArrayLike, Numbers("a number >= 0, in m, or one for each position", ((), (ANY,)), minimum=0.0)]
Acceleration = Annotated[float, Numbers("a number >= 0, in m/s^2", minimum=0.0)]
RampTime = Annotated[float, Numbers("a finite number >= 0, s", minimum=0.0)]
Phase = Annotated[ArrayLike, Numbers("a finite number, rad", traced=True)]
Tau = Annotated[ArrayLike, Numbers("a number from 0 to 1", minimum=0.0, maximum=1.0, traced=True)]
Arcs = Annotated[ArrayLike, Numbers("a whole number from 1 on", minimum=1.0, maximum=UNBOUNDED, traced=True)]
Turns = Annotated[ArrayLike, Numbers("a number > 0", positive=True, maximum=UNBOUNDED, traced=True)]

_DURATION = Numbers("a finite number > 0, s", positive=True, traced=True)
Duration = Annotated[ArrayLike, _DURATION]
DurationOrNone = Annotated[ArrayLike | None, Choice(_DURATION, (None,))]
Durations = Annotated[ArrayLike, Numbers("finite numbers > 0 of shape (n,), s", ((ANY,),), positive=True)]


def times(allowed: str, *shapes: tuple[int | None, ...]) -> Numbers:
    """Rule of times, whose powers must not overflow."""
    words = f"times {allowed}, at most {LARGEST_TIME:.0e} s"
    return Numbers(words, shapes, minimum=-LARGEST_TIME, maximum=LARGEST_TIME)


Times = Annotated[ArrayLike, times("(n,), s", (ANY,))]
ManyTimes = Annotated[ArrayLike, times("(n,) or (k, n), s", (ANY,), (ANY, ANY))]

Frequencies = Annotated[ArrayLike, Numbers("numbers > 0, rad/s", ((), (ANY,)), positive=True)]
_FREQUENCIES = ("natural", "best", "fastest", "slowest")
_FREQUENCY = 'a number > 0, rad/s, or "natural", "best", "fastest" or "slowest"'
Rate = Annotated[ArrayLike, Numbers("a number > 0, rad/s", positive=True, traced=True)]
Frequency = Annotated[ArrayLike, Choice(Numbers(_FREQUENCY, positive=True, traced=True), _FREQUENCIES)]

# Bounds of lengths, as in robot files.
LENGTHS: dict[str, Any] = {"minimum": -LARGEST_LENGTH, "maximum": LARGEST_LENGTH}
POINTS = Numbers("finite numbers of shape (n, 3), n >= 1, at most 1e6 m", ((ANY, 3),), traced=True, **LENGTHS)
_STARTS = "finite numbers of shape (3,) or (n, 3), at most 1e6 m"
Point = Annotated[ArrayLike, Numbers("three finite numbers, at most 1e6 m", ((3,),), traced=True, **LENGTHS)]
Points = Annotated[ArrayLike, POINTS]
PointOrPoints = Annotated[ArrayLike, Numbers(_STARTS, ((3,), (ANY, 3)), traced=True, **LENGTHS)]
StartOrRest = Annotated[ArrayLike, Numbers(f"None, or {_STARTS}", ((3,), (ANY, 3)), **LENGTHS)]
PointsOfMany = Annotated[
    ArrayLike, Numbers("finite numbers of shape (k, n, 3), at most 1e6 m", ((ANY, ANY, 3),), **LENGTHS)
]
VectorsOfMany = Annotated[ArrayLike, Numbers("None, or finite numbers of shape (k, n, 3)", ((ANY, ANY, 3),))]
VectorOrVectors = Annotated[ArrayLike, Numbers("finite numbers of shape (3,) or (n, 3)", ((3,), (ANY, 3)))]
PointOfEachCable = Annotated[
    ArrayLike,
    Numbers("finite numbers of shape (n, 3), one row a cable, at most 1e6 m", ((ANY, 3),), traced=True, **LENGTHS),
]
_ARRAYS = (list, tuple, np.ndarray)
PointsOfPaths = Annotated[np.ndarray | Sequence[Any], Kind("arrays (k, 3) of points, m", _ARRAYS)]
QuaternionsOfPaths = Annotated[np.ndarray | Sequence[Any], Kind("arrays (k, 4)", _ARRAYS)]
Coordinates3 = Annotated[ArrayLike, Numbers("three coordinates, at most 1e6 m", ((3,),), **LENGTHS)]
Axes = Annotated[ArrayLike, Numbers("a vector [x, y, z], or one a cable", ((3,), (ANY, 3)))]
Radii = Annotated[ArrayLike, Numbers("a number >= 0, in m, or one a cable", ((), (ANY,)))]
Winch = Annotated[Mapping[str, Any], Kind("numbers by the keys of [winch] in robot files", (Mapping,))]
Stiffnesses = Annotated[ArrayLike, Numbers("a number > 0, in N, or one a cable", ((), (ANY,)), positive=True)]
Inertia = Annotated[ArrayLike, Numbers("three rows of three finite numbers, kg m^2", ((3, 3),))]
ReleaseRange = Annotated[
    Sequence[float] | None, Choice(Numbers("[least, largest], at most 1e6 m", ((2,),), **LENGTHS), (None,))
]

_DEPTH, _DEPTHS = "a number > 0, at most 1e6 m", "a number > 0, at most 1e6 m, or (n,) of them"
DEPTHS = Numbers(_DEPTHS, ((), (ANY,)), positive=True, maximum=LARGEST_LENGTH)
Depths = Annotated[ArrayLike, DEPTHS]
Depth = Annotated[ArrayLike, Numbers(_DEPTH, positive=True, maximum=LARGEST_LENGTH, traced=True)]

Quaternions = Annotated[ArrayLike, Numbers("None, or unit quaternions of shape (n, 4), scalar first", ((ANY, 4),))]
QuaternionOrNone = Annotated[
    ArrayLike | None,
    Choice(Numbers("None, or a quaternion of shape (4,), scalar first", ((4,),), traced=True), (None,)),
]
QuaternionsOfMany = Annotated[ArrayLike, Numbers("None, or quaternions of shape (k, n, 4)", ((ANY, ANY, 4),))]
QuaternionsAtEnds = Annotated[Any, Numbers("two unit quaternions, scalar first", ((2, 4),), traced=True)]
BetaHats = Annotated[Any, Numbers("two finite numbers", ((2,),), traced=True)]
BetaHat = Annotated[
    float | Literal["preferred"] | None,
    Choice(Numbers('a finite number, "preferred", or None', minimum=-100.0, maximum=100.0), ("preferred", None)),
]
Tensions = Annotated[
    ArrayLike | None, Choice(Numbers("a number in N, or one a cable", ((), (ANY,)), infinite=True), (None,))
]
TensionsOfPoses = Annotated[
    ArrayLike | None,
    Choice(
        Numbers("numbers > 0 of shape (), (n_cables,) or (n, n_cables), N", ((), (ANY,), (ANY, ANY)), positive=True),
        (None,),
    ),
]
Wrenches = Annotated[ArrayLike, Numbers("finite numbers of shape (k, dof)", ((ANY, ANY),))]
WrenchExtents = Annotated[ArrayLike, Numbers("finite numbers, one a degree of freedom", ((ANY,),))]

# Measurements for calibration; NaN where nothing was measured.
_READINGS = "finite numbers of shape (k, n_cables), m or rad, NaN where none was measured"
_MEASURED: dict[str, Any] = {"nan": True, **LENGTHS}


def _readings_or_file(key: str, value: Any) -> None:
    if not isinstance(value, str | os.PathLike):
        Numbers(f"{_READINGS}, or the path of a table", ((ANY, ANY),), nan=True, minimum=-1e9, maximum=1e9)(key, value)
    else:
        PATH(key, value)


def _distances_or_file(key: str, value: Any) -> None:
    if isinstance(value, str | os.PathLike):
        PATH(key, value)
    elif value is not None:
        Numbers("rows of two cables, a distance and a deviation, m, or the path of a table", ((ANY, 4),))(key, value)


ReadingsOrFile = Annotated[Any, _readings_or_file]
MeasuredPositions = Annotated[
    ArrayLike, Numbers("None, or numbers of shape (k, 3), at most 1e6 m", ((ANY, 3),), **_MEASURED)
]
MeasuredQuaternions = Annotated[ArrayLike, Numbers("None, or unit quaternions of shape (k, 4)", ((ANY, 4),), nan=True)]
CalibrationDeviations = Annotated[
    ArrayLike, Numbers("one to three numbers > 0, m, m and rad", ((), (ANY,)), positive=True)
]
DistanceRows = Annotated[Any, _distances_or_file]
NextCount = Annotated[int, Integer(0, 1000)]
