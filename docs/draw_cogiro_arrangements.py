"""Draw docs/images/cogiro_arrangements.png: how many poses CoGiRo holds in each arrangement of its cables."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import cspr_jax


def main() -> None:
    """Draw the fractions of poses in order, with that of the real robot, and print where it stands."""
    result = cspr_jax.compute_sweep("sweeps/cogiro_arrangements.toml")
    fractions = (result.verdict == 0).mean(("x", "y", "z")).values
    real, best = fractions[0], int(fractions.argmax())
    better, equal = int((fractions > real).sum()), int((fractions == real).sum()) - 1
    print(f"{fractions.size} arrangements: the real one holds {real:.3f} of the poses, {better} hold more, {equal} as many")
    print(f"arrangement {int(result.arrangement[best])} holds {fractions[best]:.3f}; {(fractions == 0).sum()} hold none")
    figure, panel = plt.subplots(figsize=(7.2, 3.8), layout="constrained")
    rank = np.arange(1, fractions.size + 1)
    panel.plot(rank, 100.0 * np.sort(fractions)[::-1], color="#0072b2", linewidth=1.6)
    panel.plot(better + 1, 100.0 * real, "o", color="#d55e00", markersize=7)
    panel.annotate(f"CoGiRo: {100.0 * real:.1f} %, rank {better + 1}", (1200, 100.0 * real + 2.0), fontsize=9)
    panel.set_xlabel("arrangements of the cables, by rank")
    panel.set_ylabel("poses that are held (%)")
    panel.set_ylim(0.0, 100.0)
    panel.grid(alpha=0.3)
    figure.savefig("docs/images/cogiro_arrangements.png", dpi=90)


if __name__ == "__main__":
    main()
