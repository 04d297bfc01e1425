"""Maps that a network makes while something else is at work."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.depth.network import maps
from room2dgs.depth.network.ahead import maps_ahead
from room2dgs.errors import InputError


@pytest.fixture
def grey():
    """Six different photos."""
    return [np.full((60, 80, 3), 20 * k, np.uint8) for k in range(1, 7)]


@pytest.fixture
def config(tmp_path):
    """The shipped network's, with a map cache."""

    def made(*overrides):
        prior = load_config(["scene.path=x", "out=y", *overrides]).prior
        return replace(prior, cache=str(tmp_path / "cache"))

    return made


def cached(tmp_path, kind):
    folder = tmp_path / "cache" / kind
    return {path.name[:6] for path in folder.iterdir()} if folder.exists() else set()


def test_a_block_that_fails_before_it_begins_has_no_maps(photos, grey, config, tmp_path):
    with pytest.raises(KeyError), maps_ahead(photos(grey), config("prior=auto"), lambda line: None):
        raise KeyError("poses")
    assert not (tmp_path / "cache").exists()


def test_both_kinds_are_there_when_the_block_has_ended(photos, grey, config, tmp_path):
    frames = photos(grey)
    with maps_ahead(frames, config("prior=auto"), lambda line: None):
        pass
    assert cached(tmp_path, "depth") == cached(tmp_path, "normal") == {frame.name for frame in frames}


def test_a_gpus_maps_are_not_taken_for_a_cpus(photos, grey, config, tmp_path, monkeypatch):
    """Their numbers differ in the last places, and runs on one machine repeat to the bit."""
    for gpu in (False, True):
        monkeypatch.setattr(maps, "runs_on_gpu", lambda provider, gpu=gpu: gpu)
        with maps_ahead(photos(grey), config("prior=auto"), lambda line: None):
            pass
    assert len(list((tmp_path / "cache" / "depth").iterdir())) == 2 * len(grey)


@pytest.mark.parametrize("prior", [("prior=none",), ("prior=files", "prior.depth.path=x", "prior.normal.path=x")])
def test_nothing_is_made_that_nobody_will_ask_for(photos, grey, config, tmp_path, prior):
    with maps_ahead(photos(grey), config(*prior), lambda line: None):
        pass
    assert not (tmp_path / "cache").exists()


def test_a_capture_with_depth_gets_normals_alone(photos, grey, config, tmp_path):
    """Whether its depth can be used is known later."""
    frames = [replace(frame, depth_path=frame.color_path) for frame in photos(grey)]
    with maps_ahead(frames, config("prior=auto"), lambda line: None):
        pass
    assert cached(tmp_path, "normal") and not cached(tmp_path, "depth")


def test_a_photo_that_cannot_be_decoded_is_named_after_the_block(photos, grey, config):
    frames = photos(grey)
    frames[2].color_path.write_bytes(b"no photo")
    done = []
    with (
        pytest.raises(InputError, match=frames[2].color_path.name),
        maps_ahead(frames, config("prior=auto"), lambda line: None) as begin,
    ):
        begin()
        done.append(True)
    assert done


def test_a_block_that_fails_stops_it(photos, grey, config, tmp_path, monkeypatch):
    """At the photo at hand, and it is the block's error that counts."""
    frames, begun, go = photos(grey), threading.Event(), threading.Event()
    inferred = maps.predictions

    def waiting(*arguments):
        begun.set()
        assert go.wait(30)
        return inferred(*arguments)

    monkeypatch.setattr(maps, "predictions", waiting)
    monkeypatch.setattr(maps, "photos_at_once", lambda model, config: (1, 1))
    with pytest.raises(KeyError, match="poses"), maps_ahead(frames, config("prior=auto"), lambda line: None) as begin:
        begin()
        begin()  # once is enough
        assert begun.wait(30)
        threading.Timer(0.2, go.set).start()  # once the block has failed
        raise KeyError("poses")
    assert len(cached(tmp_path, "depth")) == 1
