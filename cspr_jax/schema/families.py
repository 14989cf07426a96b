"""Table of trajectory families: one row for each.

A new family needs a motion (`motion.motion.Motion`), a class that joins poses by it (`motion.leg.Leg`), and a row.
"""

import contextlib
import dataclasses
import importlib
from collections.abc import Iterator, Mapping
from typing import Any

from cspr_jax.schema.plugins import ExtensibleRows

# Proofs on which answers of a family can rest. A family's own proofs are faster, but treat cables as lines from points:
# where there are pulleys, or bodies that can collide, plans prove its motions again like any motion.
PROOFS = {
    "any": "the proof of any motion, which knows pulleys, bodies that can meet, and uncertainties",
    "robust": "one of its own, which knows uncertainties on as many cables as degrees of freedom",
    "own": "one of its own, without uncertainties",
}


@dataclasses.dataclass(frozen=True)
class Family:
    """Trajectory family.

    Fields:
        name: name in files.
        description: a phrase for people, without a full stop.
        legs: for each pattern of motion of the robots that it moves, a row of `robots.model.patterns`, the class that
            joins poses: "module:Class".
        free_end: whether A''(1) of its amplitude function is free: (1.27) and (1.28) instead of (2.49).
        rests_anywhere: whether its motions can rest at any position, so that it has neither P0 nor an amplitude
            function.
        any_cables: patterns of the robots that may have more cables than degrees of freedom.
        takes_amplitude: whether its motions follow the plan's amplitude function, rather than a law of their own.
        keys: keys of a plan that are allowed only with this family, and with others that list them too.
        pose_keys: likewise keys of a pose to which the family leads.
        end_keys: likewise keys of a pose to which, or from which, the family leads.
        proof: proof on which its answers rest, a row of `PROOFS`.
        is_searched: whether its motions are found by a search, which may begin from motions of other families.
        begins_searches: whether such searches begin from its motions, where they find nothing else or nothing fast.
        precedes_searches: whether such searches begin from its motions at once, and never give slower motions.
    """

    name: str
    description: str
    legs: Mapping[str, str]
    free_end: bool = False
    rests_anywhere: bool = False
    any_cables: tuple[str, ...] = ()
    takes_amplitude: bool = True
    keys: tuple[str, ...] = ()
    pose_keys: tuple[str, ...] = ()
    end_keys: tuple[str, ...] = ()
    proof: str = "own"
    is_searched: bool = False
    begins_searches: bool = False
    precedes_searches: bool = False

    def leg(self, pattern: str) -> Any:
        """Class that joins the poses of a robot."""
        module, _, name = self.legs[pattern].partition(":")
        return getattr(importlib.import_module(module), name)


# Time functions of a platform's rotation that have no parameter beta-hat.
WITHOUT_BETA_HAT = ("beta_0", "beta_1")
# All rows of `robots.model.patterns`.
ANY_PATTERN = ("1T", "2T", "3T", "1R2T", "2R3T", "3R3T", "3R")
_ROWS = (
    Family(
        "hypocycloid-standard",
        "standard hypocycloids between any poses (thesis chapter 2)",
        {
            "3T": "cspr_jax.families.swings.hypocycloid_leg:Hypocycloids",
            "3R3T": "cspr_jax.families.platforms.leg:StandardPoses",
        },
        any_cables=("3T", "3R3T"),
        proof="robust",
        begins_searches=True,
    ),
    Family(
        "transition",
        "from rest to a target, swings at it, and back to rest (thesis chapter 1)",
        dict.fromkeys(("2T", "3T"), "cspr_jax.families.swings.transitions.transition_leg:Transitions"),
        free_end=True,
        any_cables=("2T", "3T"),
        proof="robust",
        begins_searches=True,
    ),
    Family(
        "hypocycloid",
        "hypocycloids of variable amplitude, for platforms (thesis chapter 3)",
        {"3R3T": "cspr_jax.families.platforms.leg:VariablePoses"},
        any_cables=("3R3T",),
        proof="robust",
        begins_searches=True,
    ),
    *(
        Family(
            name,
            f"straight lines from rest to rest {law}",
            dict.fromkeys(("2T", "3T"), "cspr_jax.families.lines.leg:TimedLines"),
            rests_anywhere=True,
            takes_amplitude=False,
            any_cables=("2T", "3T"),
            begins_searches=name == "quintic",
            keys=("max_acceleration", *keys),
        )
        for name, law, keys in (
            ("s-curve", "by the S-model (Boralugoda), in the least time", ("rule",)),
            ("quintic", "by a quintic in time, in the least time", ()),
            ("cubic", "by a cubic in time, in the least time", ()),
        )
    ),
    Family(
        "bezier",
        "Bezier curves of the second order, at rest in every pose (launch paper)",
        dict.fromkeys(("2T", "3T"), "cspr_jax.families.beziers.leg:Beziers"),
        rests_anywhere=True,
        takes_amplitude=False,
        any_cables=("2T", "3T"),
        keys=("first_control_point", "least"),
        pose_keys=("duration",),
    ),
    Family(
        "spline",
        "splines through poses at their times, or a file of samples",
        dict.fromkeys(ANY_PATTERN, "cspr_jax.families.splines.leg:Splines"),
        rests_anywhere=True,
        takes_amplitude=False,
        any_cables=ANY_PATTERN,
        proof="any",
        keys=("motion", "trajectory", "interpolation", "ends", "smooth", "stretch"),
        pose_keys=("motion", "trajectory"),
        end_keys=("time", "velocity", "acceleration"),
    ),
    Family(
        "ellipse",
        "turns on harmonic ellipses, circles and lines, and the ways from one to another, from rest and to rest",
        dict.fromkeys(("2T", "3T", "3R3T"), "cspr_jax.families.ellipses.leg:Ellipses"),
        rests_anywhere=True,
        any_cables=("2T", "3T", "3R3T"),
        proof="any",
        keys=("ellipse", "turns"),
        pose_keys=("turns",),
        end_keys=("ellipse",),
    ),
    Family(
        "path",
        "along lines, splines, arcs, files of points and G-code, in the least time",
        dict.fromkeys(ANY_PATTERN, "cspr_jax.families.paths.leg:Paths"),
        rests_anywhere=True,
        takes_amplitude=False,
        any_cables=ANY_PATTERN,
        proof="any",
        begins_searches=True,
        precedes_searches=True,
        keys=("path",),
        pose_keys=("path",),
    ),
    Family(
        "free",
        "the fastest, or otherwise best, motions between poses that a search finds",
        dict.fromkeys(("1T", "2T", "3T", "1R2T", "3R3T"), "cspr_jax.families.free.leg:FreeMotions"),
        rests_anywhere=True,
        takes_amplitude=False,
        any_cables=("1T", "2T", "3T", "1R2T", "3R3T"),
        proof="any",
        is_searched=True,
        keys=("objective", "duration_max", "end_accelerations", "together", "starts", "search_time"),
        end_keys=("velocity",),
    ),
)


def _add(row: Family) -> None:
    if not isinstance(row, Family) or row.name in [other.name for other in _ROWS]:
        raise TypeError("must be a Family with a name of its own")
    FAMILIES[row.name] = row


FAMILIES: dict[str, Family] = ExtensibleRows({row.name: row for row in _ROWS}, "cspr_jax.families", _add)


def moving(pattern: str) -> list[str]:
    """Names of the families that move a robot."""
    return [row.name for row in FAMILIES.values() if pattern in row.legs]


@contextlib.contextmanager
def registered(family: Family) -> Iterator[None]:
    """Add a family for as long as a block lasts."""
    FAMILIES[family.name] = family
    try:
        yield
    finally:
        del FAMILIES[family.name]
