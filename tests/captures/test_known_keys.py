"""Keys that a reader does not know are named, and distortion is not passed over."""

from __future__ import annotations

import pytest

from room2dgs.captures.known_keys import check_no_distortion, unknown_in, unknown_keys
from room2dgs.errors import InputError


def test_known_keys_need_no_word():
    assert unknown_keys(["w", "h"], {"w", "h", "fx"}, "a.json") is None
    assert unknown_in([{"w": 1}, None, 3, {"h": 2}], {"w", "h"}, "a.json") is None


def test_each_unknown_key_is_named_once_and_escaped():
    said = unknown_in([{"w": 1, "roll": 0}, {"roll": 1, "\x1b[2J": 2}], {"w"}, "a.json")
    assert said.startswith("a.json has 2 keys") and said.count("roll") == 1
    assert "\x1b" not in said and "\\x1b" in said


@pytest.mark.parametrize("value", [0.1, "0.1", [0, 0, 0.2], {"a": 1}, "many"])
def test_distortion_that_is_not_read_is_refused(value):
    with pytest.raises(InputError, match=r"cam\.json has distortion \(k1\)"):
        check_no_distortion({"fx": 1.0, "k1": value}, "cam.json")


@pytest.mark.parametrize("value", [0, 0.0, "0", None, [], [0, 0.0], {}, "none"])
def test_distortion_of_nothing_is_none(value):
    check_no_distortion({"fx": 1.0, "K1": value, "distortion": value}, "cam.json")
