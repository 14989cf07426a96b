"""Volumes of workspaces from maps, with the error due to the grid."""

import dataclasses
from typing import Any

import numpy as np

from cspr_jax.errors import InputError
from cspr_jax.errors.suggestions import with_suggestions
from cspr_jax.schema.meanings import CELL_SIDES, OPEN_CONDITIONS
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import Result

_, INSIDE, OUTSIDE = range(len(CELL_SIDES))
# Words for the reasons why cells are not proved.
OPEN_WORDS = {name: f"inside at the centre, {name} not proved" for name in OPEN_CONDITIONS} | {
    "boundary": "cut by the boundary",
    "outside": "outside at the centre, not proved",
}
LEVEL, POLAR = ("x", "y", "z"), ("radius", "azimuth", "z")


@with_suggestions
@dataclasses.dataclass(frozen=True)
class WorkspaceVolume:
    """Volume of a workspace, or area, or length, for each value of the other axes of its map.

    Fields:
        axes: the other axes, in the order of the dimensions (...) below.
        units: units of volumes, "m3", "m2" or "m".
        volume: (...) volume of the cells inside, between the first and the last points, m^3, m^2 or m.
        error: (...) error due to the grid if the boundary passes at most once between two points, m^3, m^2 or m: half
            of the way between each two points on different sides, a quarter of their cells.
        least: (...) volume of the cells that are proved inside as a whole; 0 where nothing was proved.
        most: (...) volume of all cells except those proved outside as a whole.
        proved_fraction: (...) part of the grid whose side is proved.
        undecided_fraction: (...) part of the grid whose points are undecided.
        uncertain: (...) volume of the cells that are inside for the robot as it is described, but not for every robot
            within its uncertainty, and so not part of `volume`, m^3, m^2 or m.
        open_fractions: (...) part of the grid whose cells are not proved, for each of their reasons (`cell_open`); none
            where nothing was to be proved.
    """

    axes: dict[str, np.ndarray]
    units: str
    volume: np.ndarray
    error: np.ndarray
    least: np.ndarray
    most: np.ndarray
    proved_fraction: np.ndarray
    undecided_fraction: np.ndarray
    uncertain: np.ndarray
    open_fractions: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """The volume as plain numbers.

        Returns:
            numbers and nested lists by field, as `cspr volume --json` prints them.
        """

        def plain(value: Any) -> Any:
            if isinstance(value, dict):
                return {name: plain(part) for name, part in value.items()}
            return value.tolist() if isinstance(value, np.ndarray) else value

        return {field.name: plain(getattr(self, field.name)) for field in dataclasses.fields(self)}

    def lines(self) -> list[str]:
        """The volume as lines of text.

        Returns:
            a line for each value of the other axes.
        """
        texts = []
        for index in np.ndindex(self.volume.shape):
            at = ", ".join(
                f"{name} {points[i]:.6g}" for (name, points), i in zip(self.axes.items(), index, strict=True)
            )
            text = f"{self.volume[index]:.6g} {self.units}, give or take {self.error[index]:.3g}"
            if self.proved_fraction[index] > 0.0:
                text += (
                    f"; proved between {self.least[index]:.6g} and {self.most[index]:.6g}, "
                    f"{100.0 * self.proved_fraction[index]:.4g} % of the grid"
                )
            parts = [(values[index], OPEN_WORDS[name]) for name, values in self.open_fractions.items()]
            words = ", ".join(f"{100.0 * part:.3g} % {word}" for part, word in sorted(parts)[::-1] if part > 0.0)
            if words:
                text += f"; open: {words}"
            if self.uncertain[index] > 0.0:
                text += (
                    f"; {self.uncertain[index]:.4g} {self.units} more for the robot as it is described, but not for "
                )
                text += "every robot within its uncertainty"
            if self.undecided_fraction[index] > 0.0:
                text += f"; {100.0 * self.undecided_fraction[index]:.4g} % of the grid undecided"
            texts.append(f"{at}: {text}" if at else text)
        return texts


def volume_of(result: Result) -> WorkspaceVolume:
    """Volume of the workspace that a map has found, or its area where the map is a section."""
    if not result.is_map or "verdict" not in result.data:
        raise InputError("result", None, "must be a map that stores verdict", problem="no verdicts")
    names, axes = list(result.axes), POLAR if "radius" in result.axes else LEVEL
    spread = [name for name in axes if len(result.axes.get(name, ())) > 1]
    if not spread:
        raise InputError("result", None, "must have two places or more", problem="a single place")
    order = [names.index(name) for name in spread]
    others = [i for i in range(len(names)) if names[i] not in spread]
    weights = _weights([_widths(result.axes[name], name) for name in spread])

    def placed(name: str) -> np.ndarray:
        values = result.data[name].transpose(*others, *order)
        # The other axes of position have only one point.
        singles = tuple(i for i, k in enumerate(others) if names[k] in axes)
        return values.squeeze(axis=singles)

    verdict = placed("verdict")
    inside, count = verdict == 0, len(spread)
    side = placed("cell_side") if "cell_side" in result.data else np.zeros(verdict.shape, np.int16)
    total, over = weights.sum(), tuple(range(-count, 0))

    def volume(chosen: np.ndarray) -> np.ndarray:
        return np.asarray((chosen * weights).sum(axis=over))

    open_fractions = {}
    if "cell_open" in result.data:
        reason = placed("cell_open")
        open_fractions = {name: volume(reason == k) / total for k, name in enumerate(OPEN_CONDITIONS) if k}
    return WorkspaceVolume(
        axes={names[i]: result.axes[names[i]] for i in others if names[i] not in axes},
        units="m" if count == 1 else f"m{count}",
        volume=volume(inside),
        error=0.25 * volume(_at_border(inside, count)),
        least=volume(side == INSIDE),
        most=total - volume(side == OUTSIDE),
        proved_fraction=volume(side != 0) / total,
        undecided_fraction=volume(verdict == Verdict.UNDECIDED) / total,
        uncertain=volume(verdict == Verdict.UNCERTAINTY),
        open_fractions=open_fractions,
    )


def _widths(points: np.ndarray, name: str) -> np.ndarray:
    # Widths of the parts of an axis that its points represent; those of radii are multiplied by the radius.
    order = np.argsort(points)
    gaps = np.diff(points[order])
    widths = np.empty(len(points))
    widths[order] = 0.5 * (np.append(gaps, 0.0) + np.append(0.0, gaps))
    return widths * points if name == "radius" else widths


def _weights(widths: list[np.ndarray]) -> np.ndarray:
    weights = widths[0]
    for more in widths[1:]:
        weights = weights[..., None] * more
    return weights


def _at_border(inside: np.ndarray, count: int) -> np.ndarray:
    # Mark the cells with a neighbour, along one of the last axes, on the other side.
    at_border = np.zeros(inside.shape, bool)
    for axis in range(inside.ndim - count, inside.ndim):
        values, border = np.moveaxis(inside, axis, 0), np.moveaxis(at_border, axis, 0)
        differs = values[1:] != values[:-1]
        border[1:] |= differs
        border[:-1] |= differs
    return at_border
