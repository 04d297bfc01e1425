"""Which frames are used and which are held out."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from room2dgs.captures.selection import evenly_spaced, hold_out


@given(st.integers(3, 200), st.integers(3, 200))
def test_the_asked_number_is_chosen_in_order_from_first_to_last(available, count):
    chosen = evenly_spaced(range(available), count)
    assert len(chosen) == min(available, count)
    assert chosen == sorted(set(chosen))
    assert (chosen[0], chosen[-1]) == (0, available - 1)
    steps = {b - a for a, b in pairwise(chosen)}
    assert max(steps) - min(steps) <= 1


def test_no_count_means_all():
    assert evenly_spaced("abcd", None) == ["a", "b", "c", "d"]


def test_the_middle_of_each_group_is_held_out():
    train, test = hold_out(range(16), 8)
    assert test == [4, 12]
    assert train == [i for i in range(16) if i not in (4, 12)]


@given(st.integers(0, 100), st.integers(2, 20))
def test_train_and_test_part_the_frames_in_order(count, every):
    train, test = hold_out(range(count), every)
    assert sorted(train + test) == list(range(count))
    assert abs(len(test) - count / every) < 1
    assert 0 not in test


def test_nothing_is_held_out_on_request():
    assert hold_out([1, 2, 3], 0) == ([1, 2, 3], [])
