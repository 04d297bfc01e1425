"""A run in words and tables: figures, warnings, settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from room2dgs.captures.scene import Scene
from room2dgs.config import Config, load_config
from room2dgs.config.keys import leaf_keys
from room2dgs.config.sentences import shown
from room2dgs.eval.quality_text import rows as quality_rows
from room2dgs.registries.meshers import MESHERS
from room2dgs.report.table import NOTHING, Table, table
from room2dgs.runs.schema import is_number

POOR_PSNR_DB, FEW_PHOTOS, POOR_F_SCORE = 20.0, 15, 0.7
OWN = ("out", "resume", "scene.path")  # settings that every run gives
SCORES = (
    ("f_score_", "F-score"),
    ("precision_", "precision"),
    ("recall_", "recall"),
    ("accuracy_m", "accuracy"),
    ("completion_m", "completion"),
    ("chamfer_m", "chamfer"),
    ("normal_consistency", "normal consistency"),
)

DEPTH_SCORES = {
    "within_2cm": "within 2 cm of the sensor's depth",
    "within_5cm": "within 5 cm",
    "within_10cm": "within 10 cm",
    "coverage": "coverage",
    "abs_rel": "AbsRel",
    "delta1": "delta1",
    "scale_error_median": "scale error of a photo, median",
    "scale_error_p5": "scale error, 5th percentile",
    "scale_error_p95": "scale error, 95th percentile",
}


def opening(config: Config, metrics: dict[str, Any]) -> str:
    """Which capture, by what."""
    version = part(metrics, "versions").get("room2dgs", "")
    sentence = f"Made of the photos of {Path(config.scene.path).name} by room2dgs {version} in {Path(config.out).name}."
    if not config.mesh.of_surfels:
        how = MESHERS.get(config.mesh.source).facts["on_page"]
        sentence += f" A first look: {how}, nothing was trained; renderings are of the mesh."
    return sentence


def part(metrics: dict[str, Any], key: str) -> dict[str, Any]:
    """An object of metrics.json; empty where it is not there, or null since what it was measured on is gone."""
    return metrics.get(key) or {}


def threshold_m(metrics: dict[str, Any], config: Config) -> float:
    """At which the mesh was scored, and its error drawn: `eval` may have had another than the run's settings."""
    constants = part(part(metrics, "protocols"), metrics.get("protocol") or "").get("constants") or {}
    known = (metrics.get("threshold_m"), constants.get("threshold_m"))  # runs from before have the second alone
    return next((float(value) for value in known if value and is_number(value) and value > 0), config.eval.threshold_m)


def facts(scene: Scene, metrics: dict[str, Any]) -> list[dict[str, str]]:
    """The few figures to see first."""
    found = []
    for key, value in metrics.items():
        if key.startswith("f_score_") and value is not None:
            found.append((f"{value:.3f}", f"F-score at {key.removeprefix('f_score_')}"))
    if metrics.get("psnr_db") is not None:
        found.append((f"{metrics['psnr_db']:.1f} dB", f"PSNR of {len(metrics.get('test_views') or ())} held-out views"))
    found.append((str(len(scene.train)), "training photos"))
    if metrics.get("primitives") is not None:
        found.append((f"{metrics['primitives']:,}", metrics.get("primitives_called") or "surfels"))
    if metrics.get("mesh_faces") is not None:
        found.append((f"{metrics['mesh_faces']:,}", "triangles"))
    seconds = sum(part(metrics, "seconds").values())
    found.append((f"{seconds / 60:.1f} min", "in all"))
    return [{"value": value, "what": what} for value, what in found]


def warnings(scene: Scene, config: Config, metrics: dict[str, Any], log: Sequence[str]) -> list[str]:
    """What a reader of the figures should know, in sentences."""
    lines = list(scene.warnings)
    if not scene.metric:
        lines.append("The capture's lengths are not known to be metres: every length here is in its own unit.")
    if len(scene.train) < FEW_PHOTOS:
        lines.append(f"Only {len(scene.train)} photos: more of them, with more overlap, would help most.")
    if scene.dropped:
        lines.append(f'{len(scene.dropped)} photos could not be used; they are named under "what to film again".')
    if metrics.get("psnr_db") is not None and metrics["psnr_db"] < POOR_PSNR_DB:
        lines.append(
            f"Held-out views have a PSNR of {metrics['psnr_db']:.1f} dB, which is little: poses that are off, blur, "
            "changing light or a short training are the usual causes."
        )
    scores = [value for key, value in metrics.items() if key.startswith("f_score_") and value is not None]
    if scores and min(scores) < POOR_F_SCORE:
        lines.append(f"An F-score of {min(scores):.2f} means that much of the room is wrong or missing: see its error.")
    if not scores:
        lines.append(
            "There is no ground truth, so nothing here says how far the mesh is off; its scale is the capture's."
        )
    if metrics.get("truth_from_same_depth"):
        lines.append(
            "The ground truth was made of the very depth that the run used: its scores say nothing of photos alone."
        )
    if metrics.get("priors") == "simulated":
        lines.append("Depth or normals were simulated from the ground truth: a study of the method, not a result.")
    if metrics.get("iterations") is not None and metrics["iterations"] < config.train.iterations:
        lines.append(f"Training ended after {metrics['iterations']} of {config.train.iterations} iterations.")
    return lines + [line for line in logged_warnings(log) if line not in lines]


def logged_warnings(log: Sequence[str]) -> list[str]:
    """What the log warned of, each once."""
    parts = (line.partition(": ") for line in log)
    return list(dict.fromkeys(rest for start, _, rest in parts if start.lower() == "warning"))


def tables(metrics: dict[str, Any]) -> list[Table]:
    """Scores, stages, machine."""
    return [
        one
        for one in (_scores(metrics), _quality(metrics), _stages(metrics), _training(metrics), _machine(metrics))
        if len(one.frame)
    ]


def changed_settings(config: Config) -> Table:
    """Settings that are not the default's."""
    own, default = _flat(config), _flat(load_config([f"{key}=x" for key in ("scene.path", "out")]))
    keys = [key for key in leaf_keys() if key.name not in OWN and own.get(key.name) != default.get(key.name)]
    columns = {
        "setting": lambda key: key.name,
        "here": lambda key: shown(own.get(key.name)),
        "by default": lambda key: shown(default.get(key.name)),
        "what it is": lambda key: key.comment,
    }
    return table("", columns, keys)


def closing(metrics: dict[str, Any]) -> str:
    """Which code, with which libraries."""
    versions = ", ".join(f"{name} {value}" for name, value in part(metrics, "versions").items())
    commit = metrics.get("commit")
    return (f"Commit {commit}. " if commit else "") + versions


def _scores(metrics: dict[str, Any]) -> Table:
    rows = []
    for name, scores in part(metrics, "protocols").items():
        for start, label in SCORES:
            for key, value in scores.items():
                if key.startswith(start) and isinstance(value, float):
                    at = f" at {key.removeprefix(start)}" if start.endswith("_") else ""
                    rows.append((name, label + at, f"{value * 1000:.1f} mm" if key.endswith("_m") else f"{value:.3f}"))
    rows += _depth_scores(metrics)
    for key, label in (("psnr_db", "PSNR, dB"), ("psnr_fitted_db", "PSNR after a colour fit, dB"), ("ssim", "SSIM")):
        if metrics.get(key) is not None:
            rows.append(("held-out photos", label, f"{metrics[key]:.3f}"))
    columns = {"protocol": lambda row: row[0], "score": lambda row: row[1], "value": lambda row: row[2]}
    return table("Scores", columns, rows)


def _quality(metrics: dict[str, Any]) -> Table:
    columns = {"how whole the mesh is": lambda row: row[0], "value": lambda row: row[1]}
    return table("Mesh", columns, quality_rows(part(metrics, "mesh_quality")))


def _depth_scores(metrics: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Protocol, score and value of each figure of protocol `depth`, training and held-out photos apart."""
    rows = []
    for surface, groups in part(metrics, "depth_scores").items():
        for group, label in (("training", "training photos"), ("held_out", "held-out photos")):
            figures = groups.get(group) or {}
            for key, text in DEPTH_SCORES.items():
                if (value := figures.get(key)) is not None:
                    shown_value = f"{value:+.1%}" if key.startswith("scale_error_") else f"{value:.3f}"
                    rows.append((f"depth of the {surface}, {label}", text, shown_value))
    return rows


def _stages(metrics: dict[str, Any]) -> Table:
    seconds, memory = part(metrics, "seconds"), part(metrics, "stage_peak_memory_mb")
    total = sum(seconds.values()) or 1.0
    columns = {
        "stage": lambda row: row[0],
        "seconds": lambda row: f"{row[1]:.1f}",
        "share": lambda row: f"{row[1] / total:.0%}",
        "peak memory up to its end": lambda row: f"{memory[row[0]] / 1000:.2f} GB" if row[0] in memory else NOTHING,
    }
    return table("Seconds and memory by stage", columns, seconds.items())


def _training(metrics: dict[str, Any]) -> Table:
    columns = {"part of an iteration": lambda row: row[0], "seconds": lambda row: f"{row[1]:.1f}"}
    return table("Training", columns, [row for row in part(metrics, "training_seconds").items() if row[1]])


def _machine(metrics: dict[str, Any]) -> Table:
    columns = {"machine": lambda row: row[0].replace("_", " "), "value": lambda row: str(row[1])}
    return table("Machine", columns, part(metrics, "machine").items())


def _flat(config: Config) -> dict[str, Any]:
    flat: dict[str, Any] = {}

    def walk(prefix: str, value: Any) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{prefix}.{key}" if prefix else key, inner)
        else:
            flat[prefix] = value

    walk("", asdict(config))
    return flat
