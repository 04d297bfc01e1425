"""A prior's measurement as tables, JSON, Markdown and one HTML file that needs no network."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from room2dgs.bench.prior_measure import Picture, SceneScore
from room2dgs.bench.prior_scores import NORMAL_SHARES_DEG, Ranking, share_name
from room2dgs.eval.shading import UNKNOWN, error_color
from room2dgs.files import whole_file
from room2dgs.json_files import plain
from room2dgs.report.page import Figure, drawn
from room2dgs.report.page import page as filled
from room2dgs.report.table import NOTHING, Table, markdown, table

JSON, MARKDOWN, HTML = "bench_prior.json", "bench_prior.md", "bench_prior.html"
FULL_LN_DEPTH, FULL_DEG = 0.3, 60.0  # where the pictures' colour scales end
TILE_WIDTH = 320
SIMULATED = "simulated maps, made from the ground truth: a study, no network's result"

NOTES = (
    "AbsRel and δ1: each frame's, then their mean; scale: the frame's median ratio; scale + shift: least squares, in "
    "disparity where the prior is one; metric: as the prior says it",
    "depth in a run, nothing fitted to the truth; aligned: each map to the sparse points; optimised: then all maps "
    "jointly, without the pixels that points contradict, as training gets it; pixels: those that are left "
    "(none: the run leaves all depth out)",
    "normals: angles over the pixels of all frames; constant: the one normal, in the camera frame, of least mean angle "
    "(facing: the one that just faces the camera)",
    "confident half: mean error of the pixels with the least expected error; AUSE: area between the curve of the mean "
    "error left when the most doubtful go and the best possible curve, as a share of the mean error, beside it what "
    "an order that knows nothing has; depth errors there are |ln d - ln d*|",
    "truth of the normals: mesh: its own triangles; fused mesh: planes of least squares in windows of 13 pixels "
    "(of 640 across) of its ray-cast depth; depth, sensor depth: the same of the depth map, 5 and 15 pixels; a mesh "
    "counts where it lies within 4 cm (2 % when far) of the depth",
    "milliseconds: the network alone, median over the frames after one that is not counted, and the least",
)


def tables(scores: Sequence[SceneScore]) -> list[Table]:
    """Depth, normals, confidence and time, those that there is something to say in."""
    found = [table("Depth", _depth_columns(scores), [score for score in scores if score.depth])]
    found.append(table("Depth in a run", _run_columns(), [score for score in scores if score.in_run]))
    found.append(table("Normals", _normal_columns(), [score for score in scores if score.constant_deg is not None]))
    for kind, number in (("depth", "{:.3f}"), ("normal", "{:.1f}°")):
        ranked = [score for score in scores if _ranked(score, kind)]
        found.append(table(f"Confidence, {kind}", _ranking_columns(kind, number), ranked))
    timed = [score for score in scores if score.milliseconds]
    found.append(table("Time of the network", _time_columns(timed), timed))
    return [one for one in found if len(one.frame)]


def write_report(out: Path, scores: Sequence[SceneScore], about: dict[str, Any]) -> None:
    """bench_prior.json, .md and .html in a folder.

    Args:
        about: what the reader must know beside the scores: "command", "prior" in words, "simulated", machine, ...
    """
    words = sentences(about)
    with whole_file(out / JSON) as temporary:
        whole = plain({**about, "scenes": [score.as_dict() for score in scores]})
        temporary.write_text(json.dumps(whole, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    shown = tables(scores)
    lines = ["# Prior benchmark", *words, *map(markdown, shown), "\n".join(f"- {n}" for n in NOTES)]
    with whole_file(out / MARKDOWN) as temporary:
        temporary.write_text("\n\n".join(lines) + "\n", encoding="utf-8")
    with whole_file(out / HTML) as temporary:
        temporary.write_text(page(scores, shown, words), encoding="utf-8")


def sentences(about: dict[str, Any]) -> list[str]:
    """What was measured, where and with which settings, a line each."""
    machine = about["machine"]
    lines = [
        f"prior: {about['prior']}",
        f"{machine['processor']}, {machine['cores']} cores, {about['threads']} threads; commit {about['commit']}",
        f"command: {about['command']}",
    ]
    return [*([f"WARNING: {SIMULATED}"] if about["simulated"] else []), *lines]


def page(scores: Sequence[SceneScore], shown: Sequence[Table], words: Sequence[str]) -> str:
    """The whole HTML page: tables, curves of the confidence, pictures."""
    return filled(
        "bench_prior.html.j2",
        title="Prior benchmark",
        sentences=words,
        tables=shown,
        notes=NOTES,
        scenes=[
            {
                "name": score.scene,
                "curves": _curves(score),
                "pictures": [(picture.name, _figures(picture)) for picture in score.pictures],
            }
            for score in scores
        ],
        scale=f"errors from blue, 0, to red, {FULL_LN_DEPTH:g} of ln depth or {FULL_DEG:g}°; grey: not known",
        tile_width=TILE_WIDTH,
    )


Columns = dict[str, Callable[[SceneScore], str]]


def _depth_columns(scores: Sequence[SceneScore]) -> Columns:
    columns: Columns = {"scene": lambda s: s.scene, "frames": lambda s: str(s.frames)}
    words = {"scale": "scale", "scale_shift": "scale + shift", "metric": "metric"}
    for name, word in words.items():
        if any(name in score.depth for score in scores):
            columns[f"AbsRel, {word}"] = partial(lambda name, s: _number(s.depth, name, "abs_rel"), name)
            columns[f"δ1, {word}"] = partial(lambda name, s: _number(s.depth, name, "delta1"), name)
    return columns | {"pixels with depth": lambda s: _share(s.depth_share)}


def _run_columns() -> Columns:
    columns: Columns = {"scene": lambda s: s.scene}
    for step in ("aligned", "optimised"):
        columns[f"AbsRel, {step}"] = partial(lambda step, s: _number(s.in_run, step, "abs_rel"), step)
        columns[f"δ1, {step}"] = partial(lambda step, s: _number(s.in_run, step, "delta1"), step)
        columns[f"< 5 cm, {step}"] = partial(_share_in_run, step, "within_5cm")
        columns[f"pixels, {step}"] = partial(_share_in_run, step, "share")
    return columns


def _share_in_run(step: str, figure: str, score: SceneScore) -> str:
    return _share(getattr(score.in_run.get(step), figure, None))


def _normal_columns() -> Columns:
    columns: Columns = {
        "scene": lambda s: s.scene,
        "frames": lambda s: str(s.frames),
        "normals of": lambda s: {"depth": "the depth prior", "prior": "the prior"}.get(s.normals_from, NOTHING),
        "mean": lambda s: _degrees(s.normals.get("mean_deg")),
        "median": lambda s: _degrees(s.normals.get("median_deg")),
    }
    for limit in NORMAL_SHARES_DEG:
        columns[f"< {limit:g}°"] = partial(lambda limit, s: _share(s.normals.get(share_name(limit))), limit)
    return columns | {
        "constant": lambda s: _degrees(s.constant_deg),
        "facing": lambda s: _degrees(s.facing_deg),
        "pixels with a normal": lambda s: _share(s.normal_share),
        "truth": lambda s: s.truth,
    }


def _ranking_columns(kind: str, number: str) -> Columns:
    def cell(name: str, form: str) -> Callable[[SceneScore], str]:
        return lambda s: form.format(getattr(_ranked(s, kind), name)) if _ranked(s, kind) else NOTHING

    return {
        "scene": lambda s: s.scene,
        "mean error": cell("all", number),
        "confident half": cell("confident_half", number),
        "best half": cell("best_half", number),
        "expected error": cell("expected", number),
        "AUSE": cell("ause", "{:.3f}"),
        "AUSE of no order": cell("ause_random", "{:.3f}"),
    }


def _ranked(score: SceneScore, kind: str) -> Ranking | None:
    return score.depth_ranking if kind == "depth" else score.normal_ranking


def _time_columns(scores: Sequence[SceneScore]) -> Columns:
    columns: Columns = {"scene": lambda s: s.scene}
    for kind in dict.fromkeys(kind for score in scores for kind in score.milliseconds):
        for name in ("median", "least"):
            columns[f"{kind}, {name}"] = partial(
                lambda kind, name, s: f"{s.milliseconds[kind][name]:.0f} ms" if kind in s.milliseconds else NOTHING,
                kind,
                name,
            )
    return columns


def _number(found: dict[str, Any], name: str, key: str) -> str:
    value = getattr(found[name], key) if name in found else float("nan")
    return f"{value:.3f}" if np.isfinite(value) else NOTHING


def _degrees(value: float | None) -> str:
    return NOTHING if value is None or not np.isfinite(value) else f"{value:.1f}°"


def _share(value: float | None) -> str:
    return NOTHING if value is None or not np.isfinite(value) else f"{100 * value:.1f} %"


def _curves(score: SceneScore) -> list[Figure]:
    """Sparsification and calibration, drawn."""
    ranked = {(kind, unit): _ranked(score, kind) for kind, unit in (("depth", "of ln depth"), ("normal", "degrees"))}
    return [
        Figure(f"confidence of {kind}", _drawing(one, f"{score.scene}, {kind}", unit))
        for (kind, unit), one in ranked.items()
        if one is not None
    ]


def _drawing(one: Ranking, title: str, unit: str) -> np.ndarray:
    from matplotlib.figure import Figure as Drawing

    figure = Drawing(figsize=(8, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    share = np.linspace(0, 1, len(one.curve), endpoint=False)
    left.plot(share, one.curve, label="by expected error")
    left.plot(share, one.best_curve, label="best possible")
    left.axhline(1.0, color="grey", lw=0.8, ls=":")
    left.set(title=title, xlabel="share taken away, most doubtful first", ylabel="error left / error of all", ylim=0)
    left.legend(frameon=False)
    expected, true = np.array(one.bins).T
    end = 1.05 * max(expected.max(), true.max())
    right.plot([0, end], [0, end], color="grey", lw=0.8, ls=":")
    right.plot(expected, true, "o-")
    right.set(title="tenths of the pixels", xlabel=f"expected error, {unit}", ylabel=f"true error, {unit}")
    return drawn(figure, dpi=130)


def _figures(picture: Picture) -> list[Figure]:
    tiles = [("photo", picture.photo / 255.0)]
    end = float(np.percentile(picture.true_depth[picture.true_depth > 0], 98)) if picture.true_depth.any() else 1.0
    tiles.append(("true depth", _depth_color(picture.true_depth, end)))
    if picture.depth is not None and picture.depth_error is not None:
        tiles.append(("depth, aligned", _depth_color(picture.depth, end)))
        tiles.append(("its error", _error_color(picture.depth_error, FULL_LN_DEPTH)))
    if picture.expected_depth_error is not None:
        tiles.append(("its expected error", _error_color(picture.expected_depth_error, FULL_LN_DEPTH)))
    tiles.append(("true normals", _normal_color(picture.true_normal)))
    if picture.normal is not None and picture.angle is not None:
        tiles.append(("normals", _normal_color(picture.normal)))
        tiles.append(("their error", _error_color(picture.angle, FULL_DEG)))
    if picture.expected_angle is not None:
        tiles.append(("their expected error", _error_color(picture.expected_angle, FULL_DEG)))
    return [Figure(caption, _tile(image)) for caption, image in tiles]


def _tile(image: np.ndarray) -> np.ndarray:
    height = round(image.shape[0] * TILE_WIDTH / image.shape[1])
    return cv2.resize(image.astype(np.float32), (TILE_WIDTH, height), interpolation=cv2.INTER_AREA)


def _depth_color(depth: np.ndarray, end: float) -> np.ndarray:
    """(H, W, 3) near bright, far dark."""
    grey = np.clip(255 * (1 - depth / end), 0, 255).astype(np.uint8)
    color = cv2.applyColorMap(grey, cv2.COLORMAP_INFERNO)[..., ::-1] / 255.0
    return np.where((depth > 0)[..., None], color, UNKNOWN)


def _normal_color(normal: np.ndarray) -> np.ndarray:
    """(H, W, 3) right red, up green, towards the camera blue."""
    return np.where(normal.any(axis=-1, keepdims=True), 0.5 + 0.5 * normal * np.array([1.0, -1.0, -1.0]), UNKNOWN)


def _error_color(error: np.ndarray, full: float) -> np.ndarray:
    known = np.isfinite(error)
    color = error_color(np.where(known, error, 0.0).ravel(), full).reshape(*error.shape, 3)
    return np.where(known[..., None], color, UNKNOWN)
