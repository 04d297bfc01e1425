"""Generated pages of the documentation: `python -m room2dgs.tools.docs_reference` writes them to docs/reference.

`verbs.md` is what the verbs' own `--help` says, without the settings; `settings.md` are the fields of the settings;
`names.md` are all registries, name by name.
A test compares both with the files, so a page is never older than the code.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from room2dgs import cli, registries
from room2dgs.commands.settings_help import HEADING, meaning
from room2dgs.commands.verbs import VERBS
from room2dgs.config import conf_dir
from room2dgs.config.keys import Key, leaf_keys
from room2dgs.config.overrides import group_choices
from room2dgs.config.sentences import shown
from room2dgs.registry import Registry

REFERENCE = Path(__file__).resolve().parents[1] / "docs/reference"
MADE = "<!-- written by `python -m room2dgs.tools.docs_reference`; do not edit -->\n"
EXAMPLES = "\nExamples:"


def main(argv: list[str] | None = None) -> int:
    """Write the pages; 0."""
    argparse.ArgumentParser(prog="room2dgs.tools.docs_reference", description=__doc__).parse_args(argv)
    for name, page in pages().items():
        (REFERENCE / name).write_text(page, encoding="utf-8")
    return 0


def pages() -> dict[str, str]:
    """File name in docs/reference -> its text."""
    return {"verbs.md": verbs(), "settings.md": settings(), "names.md": names()}


def verbs() -> str:
    """A section for each verb: usage, what it does, examples."""
    lines = [
        MADE,
        "# Verbs\n",
        "Settings follow the verb as `KEY=VALUE`; [Settings](settings.md) has them all. `room2dgs VERB --help` prints "
        "this and the settings of the verb.\n",
        "| verb | what it does |\n|---|---|",
        *(f"| [`{verb}`](#{verb}) | {what} |" for verb, what in VERBS.items()),
    ]
    for verb in VERBS:
        lines += [f"\n## {verb}\n", "```text", _help(verb), "```"]
    return "\n".join(lines) + "\n"


def _help(verb: str) -> str:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        cli.main([verb, "--help"])
    text = said.getvalue()
    if text.startswith("usage:"):  # argparse's, whose look changes with Python: options stay with --help
        body, _, rest = text.partition("\n\n")[2].partition("\noptions:")
        body = body.partition("\npositional arguments:")[0]
        ends = rest[rest.find(EXAMPLES) :] if EXAMPLES in rest else ""
        text = f"{body}\n\nOptions: room2dgs {verb} --help\n{ends}"
    head, examples, tail = text.partition(EXAMPLES)
    kept = head.partition(f"\n{HEADING}\n")[0].rstrip() + ("\n" + examples + tail if examples else "")
    return re.sub(r"\n{3,}", "\n\n", kept).strip()


def settings() -> str:
    """A section for each group: its presets, a table of what everybody may set, and one for experts."""
    keys = leaf_keys()
    choices = group_choices(conf_dir())
    sections = dict.fromkeys(map(_section, keys))
    public = sum(key.public for key in keys)
    lines = [
        MADE,
        "# Settings\n",
        f"{public} settings are for everybody, {len(keys) - public} for experts. They follow a verb as `KEY=VALUE`. "
        "`--help` shows the first, `--help all` all of them. Types and bounds are checked before anything runs, and a "
        "wrong key is answered with the nearest right one.\n",
    ]
    for section in sections:
        own = [key for key in keys if _section(key) == section]
        lines.append(f"\n## {section or 'All verbs'}\n")
        groups = {name: presets for name, presets in choices.items() if name.partition("/")[0] == section}
        lines += [f"Presets of `{name}=`: {', '.join(presets)}.\n" for name, presets in groups.items()]
        lines += _table([key for key in own if key.public], "")
        experts = [key for key in own if not key.public]
        if experts:
            lines += [f'\n??? note "{section or "All verbs"}, for experts"\n', *_table(experts, "    ")]
    return "\n".join(lines) + "\n"


def _section(key: Key) -> str:
    return key.name.partition(".")[0] if "." in key.name else ""


def _table(keys: Sequence[Key], indent: str) -> list[str]:
    if not keys:
        return []
    rows = [f"| `{key.name}` | `{_default(key)}` | {meaning(key).replace('|', chr(92) + '|')} |" for key in keys]
    return [indent + line for line in ("| setting | default | meaning |", "|---|---|---|", *rows)]


def _default(key: Key) -> str:
    return "must be given" if key.default == "???" else shown(key.default)


def names() -> str:
    """A table for each registry: its names and their sentences."""
    lines = [
        MADE,
        "# Names\n",
        "What settings and verbs choose by name. Each list is a registry in `room2dgs/registries`, the only list of "
        "its kind; [Add a part](../contributing/add-a-part.md) shows how to add to one.",
    ]
    for module in sorted(one.name for one in iter_modules(registries.__path__)):
        found = import_module(f"{registries.__name__}.{module}")
        for registry in (one for one in vars(found).values() if isinstance(one, Registry)):
            meaning = " ".join((found.__doc__ or "").split("\n\n")[0].split())
            lines += [f"\n## {module.replace('_', ' ').capitalize()}\n", meaning, "\n| name | meaning |\n|---|---|"]
            lines += [
                f"| `{entry.name}` | {entry.description} |" for entry in registry.entries() if entry.package is None
            ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
