"""The settings as help: every key with its value and what it means."""

from __future__ import annotations

from typing import Any

from omegaconf import OmegaConf

from room2dgs.config import conf_dir
from room2dgs.config.composing import composed
from room2dgs.config.keys import leaf_keys
from room2dgs.config.overrides import group_choices
from room2dgs.config.sentences import shown


def asked_for_help(argv: list[str]) -> bool:
    """Whether -h or --help is among the arguments."""
    return "-h" in argv or "--help" in argv


def show(usage: str, what: str | None, sections: tuple[str, ...] = ()) -> int:
    """Print usage and settings (those of `sections`, or all) and return the exit code 0."""
    print(usage)
    print(f"\n{what}\n")
    print("\n".join(settings(sections)))
    return 0


def settings(sections: tuple[str, ...] = ()) -> list[str]:
    """A line for each setting, grouped as the configuration is: key, default, meaning."""
    defaults = _defaults()
    choices = group_choices(conf_dir())
    lines: list[str] = []
    previous = ""
    for key in leaf_keys():
        section = key.name.partition(".")[0] if "." in key.name else ""
        if section and sections and section not in sections:
            continue
        if section != previous:
            names = choices.get(section, [])
            lines += ["", f"{section}  (files: {', '.join(names)})" if names else section]
            nested = {group: names for group, names in choices.items() if group.startswith(section + "/")}
            lines += [f"  {group}={'|'.join(names)}" for group, names in nested.items() if section]
            previous = section
        value = shown(defaults.get(key.name))
        lines.append(f"  {key.name + '=' + value:<44} {key.comment}".rstrip())
    return lines


def _defaults() -> dict[str, Any]:
    """Dotted key -> value of the default configuration, unset ones left out."""
    tree = OmegaConf.to_container(composed(()))
    flat: dict[str, Any] = {}
    _flatten("", tree, flat)
    return {key: value for key, value in flat.items() if value != "???"} | {
        key: "DIR" for key, value in flat.items() if value == "???"
    }


def _flatten(prefix: str, tree: Any, into: dict[str, Any]) -> None:
    if isinstance(tree, dict):
        for key, value in tree.items():
            _flatten(f"{prefix}.{key}" if prefix else str(key), value, into)
    else:
        into[prefix] = tree
