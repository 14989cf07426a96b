"""Draw docs/images/launch_scatter.png: how far throws land from the target, over the jitter of their release."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import cspr_jax

JITTERS = np.linspace(0.0, 0.03, 13)  # s
LENGTHS = (0.0, 0.002, 0.005, 0.01)  # m
# Of 30 throws with the prototype: Machines 11 (2), 2023, 224, section 5.3.
PUBLISHED = {"mean": 0.011, "standard deviation": 0.006}
COLOURS, STYLES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7"), ("-", "--", "-.", ":")


def main() -> None:
    """Draw both figures of the distance, for several errors of the cable lengths."""
    plan = cspr_jax.plan("sweeps/launch.toml")
    figure, panels = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained", sharex=True, sharey=True)
    for length, colour, style in zip(LENGTHS, COLOURS, STYLES, strict=True):
        errors = [cspr_jax.LaunchErrors(release=own, cable_length=length, throws=4000) for own in JITTERS]
        found = [plan.scatter(own).to_dict() for own in errors]
        for panel, name in zip(panels, ("mean_error", "standard_deviation"), strict=True):
            values = [1e3 * one[name] for one in found]
            label = f"cable lengths ± {1e3 * length:g} mm"
            panel.plot(1e3 * JITTERS, values, color=colour, linestyle=style, linewidth=1.6, label=label)
    for panel, (name, value) in zip(panels, PUBLISHED.items(), strict=True):
        panel.axhline(1e3 * value, color="black", linewidth=1.0)
        panel.annotate(f"30 throws: {1e3 * value:g} mm", (1.0, 1e3 * value + 0.3), fontsize=9)
        panel.set_title(f"{name} of the distance from the target", fontsize=10)
        panel.set_xlabel("jitter of the release, standard deviation (ms)")
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("distance (mm)")
    panels[1].legend(fontsize=9)
    figure.savefig("docs/images/launch_scatter.png", dpi=90)


if __name__ == "__main__":
    main()
