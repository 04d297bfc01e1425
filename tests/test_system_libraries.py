"""The system's packages: what is missing is named, and installed only when that is asked for."""

from __future__ import annotations

import os
import shutil
import subprocess

import pytest

from room2dgs import system_libraries


@pytest.fixture
def calls(monkeypatch) -> list[list[str]]:
    """What is run, on a machine of root's with apt-get that lacks a library and a compiler."""
    made: list[list[str]] = []
    monkeypatch.setattr(system_libraries, "missing_libraries", lambda: ["libgl1"])
    monkeypatch.setattr(system_libraries, "missing_build_tools", lambda: ["g++"])
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(subprocess, "call", lambda command, **_: made.append(command) or 0)
    return made


def test_what_is_missing_is_said_and_nothing_is_run(calls, capsys):
    assert system_libraries.main([]) == 1
    assert "apt-get install g++ libgl1" in capsys.readouterr().err
    assert calls == []


def test_the_makefile_has_it_installed(calls):
    assert system_libraries.main(["--install"]) == 0
    assert [command[:2] for command in calls] == [["apt-get", "update"], ["apt-get", "install"]]
    assert calls[1][-2:] == ["g++", "libgl1"]


def test_who_is_not_root_is_told_to_be(calls, capsys, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert system_libraries.main(["--install"]) == 1
    assert "sudo apt-get install g++ libgl1" in capsys.readouterr().err
    assert calls == []


def test_nothing_missing_is_nothing_said(calls, capsys, monkeypatch):
    for name in ("missing_libraries", "missing_build_tools"):
        monkeypatch.setattr(system_libraries, name, list)
    assert system_libraries.main([]) == 0
    assert capsys.readouterr() == ("", "") and calls == []
