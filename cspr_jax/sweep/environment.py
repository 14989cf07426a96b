"""Environment of a computation: code, libraries and machine, as far as they can change bits of a result."""

import functools
import hashlib
import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

from cspr_jax import __version__

PACKAGE = Path(__file__).resolve().parents[1]
LIBRARIES = ("jax", "jaxlib", "numpy", "h5py")


@functools.cache
def environment() -> dict[str, Any]:
    """Everything on which bits of results can depend; equal environments give equal bits."""
    import h5py
    import jax

    device = jax.devices()[0]
    model, flags = _processor()
    return {
        "package": package_hash(),
        "version": __version__,
        **_git(),
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in LIBRARIES},
        "hdf5": h5py.version.hdf5_version,
        "backend": device.platform,
        "device_kind": device.device_kind,
        "device_count": jax.device_count(),
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
        "machine": platform.machine(),
        "cpu_model": model,
        "cpu_flags": flags,
    }


def package_hash() -> str:
    """SHA-256 of the package's own files, which needs no git and includes uncommitted changes."""
    total = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*")):
        # Leave out examples, which only wheels contain, and which compute nothing.
        if path.suffix in (".py", ".toml") and PACKAGE / "examples" not in path.parents:
            total.update(f"{path.relative_to(PACKAGE).as_posix()}\0".encode())
            total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def _git() -> dict[str, Any]:
    # Ask git about the checkout that contains the package, if there is one.
    def ask(*words: str) -> str | None:
        try:
            done = subprocess.run(("git", "-C", str(PACKAGE), *words), capture_output=True, timeout=60)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.decode("utf-8", "replace").strip() if done.returncode == 0 else None

    if ask("ls-files", "--error-unmatch", "__init__.py") is None:
        return {"git_commit": None, "git_dirty": None}
    return {"git_commit": ask("rev-parse", "HEAD"), "git_dirty": bool(ask("status", "--porcelain", "--", "."))}


def _processor() -> tuple[str, str]:
    # Name of the processor, and a hash of its instruction sets, on which compiled code depends.
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor(), ""
    values = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in reversed(lines))}
    flags = " ".join(sorted(values.get("flags", values.get("Features", "")).split()))
    return values.get("model name", platform.processor()), hashlib.sha256(flags.encode()).hexdigest()[:16]
