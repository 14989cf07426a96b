"""Settings that the command line makes before jax starts: vector width, NaN, folder of compiled code, device, memory.

They are environment variables, which child processes inherit; arenas are set for this process too. The user's own
settings take precedence. From Python, only `keep_compiled_code` uses this module.
"""

import ctypes
import errno
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import re
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from cspr_jax.errors import ConfigError, printable, shown
from cspr_jax.numerics import kept_nan
from cspr_jax.numerics.cores import VARIABLE, cores, quota
from cspr_jax.runtime import compile_cache, stages
from cspr_jax.runtime.compile_options import QUICK

# Vectors of this width make code twice as fast on processors that have them; XLA's default is half of it.
WIDE, WIDE_FEATURE = "--xla_cpu_prefer_vector_width=512", "avx512f"
PROBE_SECONDS, LARGEST_RECORD = 120, 1 << 16
# glibc gives each thread an arena of its own, and XLA has many threads: memory that one frees, the others cannot use.
# With four arenas a long sweep needs half the memory; with one, threads that compile would wait for each other. The
# last number is M_ARENA_MAX of malloc.h.
ARENAS = "MALLOC_ARENA_MAX"
_FEW = 4
_ARENA_MAX = -8
_LONGEST_REASON = 200
_PROBE = "import jax; jax.jit(lambda x: x + 1.0)(1.0).block_until_ready()"
# Events of jax: it has lowered a function, which it then compiles; and it has compiled the function.
_LOWERED = "/jax/core/compile/jaxpr_to_mlir_module_duration"
_COMPILED = "/jax/core/compile/backend_compile_duration"
_listeners: list[Any] = []
# XLA logs slow compiling as an error, with the advice to file a bug; real errors come as exceptions, or are fatal and
# still shown.
_ONLY_FATAL = ("TF_CPP_MIN_LOG_LEVEL", "3")
CACHE = "JAX_COMPILATION_CACHE_DIR"
_KEPT = {
    # Otherwise the name of the folder would be part of the key of each entry.
    "JAX_PERSISTENT_CACHE_ENABLE_XLA_CACHES": "none",
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.05",
    "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
}
# The same settings for jax if it is already imported.
_VALUES = {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": 0.05, "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": -1}


def prepare(
    device: str | None = None,
    warn: Callable[[str], None] = lambda line: None,
    *,
    quick: bool = False,
    prefers_cpu: bool = False,
) -> None:
    """Set the variables that jax reads when it is imported, unless it has been imported."""
    if "jax" in sys.modules:
        return
    if device != "gpu":  # a user who requests a GPU sees why there is none
        os.environ.setdefault(*_ONLY_FATAL)
    if device == "cpu":
        os.environ["JAX_PLATFORMS"] = "cpu"
    elif device is None and (quick or prefers_cpu):
        os.environ.setdefault("JAX_PLATFORMS", "cpu")
    _few_arenas()
    if math.isfinite(quota()):
        os.environ.setdefault(VARIABLE, str(cores()))  # XLA would start a thread for each core of the machine
    folder, flags = _folder(None, warn), os.environ.get("XLA_FLAGS", "")
    if flags.strip() not in ("", kept_nan.with_flag("")):
        _check_flags(folder, flags)
    if folder is not None:
        os.environ["XLA_FLAGS"] = _flags(folder, flags, quick=quick)
    kept_nan.set_flag()
    if folder is not None and CACHE not in os.environ:
        _keep(folder, warn)


def keep_compiled_code(folder: str | Path | None = None) -> Path | None:
    """Keep compiled code from one Python process to the next, as the command line does.

    Call it once, before or after jax is imported; code compiled before is not kept. Earlier settings of jax prevail.

    Args:
        folder: folder of the compiled code; None: `CSPR_CACHE_DIR`, or ~/.cache/cspr_jax.

    Returns:
        the folder of this process; None if jax has a cache already, CSPR_CACHE_DIR is empty, or nothing can be written.
    """
    shared = _folder(folder, _warn_of_python)
    loaded = sys.modules.get("jax")
    if shared is None or CACHE in os.environ or (loaded is not None and loaded.config.jax_compilation_cache_dir):
        return None
    before = set(os.environ)
    run_folder = _keep(shared, _warn_of_python)
    if run_folder is not None and loaded is not None:
        # jax has read the environment when it was imported: set its configuration.
        for name in {CACHE, *_KEPT} - before:
            loaded.config.update(name.lower(), _VALUES.get(name, os.environ[name]))
        from jax.experimental.compilation_cache import compilation_cache

        compilation_cache.reset_cache()  # otherwise jax would go on without a folder if it has compiled without one
    return run_folder


def _warn_of_python(line: str) -> None:
    warnings.warn(line, stacklevel=2)


def _keep(folder: Path, warn: Callable[[str], None]) -> Path | None:
    try:
        run_folder = compile_cache.opened(folder, warn)
    except OSError as error:
        warn(f"{folder}: compiled code cannot be kept: {error.strerror or error}")
        return None
    os.environ[CACHE] = os.environ[compile_cache.PROGRAMS] = str(run_folder)
    for name, value in _KEPT.items():
        os.environ.setdefault(name, value)
    return run_folder


def check_device(device: str | None) -> None:
    """Refuse a device that does not exist; this starts jax if the user or JAX_PLATFORMS requests a device."""
    try:
        import jax
    except ValueError as error:
        raise ConfigError("environment", f"holds a variable that jax refuses: {error}") from error

    platforms = os.environ.get("JAX_PLATFORMS", "")
    if device != "gpu" and platforms in ("", "cpu"):
        return
    try:
        kind = jax.devices()[0].platform
    except (RuntimeError, AssertionError) as error:  # jax fails by an assertion if a platform cannot be started
        named = f"{platforms}: must name what jax finds here, such as cpu"
        raise ConfigError("JAX_PLATFORMS", f"{named}: {error}" if str(error) else named) from error
    if device != "gpu":
        return
    if kind != "gpu":
        raise ConfigError("--device", f"gpu: must be cpu here, since jax finds no GPU (it has {kind})")


def tell_compiling() -> None:
    """Announce each function that jax compiles to users who wait; imports jax."""
    import jax

    def listen(event: str, duration_secs: float, **keywords: str | int) -> None:
        del duration_secs
        if event == _LOWERED:
            stages.compiling(_readable(str(keywords.get("fun_name", ""))))
        elif event == _COMPILED:
            stages.compiling(None)

    if not _listeners:
        _listeners.append(listen)
        jax.monitoring.register_event_duration_secs_listener(listen)


def _readable(name: str) -> str:
    # jax gives names such as jit(_first_look), or jit__first_look.
    return re.sub(r"^jit[(_]|\)$", "", name).replace("_", " ").strip()


def _few_arenas() -> None:
    # glibc reads the variable when a process starts: it serves child processes.
    is_set = ARENAS in os.environ or "arena_max" in os.environ.get("GLIBC_TUNABLES", "")
    if is_set or platform.libc_ver()[0] != "glibc":
        return
    os.environ[ARENAS] = str(_FEW)
    ctypes.CDLL(None).mallopt(_ARENA_MAX, _FEW)


def _folder(setting: str | Path | None, warn: Callable[[str], None]) -> Path | None:
    # The name of the folder depends on processor, jaxlib and Python, since code for others must not run.
    setting = os.environ.get("CSPR_CACHE_DIR") if setting is None else setting
    if setting == "":
        return None
    try:
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    except RuntimeError:  # a user without a name, as in a container
        home = os.devnull
    current = (compile_cache.FORMAT, *_versions(), sys.version, *_processor())
    shared = Path(setting or Path(home) / "cspr_jax")
    folder = shared / hashlib.sha256(repr(current).encode()).hexdigest()[:16]
    try:
        shared.parent.mkdir(parents=True, exist_ok=True)
        for path in (shared, folder):
            path.mkdir(mode=compile_cache.PRIVATE, exist_ok=True)
            compile_cache.check_owner(path, may_be_shared=path is shared)
        if not os.access(folder, os.W_OK):
            raise PermissionError(errno.EACCES, "nothing can be written there")
    except OSError as error:
        warn(f"{shared}: compiled code cannot be kept: {error.strerror or error}")
        return None
    return folder


def _versions() -> tuple[str, str]:
    # Ask jaxlib itself for its version: the metadata of an installer may be wrong or missing.
    import jaxlib.version

    try:
        return importlib.metadata.version("jax"), jaxlib.version.__version__
    except importlib.metadata.PackageNotFoundError:
        return "", jaxlib.version.__version__


def _processor() -> tuple[str, ...]:
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return ()
    return tuple(sorted(next((line for line in lines if line.startswith(("flags", "Features"))), "").split()))


def _flags(folder: Path, settings: str, *, quick: bool = False) -> str:
    # XLA reads a value without a leading dash as the name of a file of flags, to which ours cannot be added.
    if settings.strip() and not settings.lstrip().startswith("-"):
        return settings
    # If a flag is set twice, XLA takes the last setting, which is the user's. Leave ours out then, since the full
    # text is part of the key of compiled code.
    ours = [WIDE] if WIDE_FEATURE in _processor() else []
    named = [word.partition("=")[0] for word in settings.split()]
    ours = [flag for flag in (*ours, *(QUICK if quick else ())) if flag.partition("=")[0] not in named]
    return " ".join([*accepted_flags(folder, ours), settings]).strip()


def accepted_flags(folder: Path, flags: Sequence[str]) -> list[str]:
    """Keep only flags that this XLA knows, since it ends a process whose XLA_FLAGS name unknown ones."""
    refusal = _refusal(folder, " ".join(flags)) if flags else ""
    if refusal is None:  # the test gave no result
        return []
    return [flag for flag in flags if not refusal or _is_accepted(folder, flag)]


def _check_flags(folder: Path | None, flags: str) -> None:
    # Flags in a file may change, so that results are not recorded.
    record_folder = folder if flags.lstrip().startswith("-") else None
    reason = _refusal(record_folder, flags)
    if reason:
        raise ConfigError("XLA_FLAGS", f"{shown(flags)}: must be flags that this XLA knows: {reason}")


def _is_accepted(folder: Path, flags: str) -> bool:
    return _refusal(folder, flags) == ""


def _refusal(folder: Path | None, flags: str) -> str | None:
    # XLA ends a process that names a flag it does not know: try flags in another process, once. Return "" if it accepts
    # them, None if the test gave no result.
    record = None if folder is None else folder / "flags.json"
    try:
        answers = {} if record is None else json.loads(compile_cache.plain_bytes(record, LARGEST_RECORD))
    except (OSError, ValueError, RecursionError):
        answers = {}
    answers = answers if isinstance(answers, dict) else {}
    if answers.get(flags) is True:
        return ""
    if isinstance(answers.get(flags), str) and answers[flags]:
        return answers[flags]
    settings = os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu", "TF_CPP_MIN_LOG_LEVEL": "2"}
    # -P: no file in the working folder is executed. The process has its own session: a Ctrl-C must not end the test.
    words, silent, pipe = [sys.executable, "-P", "-c", _PROBE], subprocess.DEVNULL, subprocess.PIPE
    try:
        done = subprocess.run(
            words, env=settings, stdout=silent, stderr=pipe, timeout=PROBE_SECONDS, start_new_session=True
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    if done.returncode in (-signal.SIGINT, -signal.SIGTERM, -signal.SIGKILL):  # somebody ended it: there is no result
        return None
    reason = _reason(done.stderr.decode("utf-8", "replace")) if done.returncode else ""
    if record is not None:
        partial = record.with_suffix(f".{os.getpid()}")
        try:
            partial.unlink(missing_ok=True)
            with partial.open("x", encoding="utf-8") as file:
                file.write(json.dumps(answers | {flags: reason or True}))
            partial.replace(record)
        except OSError:
            return None
    return reason


def _reason(log: str) -> str:
    # The log gives the reason in the first line of an error, after the location in XLA's code.
    lines = [line.partition("] ")[2] for line in log.splitlines() if line[:1] in ("E", "F")]
    return printable(next(filter(None, lines), "it ends the process"))[:_LONGEST_REASON]
