"""Methods that make splats, each trained on a capture: quality of the held-out views against seconds."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config
from room2dgs.eval.image_metrics import image_scores
from room2dgs.logs import Log
from room2dgs.pipeline.poses import refine_poses
from room2dgs.pipeline.reconstruct import train_steps
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.scene import photos_cached, read_capture
from room2dgs.pipeline.surfels import render_frames
from room2dgs.primitives.primitive import Splats
from room2dgs.runs.folder import claimed, new_run
from room2dgs.runs.metrics import StageTimes, peak_memory_mb, timed
from room2dgs.train import Hook
from room2dgs.train.trainer import Iteration, Trainer

# name -> settings on top of the defaults, and what it is
METHODS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "2d": ((), "surfels with depth priors, room2dgs's default"),
    "2d_splats": (("experiment=splats", "primitive=surfel2d"), "3d with surfels in place of Gaussians"),
    "2d_plain": (("experiment=plain_2dgs",), "surfels as in 2DGS, from photos alone"),
    "3d": (("experiment=splats",), "3D Gaussians from depth priors, cloned and split, fitted to photos"),
    "3d_plain": (("experiment=plain_3dgs",), "3D Gaussians as in 3DGS, from photos alone"),
    "3d_mip": (("experiment=splats", "primitive=mip_gaussian3d"), "3d with Mip-Splatting's filter"),
    "3d_mcmc": (
        ("experiment=plain_3dgs", "strategy=mcmc", "strategy.max_surfels=100000"),
        "3d_plain with the densification of 3DGS-MCMC",
    ),
    "3d_seeds": (("primitive=gaussian3d",), "3D Gaussians trained as surfels are by default"),
}
DEFAULT_METHODS = ("2d", "3d", "3d_plain", "3d_mcmc")


@dataclass(frozen=True)
class Point:
    """Held-out views at one moment of a training; None where something is not known.

    Attributes:
        capture, method: names.
        seconds, cpu_seconds: of training, the evaluations left out.
        iteration, primitives: then.
        psnr_db, ssim: means over the held-out views.
        peak_memory_mb: of the process so far.
        preparation_seconds: poses, points and priors before the training.
    """

    capture: str
    method: str
    seconds: float | None
    cpu_seconds: float | None
    iteration: int | None
    primitives: int | None
    psnr_db: float
    ssim: float
    peak_memory_mb: float | None
    preparation_seconds: float | None

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


class Curve(Hook):
    """Notes the held-out views' quality once the training has taken so many seconds, and at its end.

    Args:
        marks: seconds of training, rising.
    """

    name = "bench_splats"

    def __init__(self, marks: Sequence[float]) -> None:
        self._marks = list(marks)
        self.rows: list[dict[str, Any]] = []

    def on_start(self, trainer: Trainer) -> None:
        self._start = time.process_time()
        self._aside = 0.0  # processor seconds of the evaluations

    def after_step(self, trainer: Trainer, iteration: Iteration) -> None:
        seconds = sum(trainer.clock.seconds.values())
        if not trainer.finished and not (self._marks and seconds >= self._marks[0]):
            return
        self._marks = [mark for mark in self._marks if mark > seconds]
        begin = time.process_time()
        cpu_seconds = begin - self._start - self._aside
        scores = held_out_scores(trainer.surfels(), trainer.scene, trainer.config)
        self._aside += time.process_time() - begin
        self.rows.append(
            {
                "seconds": seconds,
                "cpu_seconds": cpu_seconds,
                "iteration": iteration.done,
                "primitives": trainer.model.count,
                "peak_memory_mb": peak_memory_mb(),
                **scores,
            }
        )


def held_out_scores(splats: Splats, scene: Scene, config: Config) -> dict[str, float]:
    """PSNR and SSIM of the held-out views, at the size of the run, within masks."""
    views = render_frames(splats, scene.test, config)
    return scores_of((frame, frame.exposed(view.color.numpy())) for frame, view in views)


def scores_of(views: Iterable[tuple[Frame, np.ndarray]]) -> dict[str, float]:
    """The same of pictures (H, W, 3) uint8 or 0..1, as they come from anywhere."""
    pairs = ((frame.name, color, frame.color(), frame.mask()) for frame, color in views)
    found = image_scores(pairs)
    return {"psnr_db": found["psnr_db"], "ssim": found["ssim"]}


def measured(
    captures: Sequence[str],
    methods: Sequence[str],
    marks: Sequence[float],
    out: Path,
    settings: Sequence[str],
    log: Log,
) -> Iterator[list[Point]]:
    """The points of each method on each capture, as they come; each in a process of its own, for its memory.

    Raises:
        InputError: as the steps of a run; no held-out views.
    """
    for capture in captures:
        for method in methods:
            log(f"{Path(capture).name}, {method}: {METHODS[method][1]}")
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                yield pool.submit(train_and_note, capture, method, marks, out, tuple(settings)).result()


def train_and_note(
    capture: str, method: str, marks: Sequence[float], out: Path, settings: Sequence[str]
) -> list[Point]:
    """One method on one capture, in out/<capture>/<method>."""
    name = Path(capture).name
    folder = out / name / method
    given = [*METHODS[method][0], "train.test_every=0", *settings]
    config = new_run([*given, f"scene.path={capture}", f"out={folder}"])
    times, curve = StageTimes(), Curve(marks)
    with timed(times, "read"):
        scene = read_capture(config, keep_photos=True)
    with claimed(config) as path, photos_cached(scene, path):
        run = RunFolder.with_log(path, times, None)
        train_steps(refine_poses(scene, config, run), config, run, [curve])
    before = sum(seconds for stage, seconds in times.items() if stage != "train")
    return [Point(capture=name, method=method, preparation_seconds=before, **row) for row in curve.rows]
