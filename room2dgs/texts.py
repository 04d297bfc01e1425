"""Text from outside, escaped for a terminal, a log and a table."""

from __future__ import annotations

from collections.abc import Sequence

LONGEST = 300  # characters of one name


def shown(text: object, longest: int | None = None) -> str:
    r"""What a person may be shown of a text that somebody else wrote: control characters, escape codes, line breaks
    and what turns the direction of writing become `\x1b`, `\n`, `\u202e`; letters of all languages stay.

    Args:
        longest: characters; what is longer is cut and ends in "...". None: all of it.
    """
    text = "".join(letter if letter == " " or letter.isprintable() else _escaped(letter) for letter in str(text))
    return text if longest is None or len(text) <= longest else f"{text[: longest - 3]}..."


def shown_name(name: object) -> str:
    """The same for a file's name or a key, cut at `LONGEST` characters."""
    return shown(name, LONGEST)


def some_of(names: Sequence[str]) -> str:
    """The first five, and how many more."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def _escaped(letter: str) -> str:
    short = {"\n": "\\n", "\r": "\\r", "\t": "\\t"}.get(letter)
    code = ord(letter)
    if short:
        return short
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
