"""A folder or file as the first word behind a command, without the key that it stands for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from room2dgs.captures.listing import VIDEO_SUFFIXES
from room2dgs.config.keys import leaf_keys
from room2dgs.errors import InputError
from room2dgs.runs.folder import CONFIG

MESHES = (".ply", ".obj", ".off", ".stl", ".glb")
OF_CAPTURES = ("run", "train", "depth", "ablate")
OF_RUNS = ("mesh", "eval", "render", "view", "report", "export", "plan", "measure", "scale", "open")
OF_FOOTAGE = ("prepare",)
OUT_IS_ELSEWHERE = ("export", "plan")  # to others it is the run
# names for the same thing: given beside the word they contradict it
SAME = {
    "scene.path": ("scene.path", "video", "images", "prepare.video", "prepare.images"),
    "video": ("scene.path", "video", "images", "prepare.video", "prepare.images"),
    "images": ("video", "images", "prepare.video", "prepare.images"),
    "run": ("run", "out"),
    "out": ("out",),
    "pred": ("pred", "eval.pred"),
}


def with_first_word(verb: str, rest: Sequence[str]) -> list[str]:
    """What follows a command, with a key before a first word that has none.

    Raises:
        InputError: the same is given by its key, too.
    """
    if not rest or not _is_place(rest[0]):
        return list(rest)
    word, *others = rest
    key = _key(verb, Path(word).expanduser())
    if key is None:
        return list(rest)
    same = {*SAME[key]} - ({"out"} if verb in OUT_IS_ELSEWHERE else set())
    twice = next((text for text in others if text.partition("=")[0] in same), None)
    if twice:
        raise InputError(f"{word} and {twice} both say what {verb} works on; leave one out")
    return [f"{key}={word}", *others]


def _is_place(word: str) -> bool:
    if word.startswith("-") or not word:
        return False
    if Path(word).expanduser().exists():
        return True
    return "=" not in word and not any(word in (key.name, key.name.partition(".")[0]) for key in leaf_keys())


def _key(verb: str, path: Path) -> str | None:
    """What a path is to a command; None: it takes words as they are."""
    is_file = path.is_file()
    if verb == "eval" and is_file and path.suffix.lower() in MESHES:
        return "pred"
    if verb in OF_RUNS:
        return "run"
    is_video = is_file and path.suffix.lower() in VIDEO_SUFFIXES
    if verb in OF_FOOTAGE:
        return "video" if is_video else "images"
    if verb == "run" and is_video:
        return "video"
    if verb in OF_CAPTURES:
        return "out" if (path / CONFIG).is_file() else "scene.path"
    return None
