"""Every kind of file of every layout in its turn is a pipe or a device; and folders of any name."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from room2dgs.captures.read import read_scene
from room2dgs.config import dump_config, load_config
from room2dgs.errors import InputError
from room2dgs.tools.capture_layouts.registry import LAYOUTS

SECONDS = 30
NAMES = [
    "${out}", "${oc.env:HOME}", "$HOME", "a,b", "it's", 'q"q', "[x]", "{y}", "new\nline", "-dash", "u\u0308 \u6f22",
    "a=b", "a:b", "#c", "x\\y", "trail\\", "null", "1e5", "true", "~", " lead", "trail ", "(p)", "*", "?", "%d",
    "<x>", "a;b&c|d", "'",
]  # fmt: skip


@contextmanager
def no_longer_than(seconds: int) -> Iterator[None]:
    def blocked(*_):
        pytest.fail("it blocks")

    before = signal.signal(signal.SIGALRM, blocked)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def representatives(root: Path) -> list[Path]:
    """A file of each folder and ending."""
    found = {}
    for path in sorted(root.rglob("*")):
        if path.is_file():
            found.setdefault((path.parent, path.suffix), path)
    return list(found.values())


def everything(config) -> None:
    scene = read_scene(config)
    if scene.given_points is not None:
        scene.given_points()
    for frame in scene.frames:
        frame.color()
        frame.mask()
        frame.depth()


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_pipe_or_a_device_in_a_files_place_never_blocks(written, settings_of, tmp_path, name):
    root = written(name)
    config = settings_of(root, name)
    everything(config)
    for path in representatives(root):
        path.rename(tmp_path / "held")
        for put in (os.mkfifo, lambda path: path.symlink_to("/dev/zero")):
            put(path)
            with no_longer_than(SECONDS):
                try:
                    everything(config)
                except InputError as error:
                    assert "\n" not in str(error)
            path.unlink()
        (tmp_path / "held").rename(path)


@pytest.mark.parametrize("folder", NAMES)
def test_a_folder_may_be_called_anything(written, tmp_path, folder):
    root = written("nerfstudio").rename(tmp_path / folder)
    config = load_config([f"scene.path={root}", "out=unused", "scene.test_every=0"])
    assert config.scene.path == str(root)
    saved = tmp_path / "config.yaml"
    saved.write_text(dump_config(config), encoding="utf-8")
    assert load_config([], saved).scene.path == str(root)
    everything(config.scene)
