"""Motions of users from all kinds of files: text, CASPR's XML, or the HDF5 of `cspr plan -o`."""

from collections.abc import Iterator
from pathlib import Path

from cspr_jax.config.formats.xml_text import LONGEST_FAULT
from cspr_jax.config.motions import caspr, text
from cspr_jax.config.motions.table import MotionPieces, MotionTable
from cspr_jax.errors import ConfigError, StoreError, printable
from cspr_jax.store.reading.result import open_result

HDF5 = (".h5", ".hdf5", ".nc")
XML = ".xml"


def read_motion(path: Path, trajectory: str | None = None) -> MotionTable | MotionPieces:
    """Read a motion in full."""
    path, ending = Path(path), Path(path).suffix.lower()
    if ending == XML:
        return caspr.read(path, trajectory)
    if trajectory is not None:
        raise ConfigError(
            path, f"trajectory = {trajectory!r}: must be absent: only files of CASPR have several"[:LONGEST_FAULT]
        )
    return _samples(path) if ending in HDF5 else text.read(path)


def motion_windows(path: Path, n_rows: int = text.WINDOW) -> Iterator[text.MotionWindow]:
    """Read a table of samples of any length, window by window; see `config.motions.text.windows`."""
    path, ending = Path(path), Path(path).suffix.lower()
    if ending == XML:
        raise ConfigError(path, "must be a table of samples here")
    if ending not in HDF5:
        yield from text.windows(path, n_rows)
        return
    table = _samples(path)
    yield text.MotionWindow(table, 0, len(table.times) - 1, is_last=True)


def _samples(path: Path) -> MotionTable:
    try:
        result = open_result(path)
    except StoreError as error:  # the file is the user's input, like a table of text
        raise ConfigError(path, str(error).removeprefix(f"{printable(path)}: ")) from error
    if "position" not in result.data or len(result.axes.get("t", ())) < 2:
        raise ConfigError(path, "is a map, or a plan without a motion: must be a motion of `cspr plan -o`")
    data, point = result.data, "origin" if "mass_centre" in result.data else "mass-centre"
    return MotionTable(
        result.axes["t"],
        data["position"],
        data.get("quaternion"),
        data.get("velocity"),
        data.get("acceleration"),
        data.get("omega"),
        data.get("omega_dot"),
        interpolation="hermite" if "velocity" in data else None,
        z_axis=result.attributes.get("z_axis"),
        point=point,
        from_reference=point == "mass-centre",
    )
