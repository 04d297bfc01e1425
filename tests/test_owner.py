"""A folder's one owner: a lock that ends with its process."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from room2dgs import owner
from room2dgs.errors import InputError
from room2dgs.owner import LOCK, FolderGone, check_there, owned, refuse_if_owned

HOLDS = """
import os, signal, sys, time
from pathlib import Path
from room2dgs.owner import owned
with owned(Path(sys.argv[1])):
    if sys.argv[2] == "fork" and os.fork() == 0:
        time.sleep(60)
        os._exit(0)
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """`holder(kind)` starts a process that owns tmp_path/run."""
    started = []

    def start(kind: str) -> subprocess.Popen:
        argv = [sys.executable, "-c", HOLDS, str(tmp_path / "run"), kind]
        process = subprocess.Popen(argv, stdout=subprocess.PIPE, text=True, start_new_session=True)
        started.append(process)
        assert process.stdout.readline() == "held\n"
        return process

    yield start
    for process in started:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.stdout.close()
        process.wait()


@pytest.mark.parametrize("kind", ["alone", "fork"])
def test_a_folder_that_another_process_owns_is_refused_until_it_dies(tmp_path, holder, kind):
    process = holder(kind)
    words = rf"another run works in .*run \(process {process.pid}\); wait for it or choose another out=DIR"
    with pytest.raises(InputError, match=words), owned(tmp_path / "run"):
        pass
    with pytest.raises(InputError, match=words):
        refuse_if_owned(tmp_path / "run")
    process.kill()  # the process alone: what it forked lives on, and holds nothing
    process.wait()
    refuse_if_owned(tmp_path / "run")
    with owned(tmp_path / "run"):
        assert (tmp_path / "run" / LOCK).read_text().split()[0] == str(os.getpid())


def test_a_link_to_the_folder_is_the_folder(tmp_path, holder):
    holder("alone")
    (tmp_path / "link").symlink_to(tmp_path / "run")
    with pytest.raises(InputError, match="another run works"), owned(tmp_path / "link"):
        pass


def test_blocks_may_be_nested_but_not_in_another_thread(tmp_path):
    said = []

    def elsewhere():
        try:
            with owned(tmp_path):
                said.append("mine")
        except InputError as error:
            said.append(str(error))

    with owned(tmp_path), owned(tmp_path):
        refuse_if_owned(tmp_path)
        thread = threading.Thread(target=elsewhere)
        thread.start()
        thread.join()
    assert "another run works" in said[0]
    elsewhere()
    assert said[1:] == ["mine"]


def test_nothing_is_left_of_a_lock(tmp_path):
    with owned(tmp_path / "made" / "run"):
        pass
    assert list(tmp_path.rglob("*")) == [tmp_path / "made"]
    with owned(tmp_path):
        (tmp_path / "result").write_text("x")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["made", "result"]


def test_a_file_system_without_locks_is_told_and_used(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(owner.fcntl, "flock", none)
    lines = []
    with owned(tmp_path, lines.append):
        pass
    assert len(lines) == 1 and "without locks" in lines[0]


@pytest.mark.parametrize("kind", ["link", "folder", "pipe"])
def test_what_is_no_file_of_a_lock_is_neither_followed_nor_waited_for(tmp_path, kind):
    run, other = tmp_path / "run", tmp_path / "other.txt"
    run.mkdir()
    other.write_text("mine")
    {"link": lambda path: path.symlink_to(other), "folder": Path.mkdir, "pipe": os.mkfifo}[kind](run / LOCK)
    with pytest.raises(InputError, match=r"\.lock is no file of a lock; delete it"), owned(run):
        pass
    assert other.read_text() == "mine"


@pytest.mark.parametrize("again", [False, True])
def test_a_folder_that_goes_away_meanwhile_is_why_the_rest_fails(tmp_path, again):
    run = tmp_path / "run"
    with pytest.raises(FolderGone, match="was removed while the run worked in it"), owned(run):
        check_there(run / "points" / "a.ply")
        shutil.rmtree(run)
        if again:  # of the same name
            run.mkdir()
        with pytest.raises(FolderGone):
            check_there(run / "points" / "a.ply")
        raise RuntimeError("unable to open database file")
    check_there(run / "points" / "a.ply")  # nobody's any more
    assert run.exists() == again


def test_a_folder_that_can_only_be_read_is_used_by_who_only_reads(tmp_path, monkeypatch):
    def read_only(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(owner.os, "open", read_only)
    with owned(tmp_path, writes=False):
        pass
    with pytest.raises(InputError, match=r"cannot be written \(Read-only file system\)"), owned(tmp_path):
        pass
