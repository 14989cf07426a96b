"""A calibration as JSON, as text for people, and as a robot file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cspr_jax import __version__
from cspr_jax.config.formats.writing import robot_text, value_text
from cspr_jax.machine.calibration.calibrated import PROBABILITY, Calibrated
from cspr_jax.machine.calibration.directions import correlations
from cspr_jax.machine.calibration.elimination import UNSEEN
from cspr_jax.machine.calibration.measurements import joined_names
from cspr_jax.machine.calibration.next_poses import NextPoses
from cspr_jax.machine.calibration.parameters import Parameter
from cspr_jax.numerics.shapes import Float
from cspr_jax.outputs.plan_report import finite
from cspr_jax.robots.cables import AnyRobot
from cspr_jax.robots.model.patterns import PATTERNS
from cspr_jax.robots.model.platform import PlatformRobot
from cspr_jax.runtime.terminal import cell
from cspr_jax.workspaces.poses.geometry import mass_centres

SCHEMA = 1
# Pairs of correlated parameters, and mistakes, that texts show; JSON has all mistakes.
MAX_PAIRS, MAX_MISTAKES = 5, 12
# Digits behind the point of lengths in robot files, m.
DIGITS = 12


def file_points(robot: PlatformRobot) -> Float[np.ndarray, "n 3"]:
    """Attachment points as robot files have them, m."""
    points, centre = np.asarray(robot.platform_points), robot.centre_of_mass
    return points if centre is None or PATTERNS[robot.pattern].is_jointed else points + np.asarray(centre)


def parameter_rows(result: Calibrated, nominal: AnyRobot) -> list[dict[str, Any]]:
    """All parameters of the robot: nominal and calibrated values, standard deviations."""
    deviations, units = np.sqrt(np.maximum(np.diagonal(result.covariance), 0.0)), result.parameters.units
    is_unseen = result.estimate.measured.unseen_parts > UNSEEN
    rows = []
    for i, row in enumerate(result.parameters.rows):
        if row.group == "tracker":
            continue
        before, change = _nominal(result, nominal, row), float(result.estimate.total[i] * units[i])
        fields: dict[str, Any] = {
            "name": row.name,
            "group": row.group,
            "cable": row.cable,
            "axis": row.axis or None,
            "unit": row.unit,
        }
        fields |= {"nominal": before, "value": before + change, "change": change}
        fields |= {"standard_deviation": float(deviations[i]) * row.per_metre, "seen": not bool(is_unseen[i])}
        rows.append(fields)
    return rows


def _nominal(result: Calibrated, robot: AnyRobot, row: Parameter) -> float:
    cable, winches = row.cable or 0, robot.winches
    if row.group == "spools":
        return float(robot.base_points[cable]["xyz".index(row.axis)])
    if row.group == "attachments" and isinstance(robot, PlatformRobot):
        if row.axis == "along":
            return float(np.linalg.norm(robot.platform_points[cable]))
        return float(file_points(robot)[cable]["xyz".index(row.axis)])
    numbers: dict[str, Any] = {
        "drums": winches and winches.drum_radius,
        "pulleys": robot.pulleys and robot.pulleys.radius,
    }
    if result.predictor.measurements.are_angles:
        numbers["offsets"] = winches and winches.zero_length
    values = numbers.get(row.group)
    return 0.0 if values is None else float(values[cable])


def mistake_rows(result: Calibrated, lines: Sequence[int]) -> list[dict[str, Any]]:
    """Measurements that were left out, the worst ones first."""
    estimate, names = (
        result.estimate,
        joined_names(result.nominal.robot.n_cables, result.predictor.measurements.are_angles),
    )
    sigmas = np.abs(estimate.standardised) / result.noise
    rows = [
        {
            "row": int(lines[k]),
            "column": names[i],
            "cable": int(i) if i < result.nominal.robot.n_cables else None,
            "sigmas": float(sigmas[k, i]),
        }
        for k, i in np.argwhere(estimate.is_mistaken)
    ]
    return sorted(rows, key=lambda row: -row["sigmas"])


def spool_uncertainty(result: Calibrated) -> float:
    """Largest of the radii that hold all spools together with `PROBABILITY`, m; inf where they are not seen."""
    return float(result.spool_radii().max())


def poses_in_file(result: Calibrated, positions: np.ndarray, quaternions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins of the platform axes, and orientations, in the axes of the file."""
    robot = result.nominal.robot
    offset = mass_centres(robot, np.zeros_like(positions), quaternions)
    return result.frame.outward(positions - offset), result.frame.rotated_quaternions(quaternions)


def next_rows(result: Calibrated, planned: NextPoses | None) -> list[dict[str, Any]]:
    """Poses to measure next."""
    if planned is None:
        return []
    positions, quaternions = poses_in_file(result, *planned.poses)
    is_body = PATTERNS[result.nominal.robot.pattern].is_body
    name = "angles" if result.predictor.measurements.are_angles else "lengths"
    return [
        {"position": p.tolist(), "quaternion": q.tolist() if is_body else None, name: r.tolist()}
        for p, q, r in zip(positions, quaternions, planned.readings, strict=True)
    ]


def largest_deviation(result: Calibrated, covariance: np.ndarray) -> float:
    """Largest standard deviation of a spool in any direction, m."""
    return float(np.sqrt(np.linalg.eigvalsh(result.spool_covariances(covariance)).max(initial=0.0)))


def calibration_object(
    result: Calibrated, nominal: AnyRobot, name: str, lines: Sequence[int], planned: NextPoses | None
) -> dict[str, Any]:
    """The object that `cspr calibrate --json` prints."""
    estimate, data = result.estimate, result.predictor.measurements
    deviation, direction = result.weakest()
    parts = ("length", "position", "rotation")
    sigma = {part: getattr(data.deviations, part) * result.noise for part in parts}
    pairs = correlations(result.parameters, result.covariance, MAX_PAIRS)
    radii = result.spool_radii()
    fields = {
        "schema": SCHEMA,
        "robot": name,
        "poses": data.count,
        "measurements": int(np.count_nonzero(estimate.is_used)),
        "degrees_of_freedom": estimate.degrees,
        "converged": estimate.is_converged,
        "sigma": sigma | {"given": data.deviations.are_given},
        "noise": estimate.noise,
        "parameters": parameter_rows(result, nominal),
        "covariance": result.reported_covariance().tolist(),
        "correlations": [{"first": first, "second": second, "value": value} for first, second, value in pairs],
        "not_identifiable": [direction.to_dict(result.parameters) for direction in result.directions],
        "weakest": {"standard_deviation": deviation, "text": direction},
        "mistakes": mistake_rows(result, lines),
        "prior": data.prior,
        "offsets": np.asarray(estimate.setup.offsets).tolist(),
        "tracker": _tracker(result),
        "uncertainty": {"spool_positions": float(radii.max()), "probability": PROBABILITY},
        "spool_radii": radii.tolist(),
        "next": next_rows(result, planned),
    }
    if planned is not None:
        fields["next_deviation"] = largest_deviation(result, planned.covariance * result.noise**2)
    return finite(fields)


def _tracker(result: Calibrated) -> dict[str, Any] | None:
    # Rotation and shift from the axes of the file to those of the tracker.
    if all(row.group != "tracker" for row in result.parameters.rows):
        return None
    setup, frame = result.estimate.setup, result.frame
    quaternion = frame.rotated_quaternions(np.asarray(setup.orientation))
    centre = Rotation.from_quat(quaternion, scalar_first=True).apply(np.asarray(frame.origin))
    shift = frame.rotated(np.asarray(setup.shift)) - centre
    return {"quaternion": quaternion.tolist(), "shift": shift.tolist()}


def calibration_lines(result: Calibrated, name: str, lines: Sequence[int], planned: NextPoses | None) -> list[str]:
    """A calibration as text: noise, what cannot be seen, mistakes, uncertainty."""
    estimate, data = result.estimate, result.predictor.measurements
    count = int(np.count_nonzero(estimate.is_used))
    text = [f"{name}: {data.count} poses, {count} measurements, {estimate.degrees} more than they determine"]
    if not estimate.is_converged:
        text.append("not converged: the measurements hardly determine the robot, or do not fit it")
    text.append(_noise_text(result))
    text += [f"not identifiable: {direction.text}" for direction in result.directions]
    deviation, direction = result.weakest()
    if direction and math.isfinite(deviation):
        text.append(f"known worst, with a standard deviation of {_mm(deviation)}: {direction}")
    pairs = [pair for pair in correlations(result.parameters, result.covariance, MAX_PAIRS) if abs(pair[2]) > 0.9]
    text += [f"correlated {value:+.4f}: {first} and {second}" for first, second, value in pairs]
    mistakes, noun = mistake_rows(result, lines), "line" if lines[0] else "row"  # of a file, of an array
    for row in mistakes[:MAX_MISTAKES]:
        text.append(f"left out: {noun} {row['row']}, {row['column']}, off by {row['sigmas']:.3g} standard deviations")
    if len(mistakes) > MAX_MISTAKES:
        text.append(f"and {len(mistakes) - MAX_MISTAKES} more left out")
    text.append(uncertainty_text(result))
    return text + _next_lines(result, planned)


def _noise_text(result: Calibrated) -> str:
    estimate, data = result.estimate, result.predictor.measurements
    if not math.isfinite(estimate.noise):
        return "noise: nothing is left over to estimate it from"
    if data.deviations.are_given:
        return f"residuals are {estimate.noise:.3g} times as large as the given standard deviations say"
    parts = [("lengths", data.deviations.length, estimate.is_used[:, : result.nominal.robot.n_cables].any())]
    columns = estimate.is_used[:, result.nominal.robot.n_cables :]
    parts.append(("positions", data.deviations.position, columns[:, :3].any()))
    words = [f"{_mm(value * estimate.noise)} of {name}" for name, value, is_there in parts if is_there]
    words += [f"{data.deviations.rotation * estimate.noise:.3g} rad of turns"] if columns[:, 3:].any() else []
    return f"noise, estimated: {', '.join(words)}"


def uncertainty_text(result: Calibrated) -> str:
    """The uncertainty of plans, in words."""
    radius = spool_uncertainty(result)
    if not math.isfinite(radius):
        return "no uncertainty for plans: what is not identifiable moves spools against each other"
    return (
        f"with {PROBABILITY:.0%} all spools are within {_mm(radius)}: [limits] uncertainty = "
        f"{{ spool_positions = {rounded_up(radius)} }}"
    )


def rounded_up(radius: float) -> str:
    """A radius with three digits, not below it."""
    step = 10.0 ** (math.floor(math.log10(radius)) - 2) if radius > 0.0 else 1.0
    return f"{math.ceil(radius / step) * step:.3g}"


def _next_lines(result: Calibrated, planned: NextPoses | None) -> list[str]:
    text = []
    if planned is not None:
        before = largest_deviation(result, result.covariance)
        after = largest_deviation(result, planned.covariance * result.noise**2)
        text.append(f"next poses; the largest standard deviation of a spool falls from {_mm(before)} to {_mm(after)}:")
    for row in next_rows(result, planned):
        readings = row.get("lengths") or row["angles"]
        turn = "" if row["quaternion"] is None else f", quaternion {_numbers(row['quaternion'])}"
        text.append(f"  position {_numbers(row['position'])}{turn}: {_numbers(readings)}")
    return text


def _numbers(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{value:.4f}" for value in values) + "]"


def _mm(value: float) -> str:
    return f"{1000.0 * value:.3g} mm"


def calibration_table(result: Calibrated, nominal: AnyRobot):
    """Parameters of a robot as a table for a terminal."""
    from rich.table import Table  # only a terminal needs it

    table = Table()
    for head in ("", "nominal (m)", "calibrated (m)", "change (mm)", "s.d. (mm)"):
        table.add_column(cell(head), justify="right" if head else "left")
    for row in parameter_rows(result, nominal):
        deviation = row["standard_deviation"]
        numbers = [f"{row['nominal']:.6f}", f"{row['value']:.6f}", f"{1000.0 * row['change']:+.4f}"]
        numbers.append(f"{1000.0 * deviation:.4f}" if math.isfinite(deviation) else "-")
        table.add_row(*(cell(text) for text in (row["name"], *numbers)))
    return table


def calibrated_spec(result: Calibrated, robot: AnyRobot, spec: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of the calibrated robot's file: those of the nominal one with other numbers."""
    groups, changed = {row.group for row in result.parameters.rows}, dict(spec)
    if "spools" in groups:
        changed["base_points"] = _rounded(robot.base_points)
    if "attachments" in groups and isinstance(robot, PlatformRobot):
        changed["platform_points"] = _rounded(file_points(robot))
    if "pulleys" in groups and robot.pulleys is not None:
        changed["pulley_radius"] = _rounded(robot.pulleys.radius)
    if robot.winches is not None and "winch" in changed:
        winch = dict(changed["winch"])
        if "drums" in groups:
            winch["drum_radius"] = _rounded(robot.winches.drum_radius)
        if "offsets" in groups and result.predictor.measurements.are_angles:
            winch["zero_length"] = _rounded(robot.winches.zero_length)
        changed["winch"] = winch
    return changed


def _rounded(values: Any) -> list[Any]:
    return (np.round(np.asarray(values), DIGITS) + 0.0).tolist()


def calibrated_text(result: Calibrated, spec: Mapping[str, Any], source: str) -> str:
    """Text of the calibrated robot's file, with what it rests on in comments."""
    estimate, groups = result.estimate, dict.fromkeys(row.group for row in result.parameters.rows)
    head = [
        f"calibrated by cspr_jax {__version__} from {source}",
        f"{', '.join(groups)} of {estimate.is_used.shape[0]} poses",
    ]
    head += [_noise_text(result), uncertainty_text(result)]
    head += [f"not identifiable: {direction.text}" for direction in result.directions]
    if "offsets" in groups and not result.predictor.measurements.are_angles:
        head.append(f"add to measured lengths, m: {value_text(_rounded(estimate.setup.offsets))}")
    return "".join(f"# {line}\n" for line in head) + robot_text(spec)
