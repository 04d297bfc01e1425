"""One line for a whole run on a terminal, the log elsewhere."""

from __future__ import annotations

import io
import re
import sys

import pytest
from rich.console import Console

from room2dgs import cli
from room2dgs.commands.progress_line import ProgressLine, time_left
from room2dgs.pipeline.progress import Progress


@pytest.mark.parametrize("width", [50, 80, 200])
def test_the_line_has_share_time_and_words_on_terminals_of_any_width(width):
    now = [0.0]
    progress = Progress(lambda: now[0])
    progress.expect({"read": 10.0, "train": 190.0})
    progress.begin("train")
    now[0] = 50.0
    progress.tell("iteration 500/1000: loss")
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
    line = ProgressLine(progress, console)
    console.print(line._line.get_renderable())
    (shown,) = console.file.getvalue().splitlines()
    assert shown.startswith(" 50% ") and "0:50 left" in shown and "train" in shown and len(shown) <= width


def test_warnings_stand_above_the_line_and_details_in_the_log_alone():
    console = Console(file=io.StringIO(), width=80)
    line = ProgressLine(Progress(), console)
    line.log("7439 points")
    line.log("WARNING: [bold]few\x1b photos")
    assert console.file.getvalue() == "WARNING: [bold]few\\x1b photos\n"


@pytest.mark.parametrize(
    ("seconds", "text"), [(None, "-:-- left"), (4.6, "0:05 left"), (125, "2:05 left"), (3725, "1h02 left")]
)
def test_time_left_in_words(seconds, text):
    assert time_left(seconds) == text


SMALL = ("preset=sketch", "export.textured=false", "report.enabled=false", "eval.samples=500", "scene.image_width=64")


@pytest.mark.parametrize("how", [None, "full", "line"])
def test_a_run_ends_with_its_last_three_lines(wall, tmp_path, capsys, monkeypatch, how):
    out = tmp_path / "run"
    monkeypatch.setattr(sys.stdout, "isatty", lambda: False)
    code = cli.main(["run", str(wall), f"out={out}", *SMALL, *([f"log={how}"] if how else [])])
    said = capsys.readouterr()
    assert code == 0, said.err
    *before, verdict, look, step = said.out.splitlines()
    assert re.fullmatch(r"verdict: \w+; F-score @ 5 cm [01]\.\d{3}", verdict)
    assert look.startswith("look at: ") and step.startswith("next: ")
    details = [line for line in (out / "log.txt").read_text().splitlines() if line.startswith("mesh: ")]
    assert details
    assert all(line in before for line in details) == (how != "line")


def test_an_unknown_way_to_log_is_refused(wall, tmp_path, capsys):
    assert cli.main(["run", str(wall), f"out={tmp_path / 'run'}", "log=loud"]) == 2
    assert "log=loud is not known; choose from full, line" in capsys.readouterr().err
