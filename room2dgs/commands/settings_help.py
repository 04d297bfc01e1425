"""Help of a command: its usage, what it does, and its settings with their defaults."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator, Sequence

from room2dgs.config import conf_dir
from room2dgs.config.defaults import NOT_GIVEN
from room2dgs.config.fields import SHARE
from room2dgs.config.keys import Key, leaf_keys
from room2dgs.config.overrides import group_choices
from room2dgs.config.sentences import shown

COLUMNS, KEYS = 100, 34  # of a line, and of "key=default" at its beginning
HEADING = "Settings:"
PRESETS = ("sketch", "draft", "quick", "default", "fine")
EVERYTHING = "all"  # behind --help: the settings for experts, too
# What a command that takes all settings shows first
FIRST = (
    *("out", "resume", "strict", "prepare.video", "prepare.images", "prepare.length", "scene.path", "scene.frames"),
    *("scene.image_width", "scene.unit", "sfm.refine_poses", "render.device", "render.threads", "train.iterations"),
    *("train.viewer", "mesh.source", "mesh.voxel_m", "mesh.fill", "eval.gt", "report.enabled", "export.after_run"),
    "memory.cache_mb",
)


def asked_for_help(argv: Sequence[str]) -> bool:
    """Whether -h or --help is among the arguments."""
    return "-h" in argv or "--help" in argv


def show(argv: Sequence[str], usage: str, what: str | None, sections: tuple[str, ...] = ()) -> int:
    """Print usage and settings (those of `sections`, or all) and return the exit code 0.

    Args:
        argv: of the command; `--help all` shows all settings, those for experts too.
    """
    print(usage)
    print(f"\n{filled(what or '')}\n")
    print("\n".join(settings(argv, sections)))
    return 0


def settings(argv: Sequence[str], sections: tuple[str, ...] = ()) -> list[str]:
    """The settings, grouped as the configuration is: key, default, meaning; see `show`."""
    keys = [key for key in leaf_keys() if not sections or _section(key) in ("", *sections)]
    listed = keys if EVERYTHING in argv else [key for key in keys if (key.public if sections else key.name in FIRST)]
    choices = group_choices(conf_dir())
    lines = [HEADING]
    if not sections:
        lines += _wrapped("preset=NAME", f"How fine the run is, from fast to slow: {', '.join(PRESETS)}.")
    previous = None
    for key in listed:
        section = _section(key)
        if section != previous:
            lines += ["", section] if section else []
            for name in [one for one in choices if section and one.partition("/")[0] == section]:
                lines += _wrapped(f"{name}=NAME", f"Chooses several at once: {', '.join(choices[name])}.")
            previous = section
        lines += _wrapped(f"{key.name}={'DIR' if key.default == NOT_GIVEN else shown(key.default)}", meaning(key))
    hidden = len(keys) - len(listed)
    return lines if not hidden else [*lines, "", f"{hidden} more: --help {EVERYTHING}"]


def meaning(key: Key) -> str:
    """What a setting decides, and what it takes where the sentence does not say it."""
    if SHARE in key.wants:
        return f"{key.comment} A number with a point is a share of train.iterations."
    unnamed = [choice for choice in key.choices if choice not in key.comment and choice not in ("true", "false")]
    return f"{key.comment} One of: {', '.join(key.choices)}." if unnamed else key.comment


def filled(text: str) -> str:
    """A docstring without its indentation, in lines of at most `COLUMNS`; lists and examples stay as they are."""
    return "\n\n".join(_paragraph(part) for part in inspect.cleandoc(text).split("\n\n"))


def _paragraph(text: str) -> str:
    lines = text.split("\n")
    if any(line.startswith(" ") for line in lines):
        return "\n".join(piece for line in lines for piece in _hanging(line))
    return textwrap.fill(text, COLUMNS, break_long_words=False, break_on_hyphens=False)


def _hanging(line: str) -> Iterator[str]:
    indent = " " * (len(line) - len(line.lstrip()))
    yield from textwrap.wrap(
        line.strip(), COLUMNS, initial_indent=indent, subsequent_indent=indent + "    ", break_long_words=False
    )


def _wrapped(left: str, right: str) -> list[str]:
    """A key and its sentences beside it, or below it where it is long."""
    margin = " " * (KEYS + 2)
    lines = textwrap.wrap(right, COLUMNS - len(margin), break_long_words=False, break_on_hyphens=False)
    beside = len(left) < KEYS
    first = [f"  {left:<{KEYS}}{lines[0]}"] if beside else [f"  {left}"]
    return [*first, *(margin + line for line in (lines[1:] if beside else lines))]


def _section(key: Key) -> str:
    return key.name.partition(".")[0] if "." in key.name else ""
