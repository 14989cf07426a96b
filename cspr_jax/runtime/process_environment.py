"""Environment of a process of the command line: settings of other libraries, and checks of threads and memory."""

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

FEW = 4  # number of threads of every command, such as for signals, besides one per core of NumPy's library
OF_JAX, OF_JAX_PER_CORE = 16, 4  # numbers of threads of jax, some of whose pools have one thread for each core
# Variables with numbers of threads of NumPy's and SciPy's library for linear algebra, and of OpenMP. With our small
# matrices these threads mostly wait in loops, which would take a fifth of the processor time of a plan.
OF_OPENBLAS, OF_ALL_LIBRARIES = "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"
# Smallest address space in which jax compiles a plan on two cores, bytes.
SMALLEST_MEMORY = 2_000_000_000
_SMALL_STACK = 1 << 16  # bytes
_LARGER = "or the limit of a container or a job, must be larger"
_THREADS = f"no more threads can be started: `ulimit -u`, {_LARGER}"
_PROCESSES = f"no more processes can be started: `ulimit -u`, {_LARGER}"
# Parts of messages of XLA, LLVM and the loader of shared objects about a lack of memory.
_NO_MEMORY = ("RESOURCE_EXHAUSTED", "failed to map segment", "annot allocate memory", "nable to allocate", "bad_alloc")
_MEMORY = f"memory does not suffice: `ulimit -v`, {_LARGER}"


def configure() -> None:
    """Protect this process, and those that it starts, from settings that users made for other programs.

    The command line opens no windows, and its pictures do not depend on matplotlib's settings.
    """
    if OF_ALL_LIBRARIES not in os.environ:
        os.environ.setdefault(OF_OPENBLAS, "1")
    os.environ["MPLBACKEND"] = "Agg"
    os.environ["MATPLOTLIBRC"] = os.devnull  # an empty file: a user's own may make the import of matplotlib fail
    logging.getLogger("matplotlib").setLevel(logging.CRITICAL)
    if not sys.warnoptions:
        # NumPy's warnings point to code of libraries; users get messages of this program instead. Workers inherit the
        # settings of both warnings.
        warnings.filterwarnings("ignore", category=RuntimeWarning)
        os.environ.setdefault("PYTHONWARNINGS", "ignore::RuntimeWarning")
    try:
        Path.home()
    except RuntimeError:
        # The user has no home folder, as in a container. All libraries can handle a path below which no folder can be
        # made.
        os.environ["HOME"] = os.devnull


def defer_fortran() -> None:
    """Defer loading NumPy's interface to Fortran, which SciPy would load because it looks up all names of NumPy.

    Loading it takes a fifth of the time of loading jax.
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
    """Refuse a matplotlibrc in the working folder, where matplotlib looks first, that makes its import fail.

    Such a file can also select the user's locale. Where the system lacks that locale, programs use C instead, and
    so must matplotlib.
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
    """Refuse to begin where libraries could not start threads, since they would end or interrupt the process.

    With a number of processes, the threads of jax in this process, or in that many workers, count too; and memory must
    suffice for compiling, since LLVM would end the process otherwise.
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
    """Name of the resource whose lack caused an error, if it did."""
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
    """Keep the log of dask.distributed from standard error; this program reports what matters itself."""
    with contextlib.suppress(ImportError):
        import distributed  # sets its loggers up when it is imported

        del distributed
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
