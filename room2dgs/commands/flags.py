"""Flags of a command line for the fields of a dataclass."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import fields


def add_flags(parser: argparse.ArgumentParser, options: type, helps: Mapping[str, str]) -> None:
    """A flag for each field of a dataclass, of the type of its default; one that is false is set by its flag alone."""
    for option in fields(options):
        flag = "--" + option.name.replace("_", "-")
        if isinstance(option.default, bool):
            parser.add_argument(flag, action="store_true", help=helps[option.name])
        else:
            parser.add_argument(flag, type=type(option.default), default=option.default, help=helps[option.name])
