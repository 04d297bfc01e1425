"""What browsers say: known messages come through as they are, all else is bounded or ignored."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.viewer.messages import FAR_M, FIELDS, OPENING, PIXELS, fitting, one_of, switch, whole

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.5, -1.0, 2.0),
    "fov": 1.0,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 720,
    "image_width": 1280,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 1.0, 0.0),
}
RAY = {"ray_origin": (0.0, 0.0, 0.0), "ray_direction": (0.0, 0.0, 1.0), "modifier": None}
CLICK = {"type": "ScenePointerMessage", "event_type": "click", "screen_pos": ((0.5, 0.5),), **RAY}
NODE = {
    "type": "SceneNodeClickMessage", "name": "/cameras/1", "instance_index": None, "screen_pos": (0.1, 0.2),
    "owner": "", **RAY,
}  # fmt: skip
CONTROLS = {"rate": whole(2, 30), "kind": one_of(lambda: ("colour", "depth")), "box": switch}


@pytest.mark.parametrize("message", [CAMERA, CLICK, NODE, NODE | {"modifier": "shift"}])
def test_what_a_browser_says_comes_through_as_it_is(message):
    assert fitting(message, {}) == message
    assert fitting(message | {"more": 1}, {}) == message


@pytest.mark.parametrize(
    ("name", "value", "becomes"),
    [("fov", 0, OPENING[0]), ("fov", 9.0, OPENING[1]), ("image_width", 0, 1), ("image_height", 1e300, PIXELS[1]),
     ("image_width", 640.4, 640)],
)  # fmt: skip
def test_numbers_are_brought_between_their_bounds(name, value, becomes):
    assert fitting(CAMERA | {name: value}, {}) == CAMERA | {name: becomes}


@pytest.mark.parametrize(
    ("name", "value"),
    [("fov", math.nan), ("fov", math.inf), ("fov", "1"), ("fov", True), ("fov", None), ("position", (1e308, 0, 0)),
     ("position", (0, 0)), ("position", (math.nan, 0, 0)), ("position", "abc"), ("position", 3), ("wxyz", (0, 0, 0, 0)),
     ("wxyz", (1e5, 0, 0, 0)), ("look_at", [[0], 0, 0]), ("image_width", math.nan), ("near", None)],
)  # fmt: skip
def test_a_camera_that_cannot_be_is_ignored(name, value):
    assert fitting(CAMERA | {name: value}, {}) is None
    assert fitting({key: kept for key, kept in CAMERA.items() if key != name}, {}) is None


@pytest.mark.parametrize("change", [{"ray_direction": (0, 0, 0)}, {"ray_origin": None}, {"screen_pos": ()}])
def test_a_click_without_a_ray_is_ignored(change):
    assert fitting(CLICK | change, {}) is None


@pytest.mark.parametrize(
    ("uuid", "updates", "value"),
    [("rate", {"value": 12}, 12), ("rate", {"value": 1e308}, 30), ("rate", {"value": -(2**63)}, 2),
     ("rate", {"value": math.nan}, None), ("rate", {"value": "12"}, None), ("rate", {"min": 0}, None),
     ("rate", {"value": 3, "max": 9}, None), ("kind", {"value": "depth"}, "depth"), ("kind", {"value": "else"}, None),
     ("kind", {"value": ["depth"]}, None), ("box", {"value": False}, False), ("box", {"value": 1}, None),
     ("unknown", {"value": 1}, None), (["rate"], {"value": 3}, None), ("rate", [], None)],
)  # fmt: skip
def test_controls_take_what_they_offer(uuid, updates, value):
    message = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}
    found = fitting(message, CONTROLS)
    assert found == (None if value is None else message | {"updates": {"value": value}})


@pytest.mark.parametrize(
    "kind",
    ["ShareUrlRequest", "FileTransferStartUpload", "RunJavascriptMessage", "GetRenderResponseMessage",
     "SceneNodeUpdateMessage", ["ViewerCameraMessage"], None, 3],
)  # fmt: skip
def test_other_messages_are_not_heard(kind):
    assert fitting(CAMERA | {"type": kind}, CONTROLS) is None


ANY = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=4)
    | st.binary(max_size=4),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)


@given(st.sampled_from(sorted(FIELDS)), st.data())
def test_whatever_is_said_gives_bounded_numbers_or_nothing(kind, data):
    good = {"ViewerCameraMessage": CAMERA, "ScenePointerMessage": CLICK, "SceneNodeClickMessage": NODE}.get(
        kind, {"type": kind, "uuid": "rate", "updates": {"value": 3}}
    )
    changed = data.draw(st.sampled_from(sorted(good)))
    found = fitting(good | {changed: data.draw(ANY)}, CONTROLS)
    assert all(math.isfinite(number) and abs(number) <= 2**31 for number in numbers(found))
    if found and kind == "ViewerCameraMessage":
        assert OPENING[0] <= found["fov"] <= OPENING[1] and max(map(abs, found["position"])) <= FAR_M
    assert fitting(data.draw(ANY), CONTROLS) is None


def numbers(value):
    if isinstance(value, dict):
        value = tuple(value.values())
    if isinstance(value, tuple | list):
        return [number for inner in value for number in numbers(inner)]
    return [value] if isinstance(value, int | float) else []
