"""Results come in order, little is ahead of what was asked for, and an error ends it."""

from __future__ import annotations

import threading
import time

import pytest

from room2dgs.parallel_map import parallel_map


def test_results_are_in_order_though_later_ones_are_sooner_done():
    def slow_first(thing: int) -> int:
        time.sleep(0.02 if thing % 2 == 0 else 0)
        return thing * thing

    assert list(parallel_map(slow_first, range(20), 3)) == [thing * thing for thing in range(20)]
    assert list(parallel_map(slow_first, [], 3)) == []


def test_two_work_at_once():
    both = threading.Barrier(2, timeout=30)
    assert len(list(parallel_map(lambda _: both.wait(), range(4), 2))) == 4  # one alone would wait for ever


def test_no_more_than_two_a_thread_are_ahead():
    begun = []
    results = parallel_map(begun.append, range(100), 2)
    next(results)
    time.sleep(0.05)
    assert len(begun) <= 4
    results.close()
    assert len(begun) <= 4


def test_an_error_comes_up_in_its_turn_and_nothing_new_begins():
    begun = []

    def fails(thing: int) -> int:
        begun.append(thing)
        if thing == 3:
            raise ValueError("the fourth")
        return thing

    results = parallel_map(fails, range(100), 2)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match="the fourth"):
        next(results)
    assert len(begun) < 10
