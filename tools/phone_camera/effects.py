"""The effects by name."""

from __future__ import annotations

from collections.abc import Iterable

from room2dgs.errors import InputError

# of one photo alone
OF_PHOTO = {
    "vignette": "corners darker than the middle",
    "noise": "shot and read noise",
    "smear": "noise reduction: fine texture smeared, colours washed over edges",
    "tone": "local tone mapping: dark places lifted, bright ones lowered",
    "response": "the phone's own curve from light to levels, and its saturation",
    "sharpening": "sharpening, with light and dark halos along edges",
    "jpeg": "compression as phones do it",
}
# of the photos of a walk together
OF_WALK = {
    "wander": "exposure and white balance wander from photo to photo",
    "blur": "motion during the exposure",
    "rolling": "rolling shutter: lower rows are later",
    "breathing": "autofocus changes the focal length from photo to photo",
    "drift": "poses drift and jump as a tracker's",
}
EFFECTS = OF_WALK | OF_PHOTO
ALL = frozenset(EFFECTS)


def chosen(text: str) -> frozenset[str]:
    """The effects of "all", "none", "wander,blur", or "all,-drift".

    Raises:
        InputError: an effect that is none.
    """
    found: set[str] = set()
    for word in filter(None, text.split(",")):
        names = _named(word.removeprefix("-"), text)
        found = found - names if word.startswith("-") else found | names
    return frozenset(found)


def spelled(effects: Iterable[str]) -> str:
    """What `chosen` reads as these effects."""
    found = set(effects)
    return "all" if found == ALL else ",".join(name for name in EFFECTS if name in found) or "none"


def _named(word: str, text: str) -> set[str]:
    if word in ("all", "none"):
        return set(ALL) if word == "all" else set()
    if word not in EFFECTS:
        raise InputError(
            f"--phone {text} names {word}, which is no effect; give all, none or some of {', '.join(EFFECTS)}"
        )
    return {word}
