"""The bar of a training on terminals of every width."""

from __future__ import annotations

import io

import pytest
from rich.console import Console
from rich.progress import Progress

from room2dgs.train.progress import columns

FIGURES = "loss 0.1234 (rgb 0.0812, depth_prior 0.0155, normal_prior 0.0015), PSNR 16.66 dB, 127,120 surfels"


@pytest.mark.parametrize("width", [60, 80, 100, 200])
def test_bar_count_and_time_are_whole_on_one_line(width):
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
    progress = Progress(*columns(), console=console, expand=True)
    progress.add_task("training", total=30_000, completed=12_340, figures=FIGURES)
    console.print(progress.get_renderable())
    (line,) = console.file.getvalue().splitlines()
    done = 8  # of the 20 letters of the bar; the others are blank without colours
    assert line.startswith("━" * done + " " * (21 - done) + "12340/30000 -:--:-- loss 0.1")
    assert (FIGURES in line) == (width == 200)
