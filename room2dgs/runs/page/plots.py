"""Curves of a training, read from its log: they are there whether or not TensorBoard's files are."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

STEP = re.compile(r"^iteration ([0-9]{1,12})/[0-9]+: (.*)$")
LOSS = re.compile(r"^loss ([\d.e+-]+|nan|inf) \((.*?)\)")
TRAIN_PSNR = re.compile(r"(?:^|, )PSNR ([\d.]+) dB")
TEST_PSNR = re.compile(r"^held-out PSNR ([\d.]+) dB")
COUNT = re.compile(r", (\d+) (surfels|Gaussians)")
MAX_LINES = 2  # in a drawing; style.css has so many colours
LEFT, RIGHT, TOP, BOTTOM = 56.0, 310.0, 10.0, 150.0  # of the drawing
LARGEST = 1e30
MOST_TICKS = 5
PSNR, HELD_OUT, WHOLE = "PSNR, dB", "held-out views", "loss"
FIRST = (PSNR, WHOLE, "surfels", "Gaussians")

Line = dict[int, float]


def read_plots(log: Iterable[str]) -> dict[str, dict[str, Line]]:
    """Title -> line's name -> iteration -> value. Of an iteration that was done twice the last counts."""
    found: dict[str, dict[str, Line]] = {}
    for line in log:
        step = STEP.match(line)
        if not step:
            continue
        for title, name, value in _values(step[2]):
            try:
                number = float(value)
            except ValueError:  # a line that is not ours
                continue
            if abs(number) <= LARGEST:
                found.setdefault(title, {}).setdefault(name, {})[int(step[1])] = number
    return found


def _values(text: str) -> Iterator[tuple[str, str, str]]:
    """Title, line's name and number of each figure that a log line gives for its iteration."""
    if test := TEST_PSNR.match(text):
        yield PSNR, HELD_OUT, test[1]
    if not (loss := LOSS.match(text)):
        return
    yield WHOLE, "training", loss[1]
    for term in filter(None, loss[2].split(", ")):
        name, _, value = term.rpartition(" ")
        yield f"loss: {name}", "training", value
    rest = text[loss.end() :]
    if psnr := TRAIN_PSNR.search(rest):
        yield PSNR, "training views", psnr[1]
    if count := COUNT.search(rest):
        yield count[2], "training", count[1]


def drawings(plots: Mapping[str, Mapping[str, Line]]) -> list[dict[str, Any]]:
    """For the template: titles, ends of the axes, and the lines' points."""
    drawn = []
    first = [title for title in FIRST if title in plots]
    for title in [*first, *(title for title in plots if title not in first)]:
        lines = plots[title]
        steps = [step for line in lines.values() for step in line]
        values = [value for line in lines.values() for value in line.values()]
        if len(set(steps)) < 2:
            continue
        low, high = min(values), max(values)
        steps_range, values_range = (min(steps), max(steps)), (low, high if high > low else low + 1)
        drawn.append(
            {
                "title": title,
                "across": [
                    {"at": f"{_across(value, steps_range):.1f}", "label": _number(value)}
                    for value in ticks(*steps_range)
                ],
                "up": [
                    {"at": f"{_down(value, values_range):.1f}", "label": _number(value)}
                    for value in ticks(*values_range)
                ],
                "lines": [
                    {"name": name, "points": _points(line, steps_range, values_range)}
                    for name, line in list(lines.items())[:MAX_LINES]
                ],
            }
        )
    return drawn


def ticks(low: float, high: float) -> list[float]:
    """Round numbers from low to high, evenly spaced, at most `MOST_TICKS`, one of them at least."""
    power = 10.0 ** math.floor(math.log10(high - low))
    steps = (share * power for share in (0.2, 0.5, 1, 2, 5))
    step = next(one for one in steps if math.floor(high / one) - math.ceil(low / one) < MOST_TICKS)
    return [step * number for number in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def _across(step: float, steps: tuple[float, float]) -> float:
    return LEFT + (step - steps[0]) / max(steps[1] - steps[0], 1) * (RIGHT - LEFT)


def _down(value: float, values: tuple[float, float]) -> float:
    return BOTTOM - (value - values[0]) / (values[1] - values[0]) * (BOTTOM - TOP)


def _points(line: Line, steps: tuple[int, int], values: tuple[float, float]) -> str:
    return " ".join(f"{_across(step, steps):.1f},{_down(value, values):.1f}" for step, value in sorted(line.items()))
