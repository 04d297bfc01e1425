"""Errors of libraries: the machine's in one sentence, the input's as they are, ours left alone."""

from __future__ import annotations

import errno
import os
import sqlite3

import pytest

from room2dgs.blame import Lack, by_the_machine, lack, told
from room2dgs.errors import InputError


def of_sqlite(tmp_path) -> Exception:
    """A database that may have so many pages only."""
    database = sqlite3.connect(tmp_path / "a.db")
    database.execute("PRAGMA max_page_count=4")
    database.execute("CREATE TABLE t (b BLOB)")
    with pytest.raises(sqlite3.OperationalError) as caught:
        database.execute("INSERT INTO t VALUES (?)", (bytes(100_000),))
    database.close()
    return caught.value


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), Lack.ROOM),
        (OSError(errno.EDQUOT, "Disk quota exceeded"), Lack.ROOM),
        (OSError("a/b.bmp cannot be written; is the disk full?"), Lack.ROOM),
        (RuntimeError("[database_sqlite.cc:1296] SQLite error: database or disk is full"), Lack.ROOM),
        (RuntimeError("I/O error: No space left on device (os error 28)"), Lack.ROOM),
        (OSError(errno.EFBIG, "File too large"), Lack.SIZE),
        (RuntimeError("[database_sqlite.cc:42] SQLite error: disk I/O error"), Lack.DISK),
        (OSError(errno.EROFS, "Read-only file system"), Lack.WRITING),
        (OSError(errno.EMFILE, "Too many open files"), Lack.FILES),
        (RuntimeError("can't start new thread"), Lack.THREADS),
        (RuntimeError("Resource temporarily unavailable"), Lack.THREADS),
        (MemoryError(), Lack.MEMORY),
        (RuntimeError("std::bad_alloc"), Lack.MEMORY),
        (RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried 8 bytes"), Lack.MEMORY),
        (
            RuntimeError("OpenCV(4) alloc.cpp:73: (-4:Insufficient memory) Failed to allocate 9 bytes"),
            Lack.MEMORY,
        ),
        (RuntimeError("CUDA out of memory. Tried to allocate 2 GiB"), Lack.GPU_MEMORY),
    ],
)
def test_what_the_machine_lacks_is_one_sentence_with_what_to_do(error, kind):
    assert lack(error) is kind
    said = told(error, "room2dgs run out=r resume=true")
    assert said.startswith(kind.value) and said.endswith("then go on with: room2dgs run out=r resume=true")
    assert "\n" not in said and said.count(";") == 1
    assert told(error).endswith("then type the same command again")


def test_a_database_that_is_full_is_a_full_disk(tmp_path):
    assert told(of_sqlite(tmp_path)).startswith("the disk is full: database or disk is full; make room")


def test_a_sentence_of_ours_keeps_what_it_names():
    try:
        try:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise InputError("r/a.ply cannot be written (No space left on device); choose another out=DIR") from error
    except InputError as error:
        assert by_the_machine(error)
        assert told(error) == (
            "the disk is full: r/a.ply cannot be written (No space left on device); make room, then type the same "
            "command again"
        )


@pytest.mark.parametrize(
    "error",
    [
        ValueError("shapes differ"),
        KeyError("f_score"),
        FileNotFoundError(errno.ENOENT, "No such file or directory", "x"),
        PermissionError(errno.EACCES, "Permission denied", "x"),
    ],
)
def test_what_may_be_our_mistake_is_not_explained_away(error):
    assert told(error) is None and not by_the_machine(error)


def test_bad_input_is_told_as_it_is():
    error = InputError("a.png has no disk full of stars; replace it")
    assert told(error) == str(error) and not by_the_machine(error)


def test_what_an_error_was_raised_in_place_of_does_not_count():
    try:
        try:
            raise MemoryError
        except MemoryError:
            raise InputError("a.npy is damaged; replace it") from None
    except InputError as error:
        assert not by_the_machine(error)
