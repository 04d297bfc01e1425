"""What the tools' command lines have in common."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from typing import Protocol

from room2dgs.errors import InputError, RunFailed

Body = Callable[[list[str]], int | None]


class Main(Protocol):
    """A tool's entry: its arguments, or those of the process, to its exit code."""

    def __call__(self, arguments: list[str] | None = None) -> int: ...


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
