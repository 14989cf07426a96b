"""The quick tests catch faults: some are planted, one at a time, in a copy of the package; a test file must then fail.

Each is a text that stands in one place of the package, what takes its place, and the quick tests that catch it. Who
changes the text changes it here too.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.soak
ROOT = Path(__file__).parents[2]

FAULTS = {
    "a sign": (
        "per_length = adjugate @ relative_acceleration(robot, acceleration) / determinant",
        "per_length = -adjugate @ relative_acceleration(robot, acceleration) / determinant",
        "robots/test_force_balance.py",
    ),
    "an index": (
        "opposite = jnp.roll(a, -1, axis=0) - jnp.roll(a, -2, axis=0)",
        "opposite = jnp.roll(a, -2, axis=0) - jnp.roll(a, -1, axis=0)",
        "swings/test_hypocycloid.py",
    ),
    "a tolerance": ("SMALLEST_MARGIN = 1e-9", "SMALLEST_MARGIN = 1e-6", "swings/test_proof.py"),
    "an omitted knot": (
        "itertools.pairwise([0.0, *np.asarray(amplitude.knots).tolist(), 1.0])",
        "itertools.pairwise([0.0, 1.0])",
        "swings/test_proof.py",
    ),
    "a swapped axis of the z-up frame": (
        '"up": (1.0, -1.0, -1.0)',
        '"up": (-1.0, -1.0, 1.0)',
        "plans/test_planning.py::test_an_upward_z_axis_mirrors_a_downward_one",
    ),
    "a wrong factor in a duration": (
        "return jnp.sqrt(oscillation(segment, arcs).period / segment.rate)",
        "return 2.0 * jnp.sqrt(oscillation(segment, arcs).period / segment.rate)",
        "swings/test_hypocycloid.py",
    ),
    "a limit compared the wrong way": (
        "lambda state, limit: (limit**2 - state.length**2) / (2.0 * state.z0**2)",
        "lambda state, limit: (state.length**2 - limit**2) / (2.0 * state.z0**2)",
        "swings/test_margins.py",
    ),
    "a lost pair of cables": (
        "for i, j in itertools.combinations(range(robot.n_cables), 2)\n        if not is_same(base",
        "for i, j in itertools.combinations(range(robot.n_cables - 1), 2)\n        if not is_same(base",
        "robots/test_platform.py::test_the_catalogue_hangs_still",
    ),
    "a number of arcs that is passed over": (
        "(least if self.has_pulleys else trial.answers.tried_arcs)[goes_on] + step",
        "(least if self.has_pulleys else trial.answers.tried_arcs)[goes_on] + 2 * step",
        "swings/test_clear_arcs.py::test_numbers_of_arcs_are_tried_one_after_the_other",
    ),
    "a wrong parity of arcs": (
        "last = jnp.where(odd, rotations.conjugate(last), last)",
        "last = jnp.where(odd, last, rotations.conjugate(last))",
        "robots/test_platform.py::test_motions_are_the_oracle_s",
    ),
    "a mass centre that is left out of tolerances": (
        "return _Reaches(off, np.minimum(known.moved / influence.lengths, 1.0), radius * rest)",
        "return _Reaches(off, np.minimum(known.moved / influence.lengths, 1.0), 0.0 * rest)",
        "motions/test_uncertainty.py",
    ),
    "spools that are displaced half as far": (
        "multiple * float(uncertainty.spool_positions),",
        "0.5 * multiple * float(uncertainty.spool_positions),",
        "swings/test_enclosures.py",
    ),
    "tolerances whose functional is not corrected": (
        "more, last = (moved + shifted) * (1.0 + SPARE)",
        "more, last = -(moved + shifted) * (1.0 + SPARE)",
        "motions/test_uncertainty.py",
    ),
    "a margin that is not refined": ("1.0 / 4.0, 1.0 / 6.0, 7", "1.0 / 4.0, 1.0 / 6.0, 1", "swings/test_margins.py"),
}


def copied(folder: Path) -> Path:
    """The package and its tests."""
    skipped = shutil.ignore_patterns("__pycache__")
    for name in ("cspr_jax", "tests", "sweeps", "results"):
        shutil.copytree(ROOT / name, folder / name, ignore=skipped)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def planted(package: Path, old: str, new: str) -> None:
    """Put a fault where the only place of a text is."""
    places = [path for path in sorted(package.rglob("*.py")) for _ in range(path.read_text("utf-8").count(old))]
    assert len(places) == 1, f"{old!r} stands in {len(places)} places: change it here as it was changed there"
    places[0].write_text(places[0].read_text("utf-8").replace(old, new), "utf-8")


def outcome(folder: Path, *names: str) -> int:
    """Exit status of quick tests of a copy, which comes first on the path: 0 all pass, 1 some fail."""
    command = [sys.executable, "-m", "pytest", "-m", "not soak and not thorough", "-x", "-p", "no:cacheprovider"]
    here = os.environ | {"PYTHONPATH": str(folder)}
    here.pop("XLA_FLAGS", None)
    done = subprocess.run([*command, *(f"tests/{name}" for name in names)], cwd=folder, env=here, capture_output=True)
    return done.returncode


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_caught(tmp_path, name):
    old, new, tests = FAULTS[name]
    folder = copied(tmp_path)
    planted(folder / "cspr_jax", old, new)
    assert outcome(folder, tests) == 1


def test_without_a_fault_they_pass(tmp_path):
    assert outcome(copied(tmp_path), *sorted({tests for _, _, tests in FAULTS.values()})) == 0


def test_a_text_that_is_gone_is_told(tmp_path):
    (tmp_path / "module.py").write_text("one = 1\ntwo = 1\n")
    for old in ("three", "= 1"):
        with pytest.raises(AssertionError, match="places"):
            planted(tmp_path, old, "")
