"""What the tools' command lines have in common."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import wraps

from room2dgs.errors import InputError, RunFailed

Body = Callable[[list[str]], int | None]
Main = Callable[[list[str] | None], int]


def command_line(name: str) -> Callable[[Body], Main]:
    """Makes a tool's `main` of a function of its arguments, which may return an exit code: bad input is one sentence.

    Returns:
        A decorator. The decorated function takes sys.argv's arguments when it is given none, and returns the exit code:
        the body's own, 0 done, 2 bad input, 130 interrupted, or that of the first run that failed.
    """

    def decorate(body: Body) -> Main:
        @wraps(body)
        def main(arguments: list[str] | None = None) -> int:
            try:
                return body(sys.argv[1:] if arguments is None else list(arguments)) or 0
            except InputError as error:
                print(f"{name}: {error}", file=sys.stderr)
                return 2
            except RunFailed as error:
                print(f"{name}: a run failed: {error}", file=sys.stderr)
                return error.code
            except KeyboardInterrupt:
                return 130

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
