"""Settings for every test: 64 bits, strict promotion, repeatable examples, kept code; robots that many tests share."""

import collections
import ctypes
import gc
import os
import platform
import sys
import tempfile
from pathlib import Path

# Before NumPy and SciPy are imported: their small products do not pay for a second thread, which waits for work in a
# loop. What tests start inherits it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import jaxlib.version
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from support import durations, readers, shapes
from xdist.scheduler import LoadScopeScheduling

shapes.install()

from cspr_jax.numerics import batches, elementary, kept_nan
from cspr_jax.robots.model import point_mass
from cspr_jax.runtime import xla

# Passes of Python's collector over the objects of jax take a tenth of the time.
gc.set_threshold(200_000, 20, 50)
# Compiled code is kept from run to run beside the packages that it belongs to; XLA's key is the program. What tests
# start finds it by the environment.
BESIDE = sys.prefix if sys.prefix != sys.base_prefix else tempfile.gettempdir()
COMPILED = Path(os.environ.setdefault("CSPR_TESTS_COMPILED", f"{BESIDE}/cspr-tests-compiled")).absolute()
LARGEST = 1_000_000_000  # bytes; beyond that all of it is taken away
# Most of a test is compiling: these take a third of the time for it, and the code is slower. The soak runs with what
# users run with, and so does what runtime/test_xla starts.
CHEAP = ("--xla_backend_optimization_level=0", *xla.QUICK[1:])
# Most quick tests ask for a handful of cases, and a batch is padded.
LARGEST_BATCH = 64
# Compiled code of finished files goes where a process has more than so many bytes.
ROOM = 3_000_000_000
os.environ["CSPR_CACHE_DIR"] = str(COMPILED)
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_compilation_cache_dir", str(COMPILED / "tests"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
jax.config.update("jax_persistent_cache_enable_xla_caches", "none")
# The package is lenient to its users, and here as strict as what it is called from.
elementary.PROMOTION = ("strict", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
# As `double_precision` has it: what tests call themselves, and what commands call, is one program.
jax.config.update("jax_default_matmul_precision", "highest")
settings.register_profile("default", deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
settings.load_profile("default")
# The soak draws new cases, and prints how to repeat one that fails.
settings.register_profile("soak", derandomize=False, print_blob=True, max_examples=1000)


def _group(path: str) -> str:
    """Tests that one process runs: those of a folder compile the same kernels; some folders compile little."""
    folder = path.rpartition("/")[0]
    return path if folder.rpartition("/")[2] in ("house", "reliability") else folder


class _Groups(LoadScopeScheduling):
    # pytest-xdist's own groups are marks that it writes into names, where this pytest no longer reads them.
    def _split_scope(self, nodeid):
        return _group(nodeid.partition("::")[0])


@pytest.hookimpl
def pytest_xdist_make_scheduler(config, log):
    """Who gives the processes their tests."""
    return _Groups(config, log)


def pytest_addoption(parser):
    """Where time goes, and parts of the tests for machines side by side."""
    parser.addoption("--record", type=Path, metavar="FILE", help="write time and compiled programs of each test there")
    parser.addoption("--shard", default="1/1", metavar="K/N", help="run only the K-th of N parts of the tests")


def pytest_configure(config):
    """Before jax compiles anything. The soak takes batches and flags of users."""
    kept_nan.set_flag()
    if "not soak" in config.option.markexpr:
        # Workers find them set already. Twice, they would be other keys of compiled code than those of one process.
        given = os.environ.get("XLA_FLAGS", "").split()
        place = COMPILED / jaxlib.version.__version__
        place.mkdir(parents=True, exist_ok=True)
        cheap = xla.accepted_flags(place, [flag for flag in CHEAP if flag not in given])
        os.environ["XLA_FLAGS"] = " ".join([*cheap, *given])
        batches.LARGEST = LARGEST_BATCH
    elif config.option.markexpr.startswith("soak"):
        settings.load_profile("soak")
    is_first = not hasattr(config, "workerinput")
    if config.option.record:
        config.pluginmanager.register(durations.Recorder(config.option.record, is_first=is_first))
    if is_first and sum(path.stat().st_size for path in COMPILED.rglob("*") if path.is_file()) > LARGEST:
        for path in COMPILED.rglob("*"):
            if path.is_file():
                path.unlink()


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What is imported stays: Python's collector need not look at it, then or later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def _mark(items, is_part: bool):
    """Cases that `quick` does not name are thorough, or soak if there is a `ci` that does not name them either.

    A name that no case has is an error. Hypothesis' are `drawn`.
    """
    cases = collections.defaultdict(set)
    for item in items:
        if getattr(item.obj, "is_hypothesis_test", False):
            item.add_marker("drawn")
        names = {mark.name: mark.args for mark in item.iter_markers() if mark.name in ("quick", "ci")}
        for mark in names.items():
            cases[item.nodeid.partition("[")[0], *mark].add(item.callspec.id)
        if names and item.callspec.id not in names.get("quick", ()):
            item.add_marker("thorough" if item.callspec.id in names.get("ci", (item.callspec.id,)) else "soak")
    unknown = [(test, name) for (test, _, names), known in cases.items() for name in names if name not in known]
    if unknown and not is_part:
        raise pytest.UsageError(f"quick or ci names cases that there are not: {unknown}")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """The long groups first, so that both processes end together: those with most to read. A shard has every N-th."""
    _mark(items, any("[" in name for name in config.args))
    groups = {item.path: _group(item.path.as_posix()) for item in items}
    sizes: dict[str, int] = collections.Counter()
    for path, group in groups.items():
        sizes[group] += path.stat().st_size
    items.sort(key=lambda item: (-sizes[groups[item.path]], groups[item.path]))
    number, count = map(int, config.option.shard.split("/"))
    kept = sorted(sizes, key=lambda group: (-sizes[group], group))[number - 1 :: count]
    config.hook.pytest_deselected(items=[item for item in items if groups[item.path] not in kept])
    items[:] = [item for item in items if groups[item.path] in kept]


@pytest.fixture(autouse=True, scope="module")
def room():
    """No process keeps the compiled code of all files."""
    yield
    statistics = Path("/proc/self/statm")
    pages = int(statistics.read_text().split()[1]) if statistics.exists() else 0
    if pages * os.sysconf("SC_PAGE_SIZE") > ROOM:
        jax.clear_caches()
        gc.collect()
        if platform.libc_ver()[0] == "glibc":  # else the next file finds as little room
            ctypes.CDLL(None).malloc_trim(0)


@pytest.fixture(autouse=True, scope="module")
def reader(request):
    """A process that reads files serves a whole file of tests."""
    with readers.shared(request.path.parent.name):
        yield


def equilateral(radius: float) -> np.ndarray:
    """Spools of (2.17) to (2.19)."""
    half = np.sqrt(3.0) / 2.0
    return radius * np.array([[half, -0.5, 0.0], [-half, -0.5, 0.0], [0.0, 1.0, 0.0]])


# From their centroid, as the kernels take spools.
TILTED = np.array([[1.3, 0.2, -0.1], [-0.4, 1.1, 0.25], [-0.9, -0.8, 0.05]])
TILTED = TILTED - TILTED.mean(0)


@pytest.fixture(scope="session")
def prototype():
    """The robot of chapter 2."""
    return point_mass.point_mass_robot(equilateral(0.26), mass=0.198, name="prototype")


@pytest.fixture(scope="session")
def tilted():
    """A general triangle: no symmetry, tilted plane, labels the other way round; as the kernels take it."""
    return point_mass.point_mass_robot(TILTED, mass=1.7, gravity=9.80665, name="tilted")


@pytest.fixture
def figures(monkeypatch):
    """Every figure that is drawn, instead of its file."""
    drawn = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda self, *args, **kwargs: drawn.append(self))
    return drawn


@pytest.fixture
def small_bench(monkeypatch):
    """Sizes with which `cspr bench` takes seconds."""
    from cspr_jax import bench

    monkeypatch.setattr(bench.timing, "REPEATS", 1)
    monkeypatch.setattr(bench.timing, "SIDE", 8)
    monkeypatch.setattr(bench.timing, "COPIED", 4096)
    monkeypatch.setattr(bench.three_cables, "BATCHES", 1)
    monkeypatch.setattr(bench.three_cables, "NUMPY_SEGMENTS", 2)
    monkeypatch.setattr(bench.ellipses, "COUNT", 256)
    monkeypatch.setattr(bench.six_cables, "NUMPY_TRAJECTORIES", 2)
    monkeypatch.setattr(bench.six_cables, "TRAJECTORIES", 400)
    monkeypatch.setattr(bench.six_cables, "LANES", 64)
    monkeypatch.setattr(bench.motions, "rates", lambda: {"3 cables, 10001 rows": 12.0})
    monkeypatch.setattr(bench.paths, "rates", lambda: {"3 cables": 500.0})
    monkeypatch.setattr(bench.forward_kinematics, "rates", lambda: {"3 cables": 1e6})
    monkeypatch.setattr(
        bench.workspaces, "rates", lambda: {"8 cables": {"float32": 2e6, "float64": 1e6, "first_s": 1.0}}
    )
