"""What is no regular file, or not there, has a sentence of its own and never blocks."""

from __future__ import annotations

import os
import unicodedata

import pytest

from room2dgs.errors import InputError
from room2dgs.regular_files import check_regular, open_regular, read_regular
from room2dgs.texts import shown


def sentence(path, read=lambda path: read_regular(path, 100)) -> str:
    with pytest.raises(InputError) as caught:
        read(path)
    return str(caught.value)


def test_each_kind_of_wrong_file_has_its_own_sentence(tmp_path):
    (tmp_path / "Photo.JPG").write_bytes(b"x")
    (tmp_path / unicodedata.normalize("NFD", "küche.jpg")).write_bytes(b"x")
    (tmp_path / "dead").symlink_to("gone.jpg")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "folder").mkdir()
    (tmp_path / "empty").touch()
    (tmp_path / "large").write_bytes(bytes(101))
    os.mkfifo(tmp_path / "pipe")
    assert "is missing; copy the capture again" in sentence(tmp_path / "nothing")
    assert "Photo.JPG is there" in sentence(tmp_path / "photo.jpg")
    assert "another Unicode form" in sentence(tmp_path / unicodedata.normalize("NFC", "küche.jpg"))
    assert "is a link to gone.jpg, which is not there" in sentence(tmp_path / "dead")
    assert "leads back to itself" in sentence(tmp_path / "loop")
    assert "is a folder" in sentence(tmp_path / "folder")
    assert "is empty" in sentence(tmp_path / "empty")
    assert "too large" in sentence(tmp_path / "large")
    assert "is a pipe" in sentence(tmp_path / "pipe")
    assert "is missing" in sentence(tmp_path / "Photo.JPG" / "below")
    assert "cannot be the name" in sentence(tmp_path / "zero\0byte")


@pytest.mark.parametrize("read", [open_regular, check_regular])
def test_a_pipe_and_a_device_are_refused_without_waiting(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    assert "is a pipe" in sentence(tmp_path / "pipe", read)
    assert "is a device" in sentence(tmp_path / "zero", read)


def test_a_link_to_a_regular_file_is_followed(tmp_path):
    (tmp_path / "there").write_bytes(b"content")
    (tmp_path / "link").symlink_to("there")
    assert read_regular(tmp_path / "link", 100) == b"content"
    assert check_regular(tmp_path / "link") == 7


def test_names_are_shown_without_what_a_terminal_would_obey():
    assert shown("a\x1b[31mred\n\u202eok\udcff é 日本") == "a\\x1b[31mred\\n\\u202eok\\udcff é 日本"
    assert str(InputError("x\x1b]0;title\x07.jpg is missing")) == "x\\x1b]0;title\\x07.jpg is missing"


@pytest.mark.parametrize("read", [open_regular, check_regular, lambda path: read_regular(path, 100)])
def test_what_git_lfs_leaves_is_no_file_of_its_kind(tmp_path, read):
    path = tmp_path / "images.bin"
    path.write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    assert sentence(path, read) == f"{path} is a pointer of Git LFS and not the file itself; run git lfs pull"


def test_a_list_of_missing_files_lists_their_folder_once(tmp_path, monkeypatch):
    for index in range(50):
        (tmp_path / f"{index}.png").write_bytes(b"x")
    listed, list_folder = [], os.listdir
    monkeypatch.setattr(os, "listdir", lambda folder: listed.append(folder) or list_folder(folder))
    for index in range(50):
        assert sentence(tmp_path / f"{index}.jpg", check_regular).endswith("is missing; copy the capture again")
    assert len(listed) == 1
    (tmp_path / "0.JPG").write_bytes(b"x")
    os.utime(tmp_path, ns=(0, 0))  # whatever a clock's steps
    assert "but 0.JPG is there beside it" in sentence(tmp_path / "0.jpg", check_regular)
