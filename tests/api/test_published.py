"""Published tables and rates from Python: those of the commands."""

import jax
import pytest
from outputs.test_outputs import cspr, strict_json

import cspr_jax
from cspr_jax.published.tables import table_object


def test_tables(capsys):
    with jax.enable_x64(False):
        cells = cspr_jax.table("2.1")
    assert table_object("2.1", cells) == strict_json(cspr(capsys, "table", "2.1", "--json"))
    lines = cspr(capsys, "table", "--list").splitlines()
    assert lines == [f"{name}  {title}" for name, title in cspr_jax.list_tables().items()]


@pytest.mark.thorough
def test_the_benchmark(small_bench):
    with jax.enable_x64(False):
        found = cspr_jax.benchmark()
    assert found["schema"] == 1 and all(rate > 0 for rate in found["checks_per_second"].values())
