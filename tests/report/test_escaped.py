"""Names that somebody else gave are text at every door out: pages, tables, files for other programs."""

from __future__ import annotations

import csv
import io
import re

import pandas as pd
import pytest

from room2dgs.report.csv_text import as_csv_text, csv_lines
from room2dgs.report.page import drawn, in_drawing, page
from room2dgs.report.table import Table, markdown, table, terminal
from room2dgs.study.score_table import Score, as_csv, as_html, as_latex, as_markdown

HOSTILE = 'a\x1b[31m<script>alert(1)</script>|,"b\n% \\input{x}.jpg'
ESCAPED = 'a\\x1b[31m<script>alert(1)</script>|,"b\\n% \\input{x}.jpg'
FIGURES = {"accuracy_m": 0.05, "completion_m": 0.1, "precision": 0.6, "recall": 0.5, "f_score": 0.55}
SCORES = [Score(HOSTILE, "scene", FIGURES), Score("other", HOSTILE, {}, f"{HOSTILE} is empty")]


def clean(text: str) -> None:
    assert all(letter.isprintable() or letter == "\n" for letter in text)


@pytest.fixture
def one() -> Table:
    return table(HOSTILE, {"photo": lambda name: name, HOSTILE: lambda name: "1.5"}, [HOSTILE])


def test_tables_of_text_have_one_line_a_row(one):
    text = markdown(one)
    clean(text)
    *_, heading, _, row = text.splitlines()
    for line, cells in ((heading, 2), (row, 2)):
        assert len(re.findall(r"(?<!\\)\|", line)) == cells + 1
    assert ESCAPED.replace("|", "\\|") in row and ESCAPED.replace("|", "\\|") in heading
    clean(terminal(one))
    assert ESCAPED in terminal(one) and len(terminal(one).splitlines()) == 6


def test_a_page_shows_a_name_and_runs_nothing(one):
    text = page(
        "bench_prior.html.j2", title=HOSTILE, sentences=[HOSTILE], tables=[one], notes=[HOSTILE], scenes=[], scale="",
        tile_width=1,
    )  # fmt: skip
    assert "<script" not in text and "\x1b" not in text
    safe = "a\\x1b[31m&lt;script&gt;alert(1)&lt;/script&gt;|,"
    assert text.count(safe) == 8  # title and heading, sentence, caption, its label and two cells, note
    settings = page(
        "depth.html.j2", title="", opening="", facts=[], warnings=[], tables=[], advice="", keys=[], pictured=[],
        photos=one, changed=one, settings=f"scene:\n  path: {HOSTILE!r}\n", closing="",
    )  # fmt: skip
    assert "<pre>scene:\n  path: " in settings and "<script" not in settings


def test_csv_keeps_each_name_in_one_cell_and_no_program_works_it_out():
    rows = [("view", "scale"), (HOSTILE, "-0.5"), ("=1+1", 2.5), ("@x", "+3"), ("-y.jpg", "-"), ("\t=z", "")]
    text = csv_lines(rows)
    clean(text)
    back = list(csv.reader(io.StringIO(text)))
    assert back[1] == [ESCAPED, "-0.5"] and len(text.splitlines()) == len(rows)
    assert back[2:] == [["'=1+1", "2.5"], ["'@x", "+3"], ["'-y.jpg", "-"], ["\\t=z", ""]]
    frame = as_csv_text(pd.DataFrame([{"=name": HOSTILE, "value": -0.5}]))
    assert list(csv.reader(io.StringIO(frame))) == [["'=name", "value"], [ESCAPED, "-0.5"]]


def test_tables_of_scores_escape_methods_and_scenes():
    for text in (as_csv(SCORES), as_markdown(SCORES, HOSTILE), as_html(SCORES, HOSTILE), as_latex(SCORES, HOSTILE)):
        clean(text)
    assert next(csv.DictReader(io.StringIO(as_csv(SCORES))))["method"] == ESCAPED
    assert "<script" not in as_html(SCORES, HOSTILE)
    latex = as_latex(SCORES, HOSTILE)
    assert "\\textbackslash{}input\\{x\\}" in latex
    for line in latex.splitlines():  # what is not escaped stands behind a comment's sign
        assert "\\input" not in line or line.startswith("% ")


def test_a_name_in_a_drawing_is_no_mathematics():
    from matplotlib.figure import Figure

    figure = Figure()
    figure.suptitle(in_drawing("room $\\no{such}$ \x1b of ${out}"))
    assert drawn(figure, dpi=20).ndim == 3
