"""Sweep and plan files that come with the program, to be listed, copied and changed."""

import difflib
from pathlib import Path

from cspr_jax.errors import ConfigError, RefusedError, StoreError, printable, shown
from cspr_jax.store.files.disk import Disk
from cspr_jax.store.files.publishing import make_folders

_PACKAGE = Path(__file__).resolve().parents[1]


def folder() -> Path:
    """Folder of the examples: in the package if it was installed from a wheel, else in the checkout beside it."""
    for path in (_PACKAGE / "examples", _PACKAGE.parent / "sweeps"):
        if path.is_dir():
            return path
    raise StoreError(f"{_PACKAGE / 'examples'}: is missing: install cspr_jax again")


def examples() -> dict[str, str]:
    """Names and purposes of the examples."""
    purposes = {}
    for path in sorted(folder().glob("*.toml")):
        first = path.read_text("utf-8").partition("\n")[0]
        purposes[path.stem] = first.removeprefix("#").strip()
    return purposes


def copy(names: list[str], target: Path) -> list[Path]:
    """Copy some of the examples into a folder; existing files are not overwritten."""
    purposes, source = examples(), folder()
    for name in names:
        if name not in purposes:
            near = difflib.get_close_matches(name, purposes, n=1)
            hint = f"did you mean {near[0]}? " if near else ""
            raise ConfigError("examples", f"{shown(name)}: {hint}must be one of those that `cspr examples` lists")
    # The plan of a path may come with a file of the path's points, which has the same name.
    originals = [
        path for name in names for path in sorted(source.glob(f"{name}.*"), key=lambda path: path.suffix != ".toml")
    ]
    copies = {path: target / path.name for path in originals}
    for path in copies.values():
        if path.exists():
            raise RefusedError(printable(f"{path}: is there already: remove it, or choose another folder with -o"))
    make_folders(Disk(), target)
    for original, path in copies.items():
        try:
            with path.open("xb") as file:
                file.write(original.read_bytes())
        except FileExistsError as error:
            raise RefusedError(printable(f"{path}: is there already: choose another folder with -o")) from error
    return list(copies.values())
