"""Landings of a sample of throws about the target (launch paper, Fig. 15)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from cspr_jax.outputs.plots.style.labels import COLOURS, robot_name
from cspr_jax.store.reading.result import Result

# Largest number of points that are drawn: more would hide each other.
SHOWN = 3000
MILLIMETRES = 1e3


def landing_figure(result: Result) -> Figure:
    """The landings of a motion's sample of throws, over the target."""
    figure = Figure(figsize=(6.4, 5.6), layout="constrained")
    panel = figure.subplots()
    landings = result.data["landing"]
    finite = landings[np.isfinite(landings).all(1)] * MILLIMETRES
    panel.plot(*finite[:SHOWN].T, linestyle="", marker=".", markersize=3, color=COLOURS[0], alpha=0.35, rasterized=True)
    if len(finite) > 1:
        for part, style in ((1.0, "-"), (2.0, "--")):
            _ellipse(panel, finite, part, style)
    panel.plot(0.0, 0.0, linestyle="", marker="+", markersize=12, markeredgewidth=2.0, color="black", label="target")
    panel.set(xlabel="Δx (mm)", ylabel="Δy (mm)")
    panel.set_aspect("equal", adjustable="datalim")
    panel.grid(alpha=0.3)
    panel.legend(loc="upper right")
    sizes = np.linalg.norm(finite, axis=1)
    missed = len(landings) - len(finite)
    words = f"{len(landings)} throws, distance from the target {sizes.mean():.2f} ± {sizes.std():.2f} mm"
    panel.set_title(words + (f"; {missed} never at its height" if missed else ""), fontsize="medium")
    figure.suptitle(f"{robot_name(result)}: where throws land")
    return figure


def _ellipse(panel: Axes, points: np.ndarray, part: float, style: str) -> None:
    # Draw the ellipse whose axes are this many standard deviations of the sample.
    squares, axes = np.linalg.eigh(np.cov(points.T))
    width, height = 2.0 * part * np.sqrt(np.maximum(squares[::-1], 0.0))
    angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
    centre = tuple(points.mean(0))
    label = f"{part:g} standard deviation{'s' if part > 1.0 else ''}"
    shape = Ellipse(centre, width, height, angle=angle, fill=False, linewidth=1.6, linestyle=style, color=COLOURS[1])
    shape.set_label(label)
    panel.add_patch(shape)
