"""Arguments of a command that are no settings."""

from __future__ import annotations

from collections.abc import Sequence

from room2dgs.errors import InputError


def own_arguments(argv: Sequence[str], names: Sequence[str]) -> tuple[dict[str, str], list[str]]:
    """The named arguments as name -> value, the last of several, and all others as they are."""
    own: dict[str, str] = {}
    rest = []
    for argument in argv:
        key, equals, value = argument.partition("=")
        if equals and key in names:
            own[key] = value
        else:
            rest.append(argument)
    return own, rest


def whole_number(own: dict[str, str], name: str, default: int, least: int, most: int) -> int:
    """A whole number among the arguments.

    Raises:
        InputError: it is none, or out of its bounds.
    """
    if name not in own:
        return default
    text = own[name]
    if not text.isascii() or not text.isdigit() or not least <= int(text) <= most:
        raise InputError(f"{name}={text} is impossible; give a whole number from {least} to {most}")
    return int(text)


def choices(own: dict[str, str], name: str, default: str, known: Sequence[str]) -> tuple[str, ...]:
    """Names separated by commas.

    Raises:
        InputError: one is not known, or there is none.
    """
    chosen = tuple(dict.fromkeys(part.strip() for part in own.get(name, default).strip("[]").split(",")))
    for part in chosen:
        if part not in known:
            raise InputError(f"{name}={own.get(name)} is not known; choose from {', '.join(known)}")
    return chosen
