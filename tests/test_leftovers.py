"""What a killed process leaves of its writing, and who may remove it."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time

import pytest

from room2dgs import files
from room2dgs.errors import InputError
from room2dgs.files import (
    check_room,
    is_temporary,
    remove_all_leftovers,
    remove_leftovers,
    scratch_folder,
    whole_file,
    whole_folder,
)
from room2dgs.owner import owned


def dead() -> int:
    """The number of a process that has ended."""
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait()
    return process.pid


def names(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def of(tmp_path):
    """`of(process, machine)` writes a file and a folder as such a process would leave them."""

    def write(process: int, machine: str | None = None) -> list[str]:
        mark = f"{process}-{machine or files._machine()}"
        (tmp_path / f".mesh.ply.{mark}.tmp").write_text("half")
        (tmp_path / f".database.db.{mark}.tmp-wal").write_text("half")
        (tmp_path / f".sfm.partial-{mark}").mkdir()
        (tmp_path / f".sfm.partial-{mark}" / "a.bmp").write_text("half")
        return [name for name in names(tmp_path) if mark in name]

    return write


def test_what_whole_file_and_whole_folder_write_to_is_known_as_temporary(tmp_path):
    with whole_file(tmp_path / "mesh.ply") as file, whole_folder(tmp_path / "0") as folder:
        with scratch_folder(tmp_path, "sfm") as scratch:
            assert all(is_temporary(path.name) for path in (file, folder, scratch))
        file.write_text("whole")
    assert names(tmp_path) == ["0", "mesh.ply"]
    for name in ("mesh.ply", ".hidden", "..", ".a.tmp", "x.1.tmp", "mesh.ply.12.tmp", ".git"):
        assert not is_temporary(name)
    for name in (".mesh.ply.4711.tmp", ".model.earlier-12", ".sfm-abcd_123"):  # of earlier versions
        assert is_temporary(name)


def test_without_the_lock_only_what_belongs_to_no_process_goes(tmp_path, of):
    gone, living, far = of(dead()), of(os.getppid()), of(dead(), "beef")
    remove_leftovers(tmp_path)
    assert names(tmp_path) == sorted(living + far)
    old = time.time() - files.ABANDONED_S - 60
    for name in far:
        os.utime(tmp_path / name, (old, old))
    folder = next(name for name in far if "sfm" in name)
    remove_leftovers(tmp_path)
    assert names(tmp_path) == sorted([*living, folder])  # somebody still writes into it
    os.utime(tmp_path / folder / "a.bmp", (old, old))
    remove_leftovers(tmp_path)
    assert names(tmp_path) == living and not set(gone) & set(living)


def test_who_owns_a_folder_removes_all_in_it_but_not_in_what_others_own(tmp_path, of):
    names_of_all = [*of(dead()), *of(os.getppid()), *of(os.getpid()), *of(7, "beef")]
    (tmp_path / "points").mkdir()
    (tmp_path / "points" / ".sfm-abcd_123").mkdir()
    (tmp_path / "outside").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "outside")
    (tmp_path / "0").mkdir()
    (tmp_path / "0" / "config.yaml").write_text("")
    for kept in ("outside", "0"):
        (tmp_path / kept / ".mesh.ply.7-beef.tmp").write_text("half")
    (tmp_path / "outside" / "config.yaml").write_text("")
    with owned(tmp_path):
        remove_all_leftovers(tmp_path)
    assert not set(names(tmp_path)) & set(names_of_all)
    assert names(tmp_path / "points") == []
    assert all((tmp_path / kept / ".mesh.ply.7-beef.tmp").exists() for kept in ("outside", "0"))


def test_a_folder_that_was_being_replaced_comes_back(tmp_path):
    for kind, text in (("earlier", "old"), ("partial", "new")):
        (tmp_path / f".model.{kind}-{dead()}-{files._machine()}").mkdir()
        next(tmp_path.glob(f".model.{kind}-*")).joinpath("a.txt").write_text(text)
    remove_leftovers(tmp_path)
    assert (tmp_path / "model" / "a.txt").read_text() == "old" and names(tmp_path) == ["model"]


def test_leftovers_of_a_process_that_had_our_number_are_in_nobodys_way(tmp_path):
    """In a container every first process is number 1."""
    model = tmp_path / "model"
    for kind in ("earlier", "partial"):
        folder = tmp_path / f".model.{kind}-{files._mark()}"
        folder.mkdir()
        (folder / "a.txt").write_text(kind)
    with pytest.raises(InputError, match="too few"), whole_folder(model):
        raise InputError("too few")
    assert (model / "a.txt").read_text() == "earlier"
    with whole_folder(model) as partial:
        assert names(partial) == []
        (partial / "a.txt").write_text("new")
    assert (model / "a.txt").read_text() == "new" and names(tmp_path) == ["model"]


def test_a_name_as_long_as_names_may_be_can_be_written(tmp_path):
    path = tmp_path / ("é" * 125 + ".ply")
    assert len(os.fsencode(path.name)) == 254
    with whole_file(path) as temporary:
        assert is_temporary(temporary.name)
        temporary.write_text("whole")
    assert path.read_text() == "whole" and names(tmp_path) == [path.name]


def test_what_could_not_be_written_is_named(tmp_path):
    with pytest.raises(OSError, match="No space left") as caught, whole_file(tmp_path / "mesh.ply") as temporary:
        temporary.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")  # as `write` raises it
    assert caught.value.filename == str(tmp_path / "mesh.ply") and names(tmp_path) == []


def test_room_is_asked_for_before_a_library_aborts(tmp_path):
    code = (
        "import resource, sys\nfrom pathlib import Path\nfrom room2dgs.files import check_room\n"
        "check_room(Path(sys.argv[1]), 50_000)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, resource.RLIM_INFINITY))\n"
        "try:\n    check_room(Path(sys.argv[1]), 50_000)\nexcept OSError as error:\n    print(error.errno)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True)
    assert done.stdout == f"{errno.EFBIG}\n"
    with pytest.raises(OSError, match=r"No space|too large") as caught:
        check_room(tmp_path, 1 << 62)
    assert caught.value.filename == str(tmp_path) and names(tmp_path) == []
