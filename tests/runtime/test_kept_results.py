"""Results that one run leaves to the next."""

import json
import zlib

import pytest

from cspr_jax.published import tables
from cspr_jax.published.tables import kept_result
from cspr_jax.runtime.compile_cache import PROGRAMS


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(PROGRAMS, str(tmp_path))
    return tmp_path


def test_a_result_is_computed_once_for_the_same_sources_and_settings(folder, monkeypatch):
    asked = []

    def compute():
        asked.append(len(asked))
        return [["a", 0.1, None, asked[-1]]]

    first = kept_result("table", {"n": 1}, compute)
    assert kept_result("table", {"n": 1}, compute) == first and asked == [0]
    assert kept_result("table", {"n": 2}, compute) != first and asked == [0, 1]
    assert kept_result("table", {"n": 1}, compute, again=True) == [["a", 0.1, None, 2]]
    assert kept_result("table", {"n": 1}, compute) == [["a", 0.1, None, 2]] and len(asked) == 3
    monkeypatch.setattr(tables, "checksum_of_sources", lambda endings: "others")
    assert kept_result("table", {"n": 1}, compute) == [["a", 0.1, None, 3]]
    monkeypatch.delenv(PROGRAMS)
    assert kept_result("table", {"n": 1}, compute) == [["a", 0.1, None, 4]]


def test_what_is_damaged_or_another_s_is_computed_again(folder):
    kept_result("table", 1, lambda: ["good"])
    (entry,) = folder.iterdir()
    data = entry.read_bytes()
    forged = (b"3", b"[" * 50_000, json.dumps([json.loads(zlib.decompress(data))[0], "x" * (1 << 24)]).encode())
    for bad in (b"", data[:-3], b"x" * 50, data[:20] + b"?" + data[21:], *(zlib.compress(one) for one in forged)):
        entry.write_bytes(bad)
        assert kept_result("table", 1, lambda: ["new"]) == ["new"]
    kept_result("table", 2, lambda: ["two"])
    (other,) = (path for path in folder.iterdir() if path != entry)
    entry.write_bytes(other.read_bytes())
    assert kept_result("table", 1, lambda: ["one"]) == ["one"]
