"""Errors that are no fault of the program."""

from __future__ import annotations

from room2dgs.texts import shown


class InputError(ValueError):
    """Something that the user gave cannot be used.

    The message is one sentence that names the file (or the setting) and says what to do.
    The command line prints it alone, without a traceback, and exits with 2. Names in it may be anybody's: control
    characters are shown escaped (`room2dgs.texts.shown`).
    """

    def __init__(self, message: object) -> None:
        super().__init__(shown(message))


class RunFailed(Exception):
    """A run that was started for a study or a sweep failed.

    Attributes:
        why: one line.
        code: the exit code of its cause: 2 bad input, 1 our fault, 128 + n killed by signal n.
    """

    def __init__(self, why: str, code: int) -> None:
        super().__init__(why, code)
        self.why = why
        self.code = code

    def __str__(self) -> str:
        return self.why


def first_line(error: BaseException) -> str:
    """What an error says first, without the point at its end; its type if it says nothing."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines or [type(error).__name__])[0].rstrip(".;")
