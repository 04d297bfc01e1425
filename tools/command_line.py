"""What the tools' command lines have in common."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import wraps

from room2dgs.errors import InputError

Main = Callable[[list[str] | None], int]


def command_line(name: str) -> Callable[[Callable[[list[str] | None], None]], Main]:
    """Makes a tool's `main` of what it does with its arguments: bad input is told in one line.

    Returns:
        A decorator; the decorated function returns the exit code (0 done, 2 bad input, 130 interrupted).
    """

    def decorate(body: Callable[[list[str] | None], None]) -> Main:
        @wraps(body)
        def main(arguments: list[str] | None = None) -> int:
            try:
                body(arguments)
            except InputError as error:
                print(f"{name}: {error}", file=sys.stderr)
                return 2
            except KeyboardInterrupt:
                return 130
            return 0

        return main

    return decorate


def add_fields(parser: argparse.ArgumentParser, options: type, helps: Mapping[str, str]) -> None:
    """A flag for each field of a dataclass, of the type of its default; one that is false is set by its flag alone."""
    for option in fields(options):
        flag = "--" + option.name.replace("_", "-")
        if isinstance(option.default, bool):
            parser.add_argument(flag, action="store_true", help=helps[option.name])
        else:
            parser.add_argument(flag, type=type(option.default), default=option.default, help=helps[option.name])
