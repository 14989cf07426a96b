"""Draw docs/images/swing.gif, the film of the README: a plan of docs/examples/swing.toml, and its tensions."""

import io
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import cspr_jax

HERE = Path(__file__).parent
RATE, DPI = 14.0, 100  # pictures a second, of 8 x 4.5 inches
EYE, AIM = np.array([2.3, -9.0, 4.6]), np.array([1.55, 1.1, 1.85])
CABLES = ("#0072b2", "#d55e00", "#009e73")
INK, GREY, PALE, MARK = "#222222", "#8a8a8a", "#d5d9de", "#c03a2b"


def projected(points: np.ndarray) -> np.ndarray:
    """Positions (..., 3), m, as a camera at EYE that looks at AIM sees them: (..., 2)."""
    ahead = (AIM - EYE) / np.linalg.norm(AIM - EYE)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    offsets = np.asarray(points) - EYE
    return np.stack([offsets @ right, offsets @ np.cross(right, ahead)], -1) / (offsets @ ahead)[..., None]


def draw_hall(axes: plt.Axes, spools: np.ndarray, targets: np.ndarray) -> None:
    """Posts, floor, and the prism below the spools, in which the load could hang at rest."""
    feet = spools * [1.0, 1.0, 0.0]
    for x in np.arange(-2.0, 5.6):
        axes.plot(*projected(np.array([[x, -0.7, 0.0], [x, 3.3, 0.0]])).T, color="#ececec", lw=0.7, zorder=0)
    for y in np.arange(-0.7, 3.4):
        axes.plot(*projected(np.array([[-2.0, y, 0.0], [5.0, y, 0.0]])).T, color="#ececec", lw=0.7, zorder=0)
    axes.fill(*projected(feet).T, color="#dbe7f3", zorder=1)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        wall = np.array([feet[i], feet[j], spools[j], spools[i]])
        axes.fill(*projected(wall).T, color="#5b8fc7", alpha=0.07, lw=0.0, zorder=1)
        axes.plot(*projected(spools[[i, j]]).T, color="#9db8d6", lw=0.8, ls="--", zorder=2)
    for foot, spool in zip(feet, spools, strict=True):
        axes.plot(*projected(np.array([foot, spool])).T, color=GREY, lw=3.0, solid_capstyle="butt", zorder=2)
    axes.plot(*projected(spools).T, "s", color=INK, ms=6, zorder=6)
    axes.plot(*projected(targets).T, "*", color=MARK, ms=12, zorder=6)
    for target in targets:
        axes.plot(*projected(np.array([target * [1, 1, 0], target])).T, color=MARK, lw=0.6, ls=":", zorder=2)


def picture(figure: plt.Figure) -> Image.Image:
    """The figure as it is now."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return Image.open(buffer).convert("RGB")


def main() -> None:
    """Compute the plan, draw each picture, and write the film."""
    plan = cspr_jax.plan(HERE / "examples" / "swing.toml")
    rows, fine = plan.rows(rate=RATE), plan.rows(rate=120.0)
    spools = np.asarray(cspr_jax.load_robot(HERE / "examples" / "hall.toml").base_points)
    ends = np.cumsum(plan.answers.duration)

    figure, (scene, chart) = plt.subplots(1, 2, figsize=(8.0, 4.5), width_ratios=(1.75, 1.0))
    figure.subplots_adjust(left=0.0, right=0.97, bottom=0.12, top=0.985, wspace=0.13)
    draw_hall(scene, spools, plan.points[1:3])
    scene.set_aspect("equal")
    scene.set_axis_off()
    scene.set(xlim=(-0.405, 0.395), ylim=(-0.30, 0.31))
    words = {
        "at rest: only below the triangle of the spools": "#3f6fa3",
        "swinging, every cable taut: up to 2.1 m beyond it": MARK,
    }
    for i, (text, color) in enumerate(words.items()):
        scene.text(
            0.5, 0.985 - 0.06 * i, text, transform=scene.transAxes, fontsize=10, color=color, ha="center", va="top"
        )
    for k, color in enumerate(CABLES):
        chart.plot(fine["t"], fine["tension"][:, k], color=color, lw=1.1, label=f"cable {k + 1}")
    chart.axhline(1.0, color=INK, lw=0.9, ls="--")
    chart.text(ends[-1], 0.75, "at least 1 N", ha="right", va="top", fontsize=8)
    chart.set(xlim=(0.0, ends[-1]), ylim=(0.0, None), xlabel="time (s)", ylabel="tension (N)")
    chart.legend(loc="upper center", ncols=3, frameon=False, fontsize=8, handlelength=1.2, columnspacing=1.0)
    chart.set_ylim(0.0, 1.14 * fine["tension"].max())
    chart.spines[["top", "right"]].set_visible(False)

    path = projected(fine["position"])
    scene.plot(*path.T, color=PALE, lw=1.0, zorder=2)
    (trail,) = scene.plot([], [], color=INK, lw=1.1, zorder=4)
    cables = [scene.plot([], [], color=color, lw=1.6, zorder=5)[0] for color in CABLES]
    (shadow,) = scene.plot([], [], "o", color="#b9bec4", ms=8, zorder=3)
    (load,) = scene.plot([], [], "o", color=INK, ms=10, zorder=7)
    (now,) = chart.plot([], [], color=GREY, lw=1.0)
    dots = [chart.plot([], [], "o", color=color, ms=4.5)[0] for color in CABLES]

    pictures = []
    for t, position, tension in zip(rows["t"], rows["position"], rows["tension"], strict=True):
        trail.set_data(*path[fine["t"] <= t].T)
        for cable, spool in zip(cables, spools, strict=True):
            cable.set_data(*projected(np.stack([spool, position])).T)
        shadow.set_data(*projected(position * [1.0, 1.0, 0.0])[:, None])
        load.set_data(*projected(position)[:, None])
        now.set_data([t, t], [0.0, 1.03 * fine["tension"].max()])
        for dot, value in zip(dots, tension, strict=True):
            dot.set_data([t], [value])
        pictures.append(picture(figure))
    # Colours of all pictures, so that the film does not flicker.
    palette = Image.new("RGB", (pictures[0].width, 3 * pictures[0].height))
    for i, k in enumerate((0, len(pictures) // 2, -1)):
        palette.paste(pictures[k], (0, i * pictures[0].height))
    colours = palette.quantize(64, dither=Image.Dither.NONE)
    values = np.array(colours.getpalette()).reshape(-1, 3)
    values[values.min(axis=1) > 247] = 255  # the ground is white
    colours.putpalette(values.ravel().tolist())
    frames = [one.quantize(palette=colours, dither=Image.Dither.NONE) for one in pictures]
    times = [round(1000.0 / RATE)] * (len(frames) - 1) + [1500]
    target = HERE / "images" / "swing.gif"
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=True)


if __name__ == "__main__":
    main()
