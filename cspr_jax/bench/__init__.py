"""Rates of checks, beside NumPy versions in the same run and, on request, beside kernels written by hand in C++."""

import os
import platform
from pathlib import Path
from typing import Any

import jax

from cspr_jax.bench import (
    ellipses,
    forward_kinematics,
    hand_written,
    motions,
    paths,
    six_cables,
    three_cables,
    timing,
    workspaces,
)
from cspr_jax.numerics.batches import device_batch_size

SCHEMA = 1


def bench(kernels: Path | None = None) -> dict[str, Any]:
    """Measure all rates."""
    by_hand = None if kernels is None else hand_written.compiled(kernels)
    six, three = six_cables.work(device_batch_size(six_cables.TRAJECTORIES)), three_cables.work()
    batches = six_cables.batches(six)
    single, exact = (six_cables.rate(six.robot, batches, single_precision=is_single) for is_single in (True, False))
    rates = {
        "six_cable": {"float32": single[0], "float64": exact[0], "numpy": six_cables.numpy_rate(six)},
        "three_cable": {dtype: three_cables.rate(three, dtype) for dtype in ("float32", "float64")}
        | {"numpy": three_cables.numpy_rate(three)},
    }
    written = None if by_hand is None else hand_written.rates(by_hand, six, three)
    return {
        "schema": SCHEMA,
        "checks_per_second": rates["six_cable"],
        "three_cable": rates["three_cable"],
        "taut_share": {"float32": single[1], "float64": exact[1]},
        "operations_per_check": six_cables.operations_a_check(six.robot, batches[0]),
        "peak_per_second": timing.peak(),
        "hand_written": written,
        "workspaces": workspaces.rates(),
        "ellipses": ellipses.rates(),
        "motions": motions.rates(),
        "paths": paths.rates(),
        "forward_kinematics": forward_kinematics.rates(),
        "ratio_to_numpy": _ratios(rates, {name: row["numpy"] for name, row in rates.items()}),
        "ratio_to_hand_written": None if written is None else _ratios(rates, written),
        "cores": timing.cores(),
        "device": f"{jax.devices()[0].platform} {jax.devices()[0].device_kind}",
        "machine": platform.machine(),
        "flags": os.environ.get("XLA_FLAGS", ""),
        "jax": jax.__version__,
        "repeats": timing.REPEATS,
    }


def _ratios(rates: dict[str, dict[str, float]], to: dict[str, float]) -> dict[str, dict[str, float]]:
    return {
        name: {dtype: rates[name][dtype] / reference for dtype in ("float32", "float64")}
        for name, reference in to.items()
    }


def lines(report: dict[str, Any]) -> list[str]:
    """Lines of a report that `cspr bench` prints for people."""
    text = [f"checks per second, best of {report['repeats']}, {report['cores']} cores, {report['device']}"]
    for name, key in (("six_cable", "checks_per_second"), ("three_cable", "three_cable")):
        text.append(name.replace("_", "-"))
        for dtype, rate in report[key].items():
            ratio = report["ratio_to_numpy"][name].get(dtype)
            words = "" if ratio is None else f"  {ratio:6.0f} x NumPy"
            if ratio is not None and report["hand_written"] is not None:
                words += f"  {report['ratio_to_hand_written'][name][dtype]:5.2f} x hand-written C++ in float32"
            text.append(f"  {dtype:8s} {rate / 1e6:8.2f} M/s{words}")
    text += workspaces.lines(report["workspaces"]) + ellipses.lines(report["ellipses"])
    text += motions.lines(report["motions"]) + paths.lines(report["paths"])
    text += forward_kinematics.lines(report["forward_kinematics"])
    if report["operations_per_check"] is None or not report["device"].startswith("cpu"):
        return text
    for dtype in ("float32", "float64"):
        used = report["checks_per_second"][dtype] * report["operations_per_check"] / report["peak_per_second"][dtype]
        peak = report["peak_per_second"][dtype] / 1e9
        text.append(
            f"six-cable {dtype}: {used:.0%} of what products of matrices reach, {peak:.0f} G operations a second"
        )
    return text
