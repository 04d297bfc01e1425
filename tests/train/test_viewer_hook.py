"""train.viewer=true: a server while it trains, and the same bits as without."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.geometry.camera import Camera
from room2dgs.train import load_surfels, train

pytest.importorskip("viser", reason="viser is missing (the extra `view`)")


def test_a_run_that_is_watched_gives_the_same_bits_and_its_server_ends(capture, tmp_path, monkeypatch, capsys):
    from room2dgs.viewer import hook

    scene, points = capture
    monkeypatch.setattr(hook, "EVERY_S", 0.0)
    monkeypatch.setattr(hook.Viewer, "watched", True)
    shown, ended = [], []
    monkeypatch.setattr(hook.Viewer, "show", lambda self, surfels: shown.append(len(surfels.centers)))
    stop = hook.Viewer.stop
    monkeypatch.setattr(hook.Viewer, "stop", lambda self: (ended.append(True), stop(self)))
    said = []
    paths = []
    for name, hooks in (("alone", []), ("watched", [hook.ShowTraining()])):
        out = tmp_path / name
        config = load_config([f"scene.path={tmp_path}", f"out={out}", "train.iterations=6", "train.tensorboard=false"])
        paths.append(train(scene, points, config, out, said.append, hooks=hooks).surfels_path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert len(shown) == 6 and ended == [True]
    assert shown[-1] == len(load_surfels(paths[1]).centers)
    assert [line for line in said if "watch the training at http://127.0.0.1:" in line]
    assert "/?token=" in capsys.readouterr().out
    assert not [line for line in said if "token=" in line]  # a log may be read by others


def test_it_draws_what_the_training_draws(monkeypatch):
    from room2dgs.viewer import hook

    asked = {}

    class Shown:
        address = url = "http://127.0.0.1:1"

        def __init__(self, *_, **options):
            asked.update(options)

        def look_from(self, camera): ...

        def start(self): ...

    monkeypatch.setattr(hook, "Viewer", Shown)
    camera = Camera(np.eye(3), 4, 4, np.eye(4))
    scene = SimpleNamespace(train=[SimpleNamespace(camera=camera)])
    config = load_config(["scene.path=any", "out=any", "render.near_m=0.3"])
    trainer = SimpleNamespace(scene=scene, config=config, surfels=lambda: None, log=lambda _: None)
    hook.ShowTraining().on_start(trainer)
    assert asked["near_m"] == 0.3
