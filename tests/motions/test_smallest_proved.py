"""Smallest proved numbers, against a search of each motion alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.smallest_proved import NONE, smallest_proved

LAST = 9
OUTCOMES = (Verdict.FEASIBLE, Verdict.SLACK_CABLE, Verdict.UNDECIDED, Verdict.FEWER_ARCS_UNDECIDED)


@st.composite
def tables(draw):
    """Verdicts of the numbers up to the last one, of a few motions, and which numbers their family has."""
    count = draw(st.integers(0, 4))
    verdicts = draw(
        st.lists(
            st.lists(st.sampled_from(OUTCOMES), min_size=LAST + 1, max_size=LAST + 1), min_size=count, max_size=count
        )
    )
    exists = draw(
        st.lists(st.lists(st.booleans(), min_size=LAST + 1, max_size=LAST + 1), min_size=count, max_size=count)
    )
    first = draw(st.lists(st.integers(0, LAST + 1), min_size=count, max_size=count))
    return verdicts, exists, first


@given(tables(), st.integers(1, 3))
def test_each_motion_gets_the_number_that_it_gets_alone(table, step):
    verdicts, exists, first = table
    asked = []

    def trial(index, lower):
        tried = [
            next((k for k in range(least, LAST + 1, step) if exists[i][k]), NONE)
            for i, least in zip(index, lower, strict=True)
        ]
        asked.extend(zip(index.tolist(), tried, strict=True))
        found = [Verdict.NO_ARCS if k == NONE else verdicts[i][k] for i, k in zip(index, tried, strict=True)]
        return np.array(tried), np.array([flag.value for flag in found])

    smallest = smallest_proved(trial, np.array(first, int), step=step, last=LAST)
    for i, least in enumerate(first):
        numbers = [k for k in range(least, LAST + 1, step) if exists[i][k]]
        proved = [k for k in numbers if verdicts[i][k] in (Verdict.FEASIBLE, Verdict.FEWER_ARCS_UNDECIDED)]
        number = min(proved, default=NONE)
        unsure = [k for k in numbers if verdicts[i][k] & (Verdict.UNDECIDED | Verdict.FEWER_ARCS_UNDECIDED)]
        before = [k for k in unsure if number in (NONE, k) or k < number]
        assert (smallest.number[i], smallest.undecided[i]) == (number, min(before, default=NONE))
    assert len(set(asked)) == len(asked)


def test_numbers_stop_at_the_last_one_of_each_motion():
    def trial(index, lower):
        return lower, np.full(len(index), Verdict.SLACK_CABLE.value)

    smallest = smallest_proved(trial, np.array([1, 2]), step=2, last=np.array([1, 8]))
    assert smallest.number.tolist() == smallest.undecided.tolist() == [NONE, NONE]


@pytest.mark.parametrize("last", [0, np.array([0])])
def test_nothing_is_tried_beyond_the_last_number(last):
    smallest = smallest_proved(lambda index, lower: pytest.fail("tried"), np.array([1]), step=1, last=last)
    assert smallest.number.tolist() == [NONE]
