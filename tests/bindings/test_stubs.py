"""The type stubs of the extension say what it has."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "room2dgs"


def test_the_stubs_are_those_of_the_extension(tmp_path):
    """They are written by `python -m nanobind.stubgen -q -r -m room2dgs._C -O room2dgs`."""
    command = [sys.executable, "-m", "nanobind.stubgen", "-q", "-r", "-m", "room2dgs._C", "-O", tmp_path]
    subprocess.run(command, check=True, cwd=tmp_path)
    written = {path.relative_to(tmp_path): path.read_text() for path in tmp_path.rglob("*.pyi")}
    committed = {path.relative_to(PACKAGE): path.read_text() for path in PACKAGE.rglob("*.pyi")}
    assert len(written) == 3 and written == committed


def test_the_package_is_marked_as_typed():
    assert (PACKAGE / "py.typed").is_file()
