"""The orientations of one position in three dimensions: tilt around its azimuth, torsion upward."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from cspr_jax.errors import InputError
from cspr_jax.numerics.shapes import Int
from cspr_jax.outputs.plots.style.labels import COLOURS, chosen, robot_name
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.store.reading.result import Result

AXES = ("torsion", "tilt_azimuth", "tilt")
SECTIONS = 17
# The wide line is visible on both sides of the narrow one where both outlines coincide.
_ACCESSIBLE, _ATTAINED = ("#b0b0b0", 2.6), (COLOURS[0], 1.0)


def envelope_figure(
    result: Result, verdicts: Int[np.ndarray, "n_torsions n_azimuths n_tilts"], fixed: list[str]
) -> Figure:
    """Outlines of the accessible and of the attained orientations, at some torsions."""
    torsion, azimuth, tilt = (result.axes[name] for name in AXES)
    flags = verdicts.astype(int)
    accessible = (flags & Verdict.NOT_ACCESSIBLE.value) == 0
    attained = (flags & ~Verdict.FEWER_ARCS_UNDECIDED.value) == 0
    levels = np.flatnonzero(accessible.any((1, 2)))
    if not len(levels):
        raise InputError("--envelope", "nothing is accessible", "a place with accessible orientations")
    shown = levels[chosen(len(levels), SECTIONS)]
    figure = Figure(figsize=(10.5, 4.8), layout="constrained")
    radius = np.degrees(tilt[accessible.any((0, 1))].max()) + 10.0
    for number, view in enumerate(((22.0, -60.0), (12.0, 30.0)), start=1):
        panel = figure.add_subplot(1, 2, number, projection="3d", elev=view[0], azim=view[1], computed_zorder=False)
        panel.set_box_aspect((4.0, 4.0, 3.0), zoom=1.12)
        for orientations, style in ((accessible, _ACCESSIBLE), (attained, _ATTAINED)):
            for level in shown:
                _outline(panel, azimuth, tilt, orientations[level], float(np.degrees(torsion[level])), style)
        panel.set(
            xlim=(-radius, radius),
            ylim=(-radius, radius),
            zlim=(np.degrees(torsion[levels[0]]), np.degrees(torsion[levels[-1]])),
            xlabel="tilt · cos azimuth (°)",
            ylabel="tilt · sin azimuth (°)",
        )
        # Labels that matplotlib rotates may be upside down.
        panel.zaxis.set_rotate_label(False)
        panel.set_zlabel("torsion (°)", rotation=90.0)
        # Use few ticks, since an axis may be seen nearly from its end.
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 3, 4.5, 9, 10], prune="both"))
    handles = [Line2D([], [], color=colour, linewidth=width) for colour, width in (_ACCESSIBLE, _ATTAINED)]
    figure.legend(handles, ["accessible", "attained from rest"], loc="outside lower center", ncols=2, frameon=False)
    title = f"{robot_name(result)}: orientations of a place"
    figure.suptitle(f"{title}\n{', '.join(fixed)}")
    return figure


def _outline(
    panel, azimuth: np.ndarray, tilt: np.ndarray, inside: np.ndarray, height: float, style: tuple[str, float]
) -> None:
    # Outline (n_azimuths, n_tilts) cells. Repeat the first azimuth and add one more tilt, so that the line closes.
    around = np.append(azimuth, azimuth[0] + 2.0 * np.pi)
    outward = np.degrees(np.append(tilt, 2.0 * tilt[-1] - tilt[-2]))
    x, y = (np.outer(f(around), outward) for f in (np.cos, np.sin))
    closed = np.pad(inside.astype(float), ((0, 1), (0, 1)))
    closed[-1] = closed[0]
    if closed.any():
        panel.contour(x, y, closed, levels=[0.5], colors=[style[0]], linewidths=style[1], zdir="z", offset=height)
