"""A system that starts no more threads is told before a library aborts."""

from __future__ import annotations

import threading

import pytest

from room2dgs import cli
from room2dgs.errors import InputError
from room2dgs.thread_limit import check_threads


@pytest.fixture
def limit(monkeypatch):
    """`limit(count)`: so many threads can be started, as under `ulimit -u`."""

    def to(count: int) -> None:
        start = threading.Thread.start
        left = [count]

        def limited(thread: threading.Thread) -> None:
            left[0] -= 1
            if left[0] < 0:
                raise RuntimeError("can't start new thread")
            start(thread)

        monkeypatch.setattr(threading.Thread, "start", limited)

    return to


def test_all_threads_are_gone_again():
    before = threading.active_count()
    check_threads()
    assert threading.active_count() == before


def test_too_few_threads_are_one_sentence(limit, capsys):
    limit(3)
    before = threading.active_count()
    with pytest.raises(InputError, match="no more than 3 threads can be started, a run has up to"):
        check_threads()
    assert threading.active_count() == before
    limit(0)
    assert cli.main(["doctor", "who"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
