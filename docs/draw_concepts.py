"""Draw docs/images/concepts.png: a swing from one pose to the next, and the pseudotensions along it."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

GRAVITY, Z0, ARCS = 9.81, 1.7, 5
ANGLES = np.radians([-30.0, 210.0, 90.0])
SPOOLS = 0.4 * np.stack([np.cos(ANGLES), np.sin(ANGLES), 0.0 * ANGLES], axis=1)
P0 = np.array([0.0, 0.0, Z0])
# All three in the plane y = 0, so that a view from the side shows the curve itself.
START, TARGET = np.array([0.75, 0.0, 1.25]), np.array([-1.05, 0.0, 1.5])
INK, CURVE, MARK = "#222222", "#1f6fb4", "#c03a2b"


def swing(tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3), m, and accelerations (n, 3), m/s^2: docs/theory/swings.md with the quintic amplitude."""
    first, second = START - P0, TARGET - P0
    r1, r2 = np.linalg.norm(first), np.linalg.norm(second)
    q1 = first / r1
    across = second - (second @ q1) * q1
    q2, psi = across / np.linalg.norm(across), np.arctan2(np.linalg.norm(across), second @ q1)
    delta, sense = (np.pi - psi, 1.0) if ARCS % 2 else (psi, -1.0)
    nu, phase, turn = delta / (np.pi * ARCS), sense * np.pi * ARCS * tau, sense * delta * tau
    r = r1 + (r2 - r1) * tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    r_rate = (r2 - r1) * 30.0 * tau**2 * (1.0 - tau) ** 2
    r_second = (r2 - r1) * 60.0 * tau * (1.0 - tau) * (1.0 - 2.0 * tau)
    rho = r_second / ((np.pi * ARCS) ** 2 * (1.0 - nu**2))
    radial = np.cos(turn)[:, None] * q1 - np.sin(turn)[:, None] * q2
    tangential = np.sin(turn)[:, None] * q1 + np.cos(turn)[:, None] * q2
    cos, sin = np.cos(phase), np.sin(phase)
    position = (r * cos)[:, None] * radial + (r * nu * sin)[:, None] * tangential
    relative_acceleration = (rho * cos - 2.0 * sense * r_rate * sin / (np.pi * ARCS))[:, None] * radial
    relative_acceleration += (nu * (rho + 2.0 * r) * sin)[:, None] * tangential
    return P0 + position, GRAVITY / Z0 * (relative_acceleration - position)


def pseudotensions(positions: np.ndarray, accelerations: np.ndarray) -> np.ndarray:
    """(n, 3) over their value at rest in P0: tension over mass and length, times the depth below the spools."""
    cables = np.swapaxes(SPOOLS - positions[:, None], 1, 2)
    loads = accelerations - np.array([0.0, 0.0, GRAVITY])
    return 3.0 / GRAVITY * positions[:, 2:] * np.linalg.solve(cables, loads[..., None])[..., 0]


def draw_side(axes: plt.Axes, tau: np.ndarray) -> None:
    """The robot from the side, z down."""
    positions, _ = swing(tau)
    cusps, _ = swing(np.arange(ARCS + 1) / ARCS)
    half_width = np.abs(SPOOLS[:, 0]).max()
    axes.axvspan(-half_width, half_width, color="#eeeeee", zorder=0)
    axes.text(0.0, 2.26, "static workspace", ha="center", va="center", fontsize=8, color="#777777")
    for spool in SPOOLS:
        axes.plot(*zip(spool[[0, 2]], START[[0, 2]], strict=True), color="#aaaaaa", lw=0.8)
    axes.plot(SPOOLS[:, 0], SPOOLS[:, 2], "s", color=INK, ms=7)
    axes.plot(positions[:, 0], positions[:, 2], color=CURVE, lw=1.2)
    last = tau >= (ARCS - 1) / ARCS
    axes.plot(positions[last, 0], positions[last, 2], color=CURVE, lw=3.0)
    axes.plot(cusps[1:-1, 0], cusps[1:-1, 2], "o", mfc="white", mec=CURVE, ms=6)
    axes.plot(*P0[[0, 2]], "o", color=MARK, ms=7, zorder=5)
    double = {"arrowstyle": "<->", "color": MARK, "shrinkA": 0, "shrinkB": 3}
    axes.annotate("", P0[[0, 2]], (0.0, 0.0), arrowprops=double)
    axes.plot(*START[[0, 2]], "o", color=INK, ms=7)
    axes.plot(*TARGET[[0, 2]], "*", color=INK, ms=13)
    middle = positions[np.searchsorted(tau, (ARCS - 0.35) / ARCS)]
    notes = (
        ("spools", (half_width, 0.0), (0.62, -0.12), INK),
        ("centroid c0", (0.0, 0.0), (-0.75, -0.12), INK),
        ("z0", (0.0, 0.62), (0.06, 0.68), MARK),
        ("P0", P0[[0, 2]], (0.1, 1.98), MARK),
        ("start", START[[0, 2]], (0.85, 1.12), INK),
        ("target", TARGET[[0, 2]], (-1.2, 1.28), INK),
        ("cusp", cusps[1, [0, 2]], (cusps[1, 0] - 0.3, cusps[1, 2] + 0.3), CURVE),
        ("one arc", middle[[0, 2]], (-0.95, 1.95), CURVE),
    )
    for text, point, at, colour in notes:
        arrow = {"arrowstyle": "-", "color": colour, "lw": 0.7} if text not in ("z0", "start", "target") else None
        axes.annotate(text, point, at, color=colour, arrowprops=arrow, fontsize=10)
    axes.set(xlim=(-1.4, 1.2), ylim=(2.4, -0.3), aspect="equal", xlabel="x (m)", ylabel="z (m), down")
    axes.set_title(f"From start to target in {ARCS} arcs", fontsize=10)


def draw_margin(axes: plt.Axes, tau: np.ndarray) -> None:
    """Pseudotensions against normalised time."""
    values = pseudotensions(*swing(tau))
    for k, style in enumerate(("-", "--", ":")):
        axes.plot(tau, values[:, k], style, color=INK, lw=1.1, label=f"cable {k + 1}")
    least = values.min()
    at = tau[values.min(1).argmin()]
    axes.axhline(0.0, color=MARK, lw=0.8)
    axes.axhline(least, color=CURVE, lw=0.8, ls="--")
    double = {"arrowstyle": "<->", "color": CURVE, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (at, least), (at, 0.0), arrowprops=double)
    axes.text(at + 0.02, 0.5 * least, f"margin {least:.2f}", color=CURVE, va="center")
    axes.set(xlim=(0.0, 1.0), xlabel="normalised time", ylabel="pseudotension over that at rest in P0")
    axes.set_title("Above 0: every cable pulls", fontsize=10)
    axes.legend(frameon=False, fontsize=8)


def main() -> None:
    """Write the picture."""
    tau = np.linspace(0.0, 1.0, 2001)
    figure, (side, margin) = plt.subplots(1, 2, figsize=(10.0, 4.6), width_ratios=(1.15, 1.0), layout="constrained")
    draw_side(side, tau)
    draw_margin(margin, tau)
    path = Path(__file__).parent / "images" / "concepts.png"
    figure.savefig(path, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
