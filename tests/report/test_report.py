"""Tables and pages: text is escaped in each format, pages need no network."""

from __future__ import annotations

import re

import numpy as np
import pytest
from jinja2 import UndefinedError

from room2dgs.report.page import data_uri, page
from room2dgs.report.table import markdown, table, terminal

LONG = "without the depth prior, and without the seeds that it gives; a sentence as long as those of the studies are"
ROWS = [("a|b", "1.50"), ("<i>", "2,000")]


@pytest.fixture
def one():
    return table("Scores & costs", {"row": lambda row: row[0], "value": lambda row: row[1]}, ROWS)


def test_numbers_stay_as_they_are_written(one):
    assert markdown(one).splitlines() == [
        "**Scores & costs**", "", "| row | value |", "|-------|---------|", "| a\\|b | 1.50 |", "| <i> | 2,000 |",
    ]  # fmt: skip
    assert "│ <i>   │   2,000 │" in terminal(one)


def test_a_table_without_rows_has_its_heading():
    assert "| row | value |" in markdown(table("", {"row": str, "value": str}, []))


def test_pages_escape_text_and_hold_their_pictures(one):
    values = {"command": "run <x>", "label": "l", "drawing": np.zeros((4, 4, 3)), "table": one, "sentences": ["a < b"]}
    text = page("curve.html.j2", title="A & B", **values)
    assert "<title>A &amp; B</title>" in text and "run &lt;x&gt;" in text and "a &lt; b" in text
    assert "<td>&lt;i&gt;</td>" in text and "Scores &amp; costs" in text
    assert re.findall('src="([^"]*)"', text) == [data_uri(np.zeros((4, 4, 3)))]


def test_long_cells_and_tables_are_whole():
    long = table("", {"row": str, "words": lambda _: LONG}, range(100))
    values = {"command": "", "label": "", "drawing": np.zeros((4, 4, 3)), "table": long, "sentences": []}
    assert page("curve.html.j2", title="", **values).count(LONG) == markdown(long).count(LONG) == 100


def test_a_value_that_a_template_lacks_is_an_error():
    with pytest.raises(UndefinedError, match="title"):
        page("curve.html.j2")
