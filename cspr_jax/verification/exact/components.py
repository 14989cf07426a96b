"""Components of slacks: smooth functions of time, the smallest of which is the slack."""

from __future__ import annotations

from typing import Any, NamedTuple


class Component(NamedTuple):
    """Component of a slack.

    Fields:
        value: series.
        applies: whether it counts at all times of the block; None: it may, so that it bounds the slack from below only.
    """

    value: Any
    applies: bool | None = True
