"""An ablation as one HTML file that needs no network: tables, what was removed, pictures."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence

import cv2
import numpy as np

from room2dgs.eval.pictures import COLUMNS, FULL_THRESHOLDS
from room2dgs.eval.shading import RAMP
from room2dgs.study.ablation import Row, Study
from room2dgs.study.ablation_pictures import Look
from room2dgs.study.ablation_tables import SIMULATED, Table, as_html

JPEG_QUALITY = 85
STYLE = """
body { font: 14px/1.45 system-ui, sans-serif; margin: 2em; color: #222; background: #fff; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; } h3 { font-size: 1em; margin: 1.2em 0 .3em; }
table { border-collapse: collapse; margin: 1em 0; } caption { text-align: left; font-weight: 600; padding: .3em 0; }
th, td { padding: .25em .7em; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
.label { background: #fff3cd; border: 1px solid #e0c060; padding: .5em 1em; display: inline-block; }
.pictures { display: grid; gap: 4px; overflow-x: auto; }
figure { margin: 0; } figure img { width: 100%; display: block; } figcaption { font-size: 12px; padding: 1px 0 4px; }
.bar { width: 320px; height: 14px; border: 1px solid #aaa; }
.scale { width: 322px; display: flex; justify-content: space-between; font-size: 12px; }
"""


def page(study: Study, tables: Sequence[Table], sentences: Sequence[str], views: Sequence[Look]) -> str:
    """The whole page.

    Args:
        sentences: what to say between tables and pictures.
        views: the pictures; none when there is no ground truth.
    """
    title = html.escape(study.title)
    parts = [f"<h1>{title}</h1>", f"<p><code>{html.escape(study.command)}</code></p>"]
    if study.simulated:
        parts.append(
            f"<p class=label><b>{SIMULATED}</b>: depth or normal maps were made from the ground truth. This shows "
            "the method, not a result of the pipeline on its own.</p>"
        )
    parts += [as_html(table) for table in tables]
    parts.append("<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in sentences) + "</ul>")
    parts.append("<h2>What each row is</h2>\n" + _words(study.rows))
    if views:
        parts.append(_pictures(study, views))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head>\n<body>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def data_uri(picture: np.ndarray) -> str:
    """(H, W, 3) RGB 0..1 as a JPEG inside the page."""
    pixels = np.round(np.clip(picture.astype(np.float32), 0, 1) * 255).astype(np.uint8)
    encoded = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return "data:image/jpeg;base64," + base64.b64encode(encoded.tobytes()).decode("ascii")


def _words(rows: Sequence[Row]) -> str:
    lines = []
    for row in rows:
        same = f" It has the same settings as {row.same_as} and was not run again." if row.same_as else ""
        failed = "".join(f" Seed {run.seed} failed: {run.failed}" for run in row.runs if run.failed)
        lines.append(f"<li><b>{html.escape(row.name)}</b>: {html.escape(row.words + same + failed)}</li>")
    return "<ul>\n" + "\n".join(lines) + "\n</ul>"


def _pictures(study: Study, views: Sequence[Look]) -> str:
    said = f" ({SIMULATED})" if study.simulated else ""
    parts = [f"<h2>The meshes side by side{said}</h2>", _color_bar(study.threshold_m)]
    by_name = {row.name: row for row in study.rows}
    for index, kind in enumerate(COLUMNS):
        parts.append(f"<h2>{html.escape(kind)}{said}</h2>")
        for look in views:
            figures = [] if look.photo is None else [_figure(look.photo, "photo")]
            figures += [_figure(tiles[index], _caption(by_name[name], study.at)) for name, tiles in look.tiles.items()]
            parts.append(f"<h3>{html.escape(look.title)}</h3>")
            columns = f"grid-template-columns: repeat({len(figures)}, minmax(200px, 480px))"
            parts.append(f'<div class=pictures style="{columns}">' + "\n".join(figures) + "</div>")
    return "\n".join(parts)


def _figure(picture: np.ndarray, caption: str) -> str:
    said = html.escape(caption)
    return f'<figure><img alt="{said}" src="{data_uri(picture)}"><figcaption>{said}</figcaption></figure>'


def _caption(row: Row, at: str) -> str:
    run = row.finished[0]
    score = (run.metrics or {}).get(f"f_score_{at}")
    return f"{row.name}, seed {run.seed}, priors: {row.priors}" + ("" if score is None else f", F @ {at} {score:.3f}")


def _color_bar(threshold_m: float) -> str:
    stops = ", ".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in RAMP * 255)
    end = FULL_THRESHOLDS * threshold_m * 100
    return (
        f'<div class=bar style="background: linear-gradient(to right, {stops})"></div>'
        f"<div class=scale><span>0</span><span>{end / 2:g}</span><span>{end:g} cm and more</span></div>"
        "<p>Distance; grey: the truth says nothing.</p>"
    )
