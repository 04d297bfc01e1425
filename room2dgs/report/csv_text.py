"""CSV that programs read back and tables do not run: names in it may be anybody's."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from typing import Any

import pandas as pd

from room2dgs.texts import shown

FORMULA = ("=", "+", "-", "@")  # a table's program takes text that begins so for something to work out


def cell(value: Any) -> Any:
    """Numbers as they are; text on one line, with control characters escaped and an apostrophe before a formula."""
    if not isinstance(value, str):
        return value
    text = shown(value)
    return f"'{text}" if text.startswith(FORMULA) and not _is_number(text) else text


def csv_lines(rows: Iterable[Iterable[Any]]) -> str:
    """Rows of cells, the headings first, as the text of a CSV file."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([cell(one) for one in row] for row in rows)
    return text.getvalue()


def as_csv_text(frame: pd.DataFrame) -> str:
    """A table without its index as the text of a CSV file."""
    return frame.map(cell).rename(columns=cell).to_csv(index=False)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == "-"  # a cell without a value
    return True
