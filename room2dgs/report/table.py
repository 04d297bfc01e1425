"""Tables of text cells, for Markdown, HTML and the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, TypeVar

import pandas as pd

from room2dgs.texts import shown

NOTHING = "-"  # a cell without a value
Item = TypeVar("Item")


class Table(NamedTuple):
    """A title and cells as text; the first column names the row."""

    title: str
    frame: pd.DataFrame


def table(title: str, columns: Mapping[str, Callable[[Item], str]], items: Iterable[Item]) -> Table:
    """A row for each item.

    Args:
        columns: heading -> cell of an item.
    """
    rows = [[cell(item) for cell in columns.values()] for item in items]
    return Table(title, pd.DataFrame(rows, columns=list(columns), dtype=str))


def markdown(one: Table) -> str:
    """The table with its title, if it has one, in bold above it."""
    escaped = one.frame.map(in_markdown).rename(columns=in_markdown)
    text = escaped.to_markdown(index=False, tablefmt="pipe", disable_numparse=True, stralign=None)
    return f"**{in_markdown(one.title)}**\n\n{text}" if one.title else text


def terminal(one: Table) -> str:
    """The table with lines around its cells; numbers are flush right."""
    align = ["left", *["right"] * (one.frame.shape[1] - 1)]
    text = (
        one.frame.map(shown)
        .rename(columns=shown)
        .to_markdown(index=False, tablefmt="simple_outline", disable_numparse=True, colalign=align)
    )
    return f"{shown(one.title)}\n{text}"


def in_markdown(text: str) -> str:
    """Text of anybody's inside Markdown, in a cell or a line: no other cell, no line break, no control character."""
    return shown(text).replace("|", "\\|")
