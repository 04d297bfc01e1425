"""Bad input ends with one sentence and exit code 2, and nothing half-written stays behind."""

from __future__ import annotations

import errno
import os

import pytest

from room2dgs import cli
from room2dgs.demo_room import make as module
from room2dgs.demo_room.make import RoomOptions, make_room
from room2dgs.errors import InputError


@pytest.fixture
def quick(monkeypatch):
    """Replaces the making of a room by writing one file."""
    monkeypatch.setattr(module, "write_capture", lambda out, options: (out / "room.json").write_text(str(options.seed)))


@pytest.fixture
def full_disk(monkeypatch):
    """A disk that fills in the middle of the room."""

    def write(out, options):
        (out / "color").mkdir()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module, "write_capture", write)


def refused(capsys, *arguments) -> str:
    """The one line that a refused command prints."""
    assert cli.main(["demo", *map(str, arguments)]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    return message


def test_a_folder_with_content_is_refused(quick, tmp_path, capsys):
    (tmp_path / "room").mkdir()
    (tmp_path / "room/color").write_text("mine")
    assert "--overwrite" in refused(capsys, tmp_path / "room")
    assert (tmp_path / "room/color").read_text() == "mine"


def test_overwrite_replaces_a_room(quick, tmp_path):
    assert cli.main(["demo", str(tmp_path / "room"), "--seed", "1"]) == 0
    assert cli.main(["demo", str(tmp_path / "room"), "--seed", "2", "--overwrite"]) == 0
    assert (tmp_path / "room/room.json").read_text() == "2"
    assert [path.name for path in tmp_path.iterdir()] == ["room"]


def test_overwrite_never_deletes_what_is_not_a_room(quick, tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("three years")
    assert "thesis.tex" in refused(capsys, tmp_path, "--overwrite")
    assert (tmp_path / "thesis.tex").exists()


def test_an_empty_folder_and_missing_parents_are_fine(quick, tmp_path):
    (tmp_path / "empty").mkdir()
    assert cli.main(["demo", str(tmp_path / "empty")]) == 0
    assert cli.main(["demo", str(tmp_path / "a/b/c")]) == 0
    assert (tmp_path / "a/b/c/room.json").exists()


def test_a_file_is_refused(quick, tmp_path, capsys):
    (tmp_path / "file").write_text("x")
    assert "not a folder" in refused(capsys, tmp_path / "file", "--overwrite")
    assert "file/room" in refused(capsys, tmp_path / "file/room")


@pytest.mark.parametrize(
    "arguments",
    [
        ("--frames", "0"),
        ("--blank-walls", "5"),
        ("--fov", "nan"),
        ("--gloss", "-0.1"),
        ("--jpeg-quality", "101"),
    ],
)
def test_an_option_out_of_range_is_named(quick, tmp_path, capsys, arguments):
    assert arguments[0][2:].replace("-", "_") in refused(capsys, tmp_path / "room", *arguments)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_nothing(full_disk, tmp_path):
    with pytest.raises(InputError, match="No space left"):
        make_room(tmp_path / "room", RoomOptions())
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_the_earlier_room(full_disk, tmp_path):
    (tmp_path / "room").mkdir()
    (tmp_path / "room/room.json").write_text("old")
    with pytest.raises(InputError):
        make_room(tmp_path / "room", RoomOptions(), overwrite=True)
    assert (tmp_path / "room/room.json").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["room"]
