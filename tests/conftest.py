"""Settings for every test: 64 bits, repeatable examples; robots that many tests share."""

import os
import shutil
import tempfile
from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from cspr_jax.robots import point_mass

# What one process has compiled, those beside it and those that tests start need not; it goes with the run.
COMPILED = Path(os.environ.setdefault("CSPR_TESTS_COMPILED", f"{tempfile.gettempdir()}/cspr-tests-{os.getpid()}"))
os.environ["CSPR_CACHE_DIR"] = str(COMPILED)
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_compilation_cache_dir", str(COMPILED / "tests"))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
jax.config.update("jax_persistent_cache_enable_xla_caches", "none")
settings.register_profile("default", deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
settings.load_profile("default")


# Files that take long go first, so that both processes end together.
_LONG = ("test_platform", "test_transition_plans", "test_pose_plans", "test_pose_maps", "test_workers", "test_crashes")


def pytest_sessionfinish(session):
    """The process that began takes the compiled code away; those that work for it know the folder from it."""
    if not hasattr(session.config, "workerinput"):
        shutil.rmtree(COMPILED, ignore_errors=True)


def pytest_collection_modifyitems(items):
    """Long files first."""
    items.sort(key=lambda item: item.path.stem not in _LONG)


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
    from cspr_jax.bench import six_cables, three_cables, timing

    monkeypatch.setattr(timing, "REPEATS", 1)
    monkeypatch.setattr(timing, "SIDE", 8)
    monkeypatch.setattr(timing, "COPIED", 4096)
    monkeypatch.setattr(three_cables, "BATCHES", 1)
    monkeypatch.setattr(three_cables, "NUMPY_SEGMENTS", 2)
    monkeypatch.setattr(six_cables, "NUMPY_TRAJECTORIES", 2)
    monkeypatch.setattr(six_cables, "TRAJECTORIES", 400)
    monkeypatch.setattr(six_cables, "LANES", 64)
