"""The folder of a capture that is being prepared: one owner, and what a kill left is in nobody's way."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from room2dgs import cli
from room2dgs.errors import InputError
from room2dgs.prepare import prepare as module

HOLDS = (
    "import sys, time\nfrom pathlib import Path\nfrom room2dgs.owner import owned\n"
    "with owned(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)\n"
)


@pytest.fixture
def fails(monkeypatch):
    """`fails(error)`: preparing gets as far as making images/ and ends with the error."""

    def with_error(error: Exception) -> None:
        def prepare(config, out: Path, log) -> None:
            (out / "images").mkdir()
            raise error

        monkeypatch.setattr(module, "prepare", prepare)

    return with_error


@pytest.mark.parametrize("verb", ["prepare", "run"])
def test_a_folder_that_another_process_owns_is_refused(tmp_path, wall, capsys, verb):
    out = tmp_path / "out"
    with subprocess.Popen([sys.executable, "-c", HOLDS, str(out)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        assert cli.main([verb, f"images={wall / 'color'}", f"out={out}"]) == 2
        assert f"another run works in {out} (process {other.pid})" in capsys.readouterr().err
        other.kill()
    assert [path.name for path in out.iterdir()] == [".lock"]


def test_what_a_kill_left_is_taken_over_and_removed(tmp_path, wall, fails, capsys):
    out = tmp_path / "out"
    (out / ".images.partial-4711-beef").mkdir(parents=True)
    (out / ".lock").write_text("4711 elsewhere")
    fails(InputError("too dark"))
    assert cli.main(["prepare", f"images={wall / 'color'}", f"out={out}"]) == 2
    assert "too dark" in capsys.readouterr().err
    assert not out.exists() or not list(out.iterdir())


def test_a_disk_that_fills_leaves_what_is_there(tmp_path, wall, fails, capsys):
    out = tmp_path / "out"
    fails(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(out / "images")))
    assert cli.main(["prepare", f"images={wall / 'color'}", f"out={out}"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("room2dgs: the disk is full: ") and "then type the same command again" in said
    assert {"images", "work"} <= {path.name for path in out.iterdir()}
