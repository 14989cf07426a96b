"""Worker processes beside sweeps: what they share, what they give, and what is said when one dies."""

import os

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as some

from cspr_jax.errors import ConfigError, ResourceError
from cspr_jax.numerics.batches import in_threads
from cspr_jax.numerics.cores import VARIABLE, cores
from cspr_jax.runtime.processes import LARGEST_USUAL, Spread, balanced, check_count, usual_count


def shares(items):
    """Of each item the number of cores that its process computes on."""
    return [(item, cores()) for item in items]


def killed(items):
    """Nothing: the process ends."""
    os._exit(len(items))


@example([0, 0, 0], 2)
@given(some.lists(some.integers(0, 1000), max_size=30), some.integers(1, 9))
def test_groups_are_balanced(sizes, count):
    """Every item is in one group, no group is empty, and none is larger than the smallest by more than an item."""
    groups = balanced(sizes, count)
    assert sorted(k for group in groups for k in group) == list(range(len(sizes)))
    assert len(groups) == min(count, len(sizes)) and all(groups)
    whole = [sum(sizes[k] for k in group) for group in groups]
    assert whole == sorted(whole, reverse=True)
    assert not whole or whole[0] - whole[-1] <= max(sizes)


def test_work_is_spread(monkeypatch):
    """In order, over processes that have a share of the cores each; one process does it here, with all of them."""
    monkeypatch.setenv(VARIABLE, "4")
    with Spread(2) as spread:
        assert spread(shares, "abcde", [1, 5, 2, 4, 3]) == [(name, 2) for name in "abcde"]
        assert spread(shares, "f", [1]) == [("f", 2)]
    with Spread(1) as spread:
        assert spread(shares, "ab", [1, 1]) == [("a", 4), ("b", 4)]
    assert os.environ[VARIABLE] == "4"


def test_a_worker_dies():
    words = "a worker died, perhaps for want of memory: --workers must be smaller"
    with pytest.raises(ResourceError, match=words), Spread(2) as spread:
        spread(killed, "ab", [1, 1])


@pytest.mark.parametrize("wrong", [0, -1, 257, 1.5])
def test_wrong_counts(wrong):
    with pytest.raises(ConfigError, match=f"--workers: {wrong}: must be an integer from 1 to 256"):
        check_count(wrong)
    check_count(None)


def test_usual_counts(monkeypatch):
    """One a core, but no more than there are parts, nor than memory has room for."""
    monkeypatch.setenv(VARIABLE, "3")
    assert [usual_count(parts) for parts in (0, 1, 2, 3, 4, 100)] == [1, 1, 2, 3, 3, 3]
    monkeypatch.setenv(VARIABLE, "1000")
    assert usual_count(10_000) == LARGEST_USUAL


@pytest.mark.parametrize("given", ["", "0", "-2", "two", "1.5"])
def test_a_share_that_is_no_number_is_none(monkeypatch, given):
    monkeypatch.delenv(VARIABLE, raising=False)
    every = cores()
    monkeypatch.setenv(VARIABLE, given)
    assert cores() == every >= 1


def test_one_thread_on_one_core(monkeypatch):
    """And the same results."""
    import threading

    def one(item):
        return item, threading.get_ident()

    monkeypatch.setenv(VARIABLE, "1")
    assert in_threads(one, [1, 2, 3]) == [(k, threading.get_ident()) for k in (1, 2, 3)]
    monkeypatch.setenv(VARIABLE, "2")
    assert np.array([here != threading.get_ident() for _, here in in_threads(one, [1, 2, 3])]).all()
