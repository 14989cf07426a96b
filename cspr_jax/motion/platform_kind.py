"""Kinds of motions of platforms, which are static in compiled functions."""

from typing import NamedTuple


class PlatformMotionKind(NamedTuple):
    """Kind of motions of a platform: a static argument of compiled functions.

    Fields:
        variable: True for hypocycloids of variable amplitude, (3.44), False for standard ones.
        plain: True if rotations follow beta_1 of (3.66) for any beta-hat, False if they follow beta_ff of (3.93).
        from_rest: whether all segments start at rest in P0.
    """

    variable: bool = True
    plain: bool = False
    from_rest: bool = False


USUAL = PlatformMotionKind()
