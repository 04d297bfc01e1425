"""Lists of scenes that papers use: conf/_scenes, a name for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import yaml

from room2dgs.config import conf_dir
from room2dgs.errors import InputError

FOLDER = "_scenes"
LIST, ROOT = "scenes", "root"


def expanded(argv: Sequence[str]) -> list[str]:
    """Arguments with `scenes=NAME root=DIR` as the captures and settings that they stand for.

    The list's settings come first: what the user gives has the last word.

    Raises:
        InputError: no such list, or one of the two without the other.
    """
    given = {key: value for key, _, value in (text.partition("=") for text in argv) if key in (LIST, ROOT)}
    if not given:
        return list(argv)
    name, root = given.get(LIST), given.get(ROOT)
    if not name or not root:
        raise InputError(f"scenes=NAME and root=DIR go together; the lists are {', '.join(lists())}")
    if name not in lists():
        raise InputError(f"scenes={name} is not known; choose from {', '.join(lists())}")
    one = yaml.safe_load((conf_dir() / FOLDER / f"{name}.yaml").read_text(encoding="utf-8"))
    rest = [text for text in argv if text.partition("=")[0] not in (LIST, ROOT)]
    keys = {text.partition("=")[0] for text in rest}
    settings = [text for text in one["settings"] if text.partition("=")[0] not in keys]
    return [*(str(Path(root).expanduser() / scene) for scene in one["scenes"]), *settings, *rest]


def lists() -> list[str]:
    """Their names."""
    return sorted(path.stem for path in (conf_dir() / FOLDER).glob("*.yaml"))
