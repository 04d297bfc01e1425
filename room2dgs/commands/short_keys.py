"""Settings that a command knows by a short name too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from room2dgs.config import conf_dir
from room2dgs.config.overrides import group_choices

FOOTAGE = {"video": "prepare.video", "images": "prepare.images"}  # of which a capture is made first


def with_full_keys(argv: Sequence[str], short: Mapping[str, str]) -> list[str]:
    """Short names as the settings that they stand for; a choice of a group (`scene=default`) stays one.

    Args:
        argv: "KEY=VALUE" each.
        short: short name -> setting.
    """
    groups = group_choices(conf_dir())
    result = []
    for text in argv:
        key, equals, value = text.partition("=")
        is_group_choice = value in groups.get(key, ())
        result.append(f"{short[key]}={value}" if equals and key in short and not is_group_choice else text)
    return result
