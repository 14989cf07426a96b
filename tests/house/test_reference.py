"""The reference knows every column, dataset, attribute and field that plans write."""

import csv
import json
import re
import sys
from pathlib import Path

import h5py
import pytest

import cspr_jax
from cspr_jax.config.keys.winch import ROWS
from cspr_jax.outputs.plan_report import plan_object

ROOT = Path(__file__).parents[2]
# Plans that together write everything; the first one is quick.
PLANS = ("hall", "straight_line", "launch", "transition", "cogiro", "translating", "table_3_2")
HALL = "[[pose]]\nrest = true\n[[pose]]\nposition = [0.2, 0.1, 1.2]\n"
HEAD = "schema = 1\nsamples = 5\nz0 = 1.2\nmax_arcs = 4\n"
OWN = {
    "hall": HEAD + 'robot = "prototype"\n' + HALL,
    "transition": HEAD + 'robot = "prototype"\nfamily = "transition"\n' + HALL,
    "translating": HEAD + 'robot = "launch-robot"\n' + HALL.replace("1.2]", "-1.2]"),
}


@pytest.fixture(scope="module")
def reference():
    """Text of the page."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from generate_reference import reference_text
    finally:
        sys.path.pop(0)
    return reference_text()


def test_every_key_of_a_winch_is_in_the_reference(reference):
    table = fields_of(reference, "`[winch]`: Winches of the cables: drums, gears and motors.")
    assert table == {row.name for row in ROWS}


def named(text: str) -> set[str]:
    return set(re.findall(r"`([^`\s]+)`", text))


def fields_of(text: str, head: str) -> set[str]:
    """First column of the table behind a head."""
    rows = text.split(f"\n{head}\n\n")[1].split("\n\n")[0].splitlines()[2:]
    return {re.match(r"\| `(\w+)` \|", row)[1] for row in rows}


@pytest.mark.ci("table_3_2", "launch", "straight_line", "transition", "translating")
@pytest.mark.parametrize("name", [PLANS[0], *(pytest.param(name, marks=pytest.mark.thorough) for name in PLANS[1:])])
def test_everything_that_a_plan_writes_is_in_the_reference(tmp_path, reference, name):
    path = ROOT / "sweeps" / f"{name}.toml"
    if name in OWN:
        path = tmp_path / "plan.toml"
        path.write_text(OWN[name])
    plan = cspr_jax.plan(path)
    words = named(reference[reference.index("## Columns of a motion") :])
    for ending in (".csv", ".h5"):
        plan.save(tmp_path / f"motion{ending}", anyway=True)
    with (tmp_path / "motion.csv").open() as file:
        heads = next(csv.reader(file))
    # Cables are counted on.
    known = {re.sub(r"^(length|rate|tension)_\d+$", r"\1_1", head) for head in heads}
    assert known <= words
    with h5py.File(tmp_path / "motion.h5") as file:
        assert set(file) | {key for key in file.attrs if key not in ("checksum", "checksum_method")} <= words
    whole = json.loads(json.dumps(plan_object(plan)))
    text = reference[reference.index("## JSON of a plan") :]
    assert set(whole) <= fields_of(text, "The object:")
    for segment in whole["segments"]:
        assert set(segment) <= fields_of(text, "Each of `segments`:")
    if "launch" in whole:
        assert set(whole["launch"]) == fields_of(text, "`launch`:")
        assert set(whole["launch"]["scatter"]) == fields_of(text, "Its `scatter`:")


@pytest.mark.thorough
def test_everything_that_a_check_writes_is_in_the_reference(reference):
    """Of a motion that fails, slowed down."""
    places = [[0.0, 0.0, 1.0], [0.1, 0.05, 0.9], [0.0, 0.0, 1.0]]
    check = cspr_jax.check("prototype", [0.0, 2.0, 4.0], places, limits={"cable_speed_max": 0.06})
    known = fields_of(reference, "The object of `cspr check --json`:")
    assert set(check.to_dict()) == known - {"slower", "retimed", "rows", "units", "last_step"}
    assert set(check.slower().to_dict()) == {"factor", "static", "check"}
