"""Environment of a process of the command line: settings of other libraries, and how many threads it may have."""

import contextlib
import errno
import importlib.util
import locale
import logging
import os
import resource
import sys
import threading
import warnings
from pathlib import Path

from cspr_jax.errors import ConfigError, ResourceError
from cspr_jax.numerics.cores import cores

FEW = 4  # threads of every command, such as that for signals, besides one per core of NumPy's library
OF_JAX, OF_JAX_PER_CORE = 16, 4  # threads of jax: some pools of XLA have one for each core
# Threads of NumPy's and SciPy's library for linear algebra, and of all that use OpenMP. With our small matrices its
# threads mostly wait in loops, which would take a fifth of the processor time of a plan.
OF_OPENBLAS, OF_ALL_LIBRARIES = "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"
# Address space below which jax does not compile a plan on two cores, bytes.
SMALLEST_MEMORY = 2_000_000_000
_SMALL_STACK = 1 << 16  # bytes
_LARGER = "or the limit of a container or a job, must be larger"
_THREADS = f"no more threads can be started: `ulimit -u`, {_LARGER}"
_PROCESSES = f"no more processes can be started: `ulimit -u`, {_LARGER}"
# Messages of XLA, LLVM and the loader of shared objects when memory does not suffice.
_NO_MEMORY = ("RESOURCE_EXHAUSTED", "failed to map segment", "annot allocate memory", "nable to allocate", "bad_alloc")
_MEMORY = f"memory does not suffice: `ulimit -v`, {_LARGER}"


def configure() -> None:
    """Keep settings that others made for their own programs from this process and those that it starts.

    The command line opens no window, and its pictures do not depend on matplotlib's settings.
    """
    if OF_ALL_LIBRARIES not in os.environ:
        os.environ.setdefault(OF_OPENBLAS, "1")
    os.environ["MPLBACKEND"] = "Agg"
    os.environ["MATPLOTLIBRC"] = os.devnull  # an empty file: one of the user's may end the import of matplotlib
    logging.getLogger("matplotlib").setLevel(logging.CRITICAL)
    if not sys.warnoptions:
        # NumPy's warnings point to code of libraries; users get messages of this program instead. Workers inherit both
        # settings.
        warnings.filterwarnings("ignore", category=RuntimeWarning)
        os.environ.setdefault("PYTHONWARNINGS", "ignore::RuntimeWarning")
    try:
        Path.home()
    except RuntimeError:
        # The user has no home folder, as in a container. Below this path no folder can be made, which all libraries
        # know how to handle.
        os.environ["HOME"] = os.devnull


def defer_fortran() -> None:
    """Load NumPy's interface to Fortran only where somebody uses it: SciPy asks for all names that NumPy has.

    It takes as long as a fifth of jax.
    """
    name = "numpy.f2py"
    spec = None if name in sys.modules else importlib.util.find_spec(name)
    if spec is None or spec.loader is None:
        return
    loader = spec.loader = importlib.util.LazyLoader(spec.loader)
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    sys.modules["numpy"].f2py = module  # type: ignore[attr-defined]


def check_matplotlibrc() -> None:
    """Refuse a matplotlibrc of the working folder that ends the import of matplotlib, which looks there first.

    Such a file can also ask for the user's locale. Where the system does not have that one, programs use C instead,
    and matplotlib is told so.
    """
    path = Path("matplotlibrc")
    must = "must be UTF-8 text that can be read, since matplotlib reads it in the working folder"
    if not path.exists() or path.is_dir():
        return
    if not path.is_file():
        raise ConfigError(str(path), must)
    try:
        path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(str(path), f"{must}: {getattr(error, 'strerror', None) or error}") from error
    before = locale.setlocale(locale.LC_ALL)
    try:
        locale.setlocale(locale.LC_ALL, "")
    except locale.Error:
        os.environ["LC_ALL"] = "C"
    locale.setlocale(locale.LC_ALL, before)


def check_threads(processes: int | None = None) -> None:
    """Refuse to begin where libraries could not start threads: they would end the process, or send it a Ctrl-C.

    With a number of processes, those of jax are counted too, in this process or in so many workers; and memory must
    suffice for what jax compiles, since LLVM would end the process.
    """
    count = FEW + cores()
    if processes is not None:
        maximum = resource.getrlimit(resource.RLIMIT_AS)[0]
        if 0 <= maximum < SMALLEST_MEMORY:
            raise ResourceError(_MEMORY)
        count += (OF_JAX + FEW) * max(processes, 1) + OF_JAX_PER_CORE * max(cores(), processes)
    over, started = threading.Event(), list[threading.Thread]()
    stack_size = threading.stack_size(_SMALL_STACK)
    try:
        for _ in range(count):
            thread = threading.Thread(target=over.wait, daemon=True)
            thread.start()
            started.append(thread)
    except RuntimeError as error:
        raise ResourceError(_THREADS) from error
    finally:
        threading.stack_size(stack_size)
        over.set()
        for thread in started:
            thread.join()


def shortage(error: Exception) -> str | None:
    """Name the resource that the machine lacks, if that is why something failed."""
    text = str(error)
    if isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError | ImportError) and any(words in text for words in _NO_MEMORY)
    ):
        return _MEMORY
    if isinstance(error, RuntimeError) and "can't start new thread" in text:
        return _THREADS
    if isinstance(error, OSError) and error.errno in (errno.EAGAIN, errno.ENOMEM) and not error.filename:
        return _PROCESSES if error.errno == errno.EAGAIN else _MEMORY
    return None


def quiet_scheduler() -> None:
    """Keep the log of dask.distributed from standard error: its important messages become lines of ours."""
    with contextlib.suppress(ImportError):
        import distributed  # sets its loggers up when it is imported

        del distributed
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
