"""A finished run in a few lines."""

from __future__ import annotations

from pathlib import Path

from room2dgs.runs.folder import MESH, RENDERS, REPORT
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.verdict import noted_verdict


def summary(out: Path) -> list[str]:
    """How good it is, how long it took, where to look, and the verdict.

    Raises:
        InputError: as `read_metrics`.
    """
    metrics = read_metrics(out)
    lines = []
    f_score, precision, recall = (metrics.get(f"{name}_5cm") for name in ("f_score", "precision", "recall"))
    if f_score is not None and precision is not None and recall is not None:
        lines.append(f"F-score @ 5 cm {f_score:.3f} (precision {precision:.3f}, recall {recall:.3f})")
    seconds = metrics["seconds"]
    stages = ", ".join(f"{stage} {value:.0f} s" for stage, value in seconds.items())
    surfels = f"{metrics['primitives']:,} surfels; " if metrics.get("primitives") is not None else ""
    lines.append(f"{surfels}{sum(seconds.values()):.0f} s in all: {stages}")
    lines.append(f"peak memory {metrics['peak_memory_mb'] / 1000:.2f} GB")
    lines.append(f"mesh      {out / MESH}")
    if (out / RENDERS).exists():
        lines.append(f"pictures  {out / RENDERS}")
    if (out / "eval" / "views.png").exists():
        lines.append(f"          {out / 'eval' / 'views.png'}, {out / 'eval' / 'top.png'}")
    if (out / REPORT).exists():
        lines.append(f"report    {out / REPORT}")
    verdict = noted_verdict(metrics)
    if verdict is not None:
        lines += verdict.lines()
    return lines
