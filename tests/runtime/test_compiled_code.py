"""Compiled code is released before the system allows no more of it."""

import jax
import jax.numpy as jnp
import pytest

from cspr_jax.runtime import compiled_code
from cspr_jax.runtime.compiled_code import MAPS, is_crowded, limit_compiled_code

COUNT = 20


@pytest.mark.skipif(not MAPS.exists(), reason="only Linux tells the mapped parts of memory")
def test_compiled_code_is_released(tmp_path, monkeypatch):
    def count():
        return MAPS.read_bytes().count(b"\n")

    functions = [jax.jit(lambda x, k=k: jnp.sin(k * x)) for k in range(COUNT)]
    results = [function(1.0) for function in functions]
    monkeypatch.setattr(compiled_code, "PERIOD", 0.0)
    before = count()
    limit_compiled_code()
    assert count() >= before - COUNT  # few parts: nothing is released
    largest = tmp_path / "largest"
    largest.write_text(f"{before}\n")
    monkeypatch.setattr(compiled_code, "LARGEST", largest)
    assert is_crowded()
    limit_compiled_code()
    assert count() < before - 2 * COUNT
    assert [function(1.0) for function in functions] == results


def test_other_systems_have_no_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled_code, "LARGEST", tmp_path / "absent")
    assert not is_crowded()
