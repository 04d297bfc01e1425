"""What browsers say, checked before the server hears it: known messages with values that can be; nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

Fit = Callable[[Any], Any]  # a value, made to fit; None: it does not

LONGEST = 64 * 1024  # bytes of a message; a camera takes 300
FAR_M = 1e6
OPENING = 0.01, 3.0  # radians
PIXELS = 1, 16_384
QUATERNION = 0.5, 2.0  # its length
TEXT = 300


def fitting(message: Any, controls: Mapping[str, Fit]) -> dict[str, Any] | None:
    """A message with its known fields alone, their values bounded; None: it is to be ignored.

    Args:
        message: as it was decoded.
        controls: what a control's value may be, by the control's number.
    """
    kind = message.get("type") if isinstance(message, dict) else None
    if not isinstance(kind, str) or kind not in FIELDS:
        return None
    if kind == "GuiUpdateMessage":
        return _of_control(message, controls)
    found = {name: fit(message.get(name)) for name, fit in FIELDS[kind].items()}
    if any(value is None for name, value in found.items() if name not in MAY_BE_NONE):
        return None
    return {**found, "type": kind}


def one_of(values: Callable[[], tuple]) -> Fit:
    """Of a list to choose from, which may grow."""
    return lambda value: value if isinstance(value, str) and value in values() else None


def whole(low: int, high: int) -> Fit:
    """A number, brought between two."""
    return lambda value: round(min(max(value, low), high)) if _is_number(value) else None


def between(low: float, high: float) -> Fit:
    """The same, and not made whole."""
    return lambda value: float(min(max(value, low), high)) if _is_number(value) else None


def pair(low: float, high: float) -> Fit:
    """Two numbers between two, the smaller first."""

    def fit(value: Any) -> tuple[float, float] | None:
        if not isinstance(value, list | tuple) or len(value) != 2 or not all(map(_is_number, value)):
            return None
        one, other = sorted(float(min(max(number, low), high)) for number in value)
        return one, other

    return fit


def switch(value: Any) -> bool | None:
    """True or false."""
    return value if isinstance(value, bool) else None


def _of_control(message: dict, controls: Mapping[str, Fit]) -> dict[str, Any] | None:
    uuid, updates = message.get("uuid"), message.get("updates")
    if not isinstance(uuid, str) or uuid not in controls or not isinstance(updates, dict) or set(updates) != {"value"}:
        return None
    value = controls[uuid](updates["value"])
    return None if value is None else {"uuid": uuid, "updates": {"value": value}, "type": "GuiUpdateMessage"}


def _vector(count: int, shortest: float = 0.0, longest: float = math.inf) -> Fit:
    def fit(value: Any) -> tuple[float, ...] | None:
        if not isinstance(value, list | tuple) or len(value) != count or not all(map(_is_number, value)):
            return None
        found = tuple(map(float, value))
        fits = max(map(abs, found)) <= FAR_M and shortest <= math.hypot(*found) <= longest
        return found if fits else None

    return fit


def _screen_positions(value: Any) -> tuple | None:
    """On the screen: one or two."""
    pair = _vector(2)
    found = tuple(map(pair, value)) if isinstance(value, list | tuple) and 1 <= len(value) <= 2 else (None,)
    return None if None in found else found


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) and len(value) <= TEXT else None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


RAY = {"ray_origin": _vector(3), "ray_direction": _vector(3, 1e-6), "modifier": _text}
FIELDS: dict[str, dict[str, Fit]] = {
    "ViewerCameraMessage": {
        "wxyz": _vector(4, *QUATERNION),
        "position": _vector(3),
        "fov": between(*OPENING),
        "near": between(0.0, FAR_M),
        "far": between(0.0, FAR_M),
        "image_height": whole(*PIXELS),
        "image_width": whole(*PIXELS),
        "look_at": _vector(3),
        "up_direction": _vector(3),
    },
    "ScenePointerMessage": {"event_type": one_of(lambda: ("click",)), "screen_pos": _screen_positions, **RAY},
    "SceneNodeClickMessage": {
        "name": _text,
        "instance_index": whole(0, 2**31),
        "screen_pos": _vector(2),
        "owner": _text,
        **RAY,
    },
    "GuiUpdateMessage": {},  # as its control has it
}
MAY_BE_NONE = ("modifier", "instance_index")
