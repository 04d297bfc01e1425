"""Curves of a training, read from its log: they are there whether or not TensorBoard's files are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

STEP = re.compile(r"^iteration ([0-9]{1,12})/[0-9]+: (.*)$")
LOSS = re.compile(r"^loss ([\d.e+-]+|nan|inf) \((.*?)\)")
TRAIN_PSNR = re.compile(r"(?:^|, )PSNR ([\d.]+) dB")
TEST_PSNR = re.compile(r"^held-out PSNR ([\d.]+) dB")
COUNT = re.compile(r", (\d+) surfels")
COLORS = ("#1565c0", "#c2185b")
LEFT, RIGHT, TOP, BOTTOM = 56.0, 310.0, 10.0, 150.0  # of the drawing
LARGEST = 1e30
PSNR, HELD_OUT, SURFELS, WHOLE = "PSNR, dB", "held-out views", "surfels", "loss"

Line = dict[int, float]


def read_plots(log: Iterable[str]) -> dict[str, dict[str, Line]]:
    """Title -> line's name -> iteration -> value. Of an iteration that was done twice the last counts."""
    found: dict[str, dict[str, Line]] = {}

    def put(title: str, name: str, iteration: int, value: str) -> None:
        try:
            number = float(value)
        except ValueError:  # a line that is not ours
            return
        if abs(number) <= LARGEST:
            found.setdefault(title, {}).setdefault(name, {})[iteration] = number

    for line in log:
        step = STEP.match(line)
        if not step:
            continue
        iteration, text = int(step[1]), step[2]
        if test := TEST_PSNR.match(text):
            put(PSNR, HELD_OUT, iteration, test[1])
        if not (loss := LOSS.match(text)):
            continue
        put(WHOLE, "training", iteration, loss[1])
        for term in filter(None, loss[2].split(", ")):
            name, _, value = term.rpartition(" ")
            put(f"loss: {name}", "training", iteration, value)
        rest = text[loss.end() :]
        if psnr := TRAIN_PSNR.search(rest):
            put(PSNR, "training views", iteration, psnr[1])
        if count := COUNT.search(rest):
            put(SURFELS, "training", iteration, count[1])
    return found


def drawings(plots: Mapping[str, Mapping[str, Line]]) -> list[dict[str, Any]]:
    """For the template: titles, ends of the axes, and the lines' points."""
    drawn = []
    first = [title for title in (PSNR, WHOLE, SURFELS) if title in plots]
    for title in [*first, *(title for title in plots if title not in first)]:
        lines = plots[title]
        steps = [step for line in lines.values() for step in line]
        values = [value for line in lines.values() for value in line.values()]
        if len(set(steps)) < 2:
            continue
        low, high = min(values), max(values)
        drawn.append(
            {
                "title": title,
                "top": _number(high),
                "bottom": _number(low),
                "first": min(steps),
                "last": max(steps),
                "lines": [
                    {"name": name, "color": color, "points": _points(line, (min(steps), max(steps)), (low, high))}
                    for (name, line), color in zip(lines.items(), COLORS, strict=False)
                ],
            }
        )
    return drawn


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def _points(line: Line, steps: tuple[int, int], values: tuple[float, float]) -> str:
    across = max(steps[1] - steps[0], 1)
    tall = values[1] - values[0] or 1.0
    return " ".join(
        f"{LEFT + (step - steps[0]) / across * (RIGHT - LEFT):.1f},"
        f"{BOTTOM - (value - values[0]) / tall * (BOTTOM - TOP):.1f}"
        for step, value in sorted(line.items())
    )
