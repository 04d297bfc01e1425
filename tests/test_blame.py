"""Errors of libraries: the machine's in one sentence, the input's as they are, ours left alone."""

from __future__ import annotations

import errno
import os
import sqlite3

import pytest

from room2dgs import files
from room2dgs.blame import Lack, by_the_machine, error_sentence, lack
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
    said = error_sentence(error, "room2dgs run out=r resume=true")
    assert said.startswith(kind.value) and said.endswith("then go on with: room2dgs run out=r resume=true")
    assert "\n" not in said and said.count(";") == 1
    assert error_sentence(error).endswith("then type the same command again")


def test_a_database_that_is_full_is_a_full_disk(tmp_path):
    assert error_sentence(of_sqlite(tmp_path)).startswith("the disk is full: database or disk is full; make room")


def test_a_sentence_of_ours_keeps_what_it_names():
    try:
        try:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise InputError("r/a.ply cannot be written (No space left on device); choose another out=DIR") from error
    except InputError as error:
        assert by_the_machine(error)
        assert error_sentence(error) == (
            "the disk is full: r/a.ply cannot be written (No space left on device); make room, then type the same "
            "command again"
        )


@pytest.mark.parametrize(
    "error",
    [
        ValueError("shapes differ"),
        KeyError("f_score"),
        FileNotFoundError(errno.ENOENT, "No such file or directory", "x"),
        PermissionError(errno.EACCES, "Permission denied"),
        IsADirectoryError(errno.EISDIR, "Is a directory", 3),
    ],
)
def test_what_may_be_our_mistake_is_not_explained_away(error):
    assert error_sentence(error) is None and not by_the_machine(error)


def place_of_a_folder(tmp_path) -> None:
    (tmp_path / "a.ply").mkdir()
    with files.whole_file(tmp_path / "a.ply") as temporary:
        temporary.write_text("x")


def place_in_a_file(tmp_path) -> None:
    (tmp_path / "a").write_text("x")
    (tmp_path / "a" / "b").mkdir()


@pytest.mark.parametrize(
    ("happens", "said"),
    [
        (place_of_a_folder, "a.ply is a folder where a file belongs; delete it, or give it another name"),
        (place_in_a_file, "b leads through a file where a folder belongs; delete that file, or give it another name"),
        (lambda folder: (folder / ("a" * 300)).is_file(), "... is a longer name than the file system allows; choose"),
        (lambda folder: (folder / "\x1b" / ("a" * 5000)).is_file(), "\\x1b/aaaa"),
    ],
)
def test_what_lies_in_the_way_is_one_sentence_that_names_the_place(tmp_path, happens, said):
    with pytest.raises(OSError) as caught:
        happens(tmp_path)
    told_of_it = error_sentence(caught.value)
    assert said in told_of_it and told_of_it.isprintable() and told_of_it.count(";") == 1 and len(told_of_it) < 420
    assert not by_the_machine(caught.value)


def test_rights_that_lack_are_told_with_the_place():
    error = PermissionError(errno.EACCES, "Permission denied", "r/x.png")
    assert (
        error_sentence(error)
        == "r/x.png may not be read or written by this user; change its rights, or choose another place"
    )


def test_bad_input_is_told_as_it_is():
    error = InputError("a.png has no disk full of stars; replace it")
    assert error_sentence(error) == str(error) and not by_the_machine(error)


def test_what_an_error_was_raised_in_place_of_does_not_count():
    try:
        try:
            raise MemoryError
        except MemoryError:
            raise InputError("a.npy is damaged; replace it") from None
    except InputError as error:
        assert not by_the_machine(error)
