"""Comma lists in settings: every combination of them, as Hydra's basic sweeper makes them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException

from room2dgs.config.keys import path_keys


@dataclass(frozen=True)
class Combination:
    """One choice from every list.

    Attributes:
        overrides: "KEY=VALUE" each, no list of choices among them.
        chosen: key -> value of what was a list of two or more.
    """

    overrides: tuple[str, ...]
    chosen: dict[str, str]


def combinations(overrides: Iterable[str]) -> list[Combination]:
    """The product of all lists of choices (`a,b`, `range(0,3)`); the first key changes slowest.

    A key that comes again takes the place of the earlier one. Paths are taken as they stand, commas and all, and
    so is what Hydra cannot read: `load_config` says what is wrong with it.
    """
    choices: dict[str, list[str]] = {}
    for text in overrides:
        choices[text.partition("=")[0]] = _choices(text)
    return [
        Combination(
            tuple(texts),
            {key: text.partition("=")[2] for key, text in zip(choices, texts, strict=True) if len(choices[key]) > 1},
        )
        for texts in itertools.product(*choices.values())
    ]


def _choices(text: str) -> list[str]:
    key, equals, _ = text.partition("=")
    if not equals or key in path_keys():
        return [text]
    try:
        override = OverridesParser.create().parse_override(text)
        if not override.is_sweep_override():
            return [text]
        return list(dict.fromkeys(f"{key}={value}" for value in override.sweep_string_iterator()))
    except HydraException:
        return [text]
