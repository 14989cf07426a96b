"""What each kind of map asks of its sweep file, beyond the schema."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cspr_jax.config.sweep import SweepFile
from cspr_jax.config.trajectory import WITHOUT_BETA_HAT
from cspr_jax.errors import ConfigError, shown

_START = ("from_x", "from_y", "from_z")
_INSTANTS = ("tau", "cable")
_OF_ORIENTATIONS = ("orientations", "orientation-workspace", "attainability")
_POSES = ("tilt_azimuth", "tilt", "torsion")


def check_map(keys: SweepFile, path: Path) -> None:
    """Refuse a sweep whose keys do not fit its map.

    Args:
        keys: the sweep.
        path: named in errors.

    Raises:
        ConfigError: which key, and what it must be.
    """
    given = tuple(name for name in ("x", "y", "radius", "azimuth") if getattr(keys.axes, name) is not None)
    if given not in (("x", "y"), ("radius", "azimuth")):
        raise ConfigError(path, f"axes: {', '.join(given) or 'no targets'}: must be x and y, or radius and azimuth")
    if keys.map != "poses":
        _refuse_poses(keys, path)
    if keys.orientations is not None and keys.map not in _OF_ORIENTATIONS:
        raise ConfigError(path, "orientations: must be absent in this map")
    _CHECKS[keys.map](keys, path)


def check_points(axes: dict[str, np.ndarray], path: Path) -> None:
    """Refuse coordinates out of their range.

    Args:
        axes: coordinates by name.
        path: named in errors.

    Raises:
        ConfigError: which axis, and what it must be.
    """
    for name, inside, allowed in (
        ("z0", lambda p: p > 0.0, "a number > 0"),
        ("radius", lambda p: p >= 0.0, "a number >= 0"),
        ("inclination", lambda p: np.abs(p) < 1.0, "a number in ]-1, 1["),
        ("tau", lambda p: (p >= 0.0) & (p <= 1.0), "a number in [0, 1]"),
        ("cable", lambda p: (p >= 1.0) & (p == np.round(p)), "a whole number from 1 on"),
    ):
        points = axes.get(name, np.empty(0))
        wrong = points[~inside(points)]
        if len(wrong):
            raise ConfigError(path, f"axes.{name} = {shown(float(wrong[0]))}: must be {allowed}")


def _check_transitions(keys: SweepFile, path: Path) -> None:
    axes, trajectory = keys.axes, keys.trajectory
    if trajectory.family != "transition":
        raise ConfigError(path, f'trajectory.family = "{trajectory.family}": must be "transition" in this map')
    if trajectory.start is not None and not trajectory.start.rest:
        raise ConfigError(path, "trajectory.from: must be { rest = true }, or absent, in this map")
    for name in _START:
        if getattr(axes, name) is not None:
            raise ConfigError(path, f"axes.{name}: must be absent in this map: transitions start at rest")
    given = [axes.z0, axes.inclination, trajectory.inclination]
    if sum(key is not None for key in given) != 1:
        raise ConfigError(path, "axes.z0, axes.inclination, trajectory.inclination: must be one of them in this map")


def _check_oscillations(keys: SweepFile, path: Path) -> None:
    _check_transitions(keys, path)
    _refuse_instants(keys, path)


def _check_envelopes(keys: SweepFile, path: Path) -> None:
    _check_transitions(keys, path)
    if keys.axes.tau is None:
        raise ConfigError(path, "axes.tau is missing: instants, as normalised time in [0, 1]")


def _refuse_instants(keys: SweepFile, path: Path) -> None:
    for name in _INSTANTS:
        if getattr(keys.axes, name) is not None:
            raise ConfigError(path, f'axes.{name}: must be absent in this map; it is for map = "transition-envelopes"')


def _check_arcs(keys: SweepFile, path: Path) -> None:
    if keys.trajectory.family != "hypocycloid-standard":
        raise ConfigError(path, 'trajectory.family: must be "hypocycloid-standard" in this map')
    if keys.axes.z0 is None:
        raise ConfigError(path, "axes.z0 is missing: depth of P0 below the centroid of the spools, m")
    if keys.axes.inclination is not None or keys.trajectory.inclination is not None:
        raise ConfigError(path, 'inclination: must be absent in this map; it is for map = "minimum-oscillations"')
    _refuse_instants(keys, path)
    given = [name for name in _START if getattr(keys.axes, name) is not None]
    start = keys.trajectory.start
    if start is None and len(given) < 3:
        raise ConfigError(
            path,
            "trajectory.from is missing: { position = [x, y, z] }, { rest = true }, or axes from_x, from_y, from_z",
        )
    if start is not None and start.rest and given:
        raise ConfigError(path, f"axes.{given[0]}: must be absent where trajectory.from.rest = true")


def _refuse_poses(keys: SweepFile, path: Path) -> None:
    for name in _POSES:
        if getattr(keys.axes, name) is not None:
            raise ConfigError(path, f'axes.{name}: must be absent in this map; it is for map = "poses"')
    for name in ("beta_hat", "beat"):
        if getattr(keys.trajectory, name) is not None:
            raise ConfigError(path, f'trajectory.{name}: must be absent in this map; it is for map = "poses"')
    if keys.trajectory.start is not None and keys.trajectory.start.is_pose:
        raise ConfigError(path, 'trajectory.from: must be without orientation and beta_hat but for map = "poses"')


def _check_poses(keys: SweepFile, path: Path) -> None:
    if keys.trajectory.family == "transition":
        raise ConfigError(
            path, 'trajectory.family = "transition": must be "hypocycloid" or "hypocycloid-standard" in this map'
        )
    for name in (*_START, *_INSTANTS, "inclination"):
        if getattr(keys.axes, name) is not None:
            raise ConfigError(path, f"axes.{name}: must be absent in this map")
    if keys.trajectory.inclination is not None:
        raise ConfigError(path, "trajectory.inclination: must be absent in this map")
    if keys.axes.z0 is None:
        raise ConfigError(path, "axes.z0 is missing: depth of P0 below the centroid of the spools, m")
    if keys.trajectory.beat in WITHOUT_BETA_HAT and keys.trajectory.beta_hat is not None:
        raise ConfigError(path, f'trajectory.beta_hat: must be absent with beat = "{keys.trajectory.beat}"')


def _check_orientations(keys: SweepFile, path: Path) -> None:
    if keys.trajectory.family == "transition":
        raise ConfigError(
            path, 'trajectory.family = "transition": must be "hypocycloid" or "hypocycloid-standard" in this map'
        )
    for name in (*_START, *_INSTANTS, "inclination", *(["z0"] if keys.map == "orientation-workspace" else [])):
        if getattr(keys.axes, name) is not None:
            raise ConfigError(path, f"axes.{name}: must be absent in this map")
    if keys.trajectory.inclination is not None:
        raise ConfigError(path, "trajectory.inclination: must be absent in this map")
    if keys.trajectory.start is not None and not keys.trajectory.start.rest:
        raise ConfigError(path, "trajectory.from: must be { rest = true }, or absent, in this map")
    given = keys.orientations
    if keys.map == "orientations" and given is not None and given.definition not in (None, "grid"):
        raise ConfigError(path, f'orientations.definition = "{given.definition}": must be "grid" in this map')
    if keys.map == "orientation-workspace":
        if keys.limits.model_fields_set:
            raise ConfigError(path, 'limits: must be absent in this map; they are for map = "attainability"')
        if given is not None and given.values is not None:
            raise ConfigError(path, 'orientations.values: must be absent in this map; it is for map = "attainability"')


_CHECKS: dict[str, Callable[[SweepFile, Path], None]] = {
    "minimum-arcs": _check_arcs,
    "minimum-oscillations": _check_oscillations,
    "transition-envelopes": _check_envelopes,
    "poses": _check_poses,
    "orientations": _check_orientations,
    "orientation-workspace": _check_orientations,
    "attainability": _check_orientations,
}
