"""Small rooms made once for all tests of the demo."""

from __future__ import annotations

import pytest

from room2dgs.demo_room.make import RoomOptions, make_room
from tests.oracles.made_captures import Capture, read_capture

TINY = {"frames": 12, "width": 96, "height": 72, "noise": 0.0, "jpeg_quality": 100}


@pytest.fixture(scope="session")
def plain(tmp_path_factory) -> Capture:
    """A room with textured walls, no noise, constant exposure."""
    return read_capture(make_room(tmp_path_factory.mktemp("plain") / "room", RoomOptions(seed=3, **TINY)))


@pytest.fixture(scope="session")
def drifting(tmp_path_factory) -> Capture:
    """The same room under a drifting exposure."""
    options = RoomOptions(seed=3, exposure_drift=1.0, **TINY)
    return read_capture(make_room(tmp_path_factory.mktemp("drifting") / "room", options))


@pytest.fixture(scope="session")
def blank(tmp_path_factory) -> Capture:
    """Another seed, all walls blank, a polished floor."""
    options = RoomOptions(seed=4, blank_walls=4, gloss=0.8, **TINY)
    return read_capture(make_room(tmp_path_factory.mktemp("blank") / "room", options))
