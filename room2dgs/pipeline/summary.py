"""A finished run in a few lines."""

from __future__ import annotations

import shlex
from pathlib import Path

from room2dgs.runs.folder import MESH, RENDERS, REPORT
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.verdict import Verdict, noted_verdict


def summary(out: Path) -> list[str]:
    """How good it is, how long it took, what was made; and as the last three the verdict, where to look, what next.

    Raises:
        InputError: as `read_metrics`.
    """
    metrics = read_metrics(out)
    lines, score = [], ""
    f_score, precision, recall = (metrics.get(f"{name}_5cm") for name in ("f_score", "precision", "recall"))
    if f_score is not None and precision is not None and recall is not None:
        lines.append(f"F-score @ 5 cm {f_score:.3f} (precision {precision:.3f}, recall {recall:.3f})")
        score = f"; F-score @ 5 cm {f_score:.3f}"
    seconds = metrics["seconds"]
    stages = ", ".join(f"{stage} {value:.0f} s" for stage, value in seconds.items())
    called = metrics.get("primitives_called") or "surfels"
    surfels = f"{metrics['primitives']:,} {called}; " if metrics.get("primitives") is not None else ""
    lines.append(f"{surfels}{sum(seconds.values()):.0f} s in all: {stages}")
    lines.append(f"peak memory {metrics['peak_memory_mb'] / 1000:.2f} GB")
    lines.append(f"mesh      {out / MESH}")
    if (out / RENDERS).exists():
        lines.append(f"pictures  {out / RENDERS}")
    if (out / "eval" / "views.png").exists():
        lines.append(f"          {out / 'eval' / 'views.png'}, {out / 'eval' / 'top.png'}")
    return lines + _last_lines(out, noted_verdict(metrics), score)


def _last_lines(out: Path, verdict: Verdict | None, score: str) -> list[str]:
    run = shlex.quote(str(out))
    said = verdict.lines() if verdict is not None else []
    look = f"{out / REPORT} (room2dgs open {run})" if (out / REPORT).exists() else f"room2dgs view {run}"
    step = (
        verdict.advice[0] if verdict is not None and verdict.advice else f"room2dgs view {run} walks through the room"
    )
    return [*said[1:], *(f"{word}{score}" for word in said[:1]), f"look at: {look}", f"next: {step}"]
