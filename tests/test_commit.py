"""The commit that runs record: of a wheel what its build noted, of a checkout what git says, once a process."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from room2dgs import commit as module
from room2dgs.commit import commit


@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    folder = tmp_path / "room2dgs"
    folder.mkdir()
    monkeypatch.setattr(module, "PACKAGE", folder)
    commit.cache_clear()
    yield folder
    commit.cache_clear()


def git(root: Path, *arguments: str) -> str:
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    return subprocess.run(["git", "-C", root, *who, *arguments], check=True, capture_output=True, text=True).stdout


def test_a_wheel_knows_it_and_asks_nobody(package, monkeypatch):
    (package / "commit.txt").write_text("0123abc\n")
    monkeypatch.setattr(subprocess, "run", None)
    assert commit() == "0123abc"


def test_a_wheel_of_sources_without_a_commit_knows_none(package):
    (package / "commit.txt").write_text("\n")
    assert commit() is None


def test_without_a_checkout_nobody_knows(package):
    assert commit() is None


def test_a_checkout_is_asked_once_and_changed_files_are_marked(package, monkeypatch):
    root = package.parent
    git(root, "init", "-q")
    (package / "a.py").write_text("")
    git(root, "add", ".")
    git(root, "commit", "-qm", "first")
    head = git(root, "rev-parse", "HEAD").strip()
    assert commit() == head
    (package / "a.py").write_text("changed")
    assert commit() == head  # of this process
    commit.cache_clear()
    assert commit() == head + "+"
