"""`room2dgs.reconstruct` and `room2dgs.open_run`: a run as a Python object."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.logs import Log
from room2dgs.pipeline.settings import overrides_of
from room2dgs.runs.folder import (
    CONFIG,
    MESH,
    METRICS,
    POSES,
    REPORT,
    SURFELS,
    TEXTURED,
    earlier_run,
    required,
    saved_settings,
)
from room2dgs.runs.metrics import IMAGE_SCORES, MESH_SCORES, read_metrics
from room2dgs.runs.verdict import Verdict, noted_verdict

if TYPE_CHECKING:  # torch takes seconds to import
    import trimesh

    from room2dgs.captures.scene import Scene
    from room2dgs.geometry.camera import Camera
    from room2dgs.primitives.primitive import Splats

PathLike = str | os.PathLike[str]
FILES = {
    "config": CONFIG,
    "mesh": MESH,
    "textured": TEXTURED,
    "surfels": SURFELS,
    "poses": POSES,
    "metrics": METRICS,
    "report": REPORT,
    "log": "log.txt",
    "renders": "renders",
    "export": "export",
    "eval": "eval",
}


def reconstruct(
    capture: PathLike | None = None,
    out: PathLike | None = None,
    *,
    video: PathLike | None = None,
    images: PathLike | None = None,
    resume: bool = False,
    log: Log | None = None,
    **settings: Any,
) -> Run:
    """Reconstruct a room, as `room2dgs run` does: poses, depth, training, mesh, scores and a report.

        run = room2dgs.reconstruct("room", "runs/room", experiment="quick", scene__image_width=640)
        run.mesh.export("room.obj")

    Args:
        capture: a folder or file with photos and poses, in any layout that `scene.path` takes.
        out: the run's folder, which is made; with `resume` it is that of a run to go on with.
        video: makes the capture from a video, in place of `capture`.
        images: makes the capture from a folder of photos without poses, in place of `capture`.
        resume: go on with the run in `out`, which keeps its settings; then `capture` may be left out.
        log: takes one line at a time; None: lines go to the standard output. log.txt has them in any case.
        settings: any setting of the command: two underscores for a dot (`train__iterations=1000`), a mapping for a
            group (`mesh={"voxel_m": 0.02}`), a name for a file of conf/ (`prior="room_prior"`).

    Returns:
        The finished run.

    Raises:
        InputError: what is wrong with the capture, the folder or a setting, in a sentence.
    """
    from room2dgs.pipeline.reconstruct import start_run

    given = {"scene.path": capture, "out": out, "prepare.video": video, "prepare.images": images}
    if out is None:
        raise InputError("out is not given; add out=DIR, the folder for the run")
    _check_log(log)
    if not isinstance(resume, bool):
        raise InputError(f"resume is {resume!r}, but True or False is wanted")
    places = {key: _path(value, key) for key, value in given.items() if value is not None}
    overrides = [*overrides_of({**settings, **places}), *(["resume=true"] if resume else [])]
    return Run(start_run(overrides, log))


def open_run(path: PathLike) -> Run:
    """A run that `room2dgs run` or `reconstruct` has made.

    Args:
        path: its folder.

    Raises:
        InputError: there is no run.
    """
    folder = Path(_path(path, "path")).expanduser().absolute()
    earlier_run([f"out={folder}"])
    return Run(folder)


class Run:
    """What a run has made; each part is read from its folder when it is first asked for.

    Mesh, surfels and cameras are in one frame, in metres: the capture's world, moved by `origin_m` where the capture
    lies far from the origin of its world.

    Attributes:
        path: the run's folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def settings(self) -> Config:
        """What the run was made with.

        Raises:
            InputError: config.yaml is damaged.
        """
        return saved_settings(self.path)

    @property
    def paths(self) -> dict[str, Path]:
        """The files and folders that are there, by name: "mesh", "surfels", "report", "renders" and so on."""
        return {name: self.path / file for name, file in FILES.items() if (self.path / file).exists()}

    @property
    def metrics(self) -> dict[str, Any]:
        """All figures of metrics.json: scores, times, memory, versions.

        Raises:
            InputError: the file is damaged.
        """
        return read_metrics(self.path)

    @property
    def scores(self) -> dict[str, Any]:
        """The figures that say how good the run is; none where there was no truth and no held-out view.

        Raises:
            InputError: metrics.json is damaged.
        """
        beginnings = (*MESH_SCORES, *IMAGE_SCORES)
        return {
            name: value for name, value in self.metrics.items() if name.startswith(beginnings) and value is not None
        }

    @property
    def verdict(self) -> Verdict | None:
        """Whether the run is good, usable or failed, why, and what to do; None: it did not come to its end.

        Raises:
            InputError: metrics.json is damaged.
        """
        return noted_verdict(self.metrics)

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The mesh with its colours.

        Raises:
            InputError: it is not there, or damaged.
        """
        from room2dgs.mesh.world import read_in_scene

        return read_in_scene(required(self.path / MESH, "mesh"), self.origin_m)

    @cached_property
    def surfels(self) -> Splats:
        """What was trained, as plain tensors.

        Raises:
            InputError: the run trained nothing, or not to the end.
        """
        from room2dgs.pipeline.surfels import load_run_surfels

        return load_run_surfels(self.path)

    @cached_property
    def scene(self) -> Scene:
        """The capture, with the poses of the run.

        Raises:
            InputError: the capture is gone, or can no longer be read.
        """
        from room2dgs.pipeline.scene import scene_of_run

        return scene_of_run(self.settings)

    @property
    def cameras(self) -> dict[str, Camera]:
        """The camera of each view by the view's name: training views first, then those held out.

        Raises:
            InputError: as `scene`.
        """
        return {frame.name: frame.camera for frame in self.scene.frames}

    @property
    def origin_m(self) -> tuple[float, float, float]:
        """Where the origin of mesh, surfels and cameras stands in the capture's world, metres."""
        from room2dgs.runs.metrics import origin_of_run

        return origin_of_run(self.path) or self.scene.origin_m

    def evaluate(self, log: Log | None = None, **settings: Any) -> dict[str, Any]:
        """Score the run again, for example with `eval__gt="scan.ply"` or `eval__threshold_m=0.02`.

        Args:
            log: as in `reconstruct`.
            settings: as in `reconstruct`, on top of the run's own.

        Returns:
            `scores`.

        Raises:
            InputError: no truth where eval.gt says, or a setting that cannot be.
        """
        from room2dgs.pipeline.evaluate import evaluate_run, ground_truth
        from room2dgs.pipeline.loaded_run import loaded_run

        _check_log(log)
        config = self._with(settings)
        ground_truth(config)
        with loaded_run(config, log) as (scene, surfels, run):
            evaluate_run(scene, surfels, config, run)
        return self.scores

    def export(self, *formats: str, out: PathLike | None = None, log: Log | None = None, **settings: Any) -> list[Path]:
        """Write the run for other programs.

        Args:
            formats: names such as "glb" or "splats", or "all"; `room2dgs export --help` lists them.
            out: folder for the files; None: `export` in the run's folder.
            log: takes one line at a time; None: lines go to the standard output.
            settings: such as `export__up="z"`, on top of the run's own.

        Returns:
            The files.

        Raises:
            InputError: an unknown format, or one that needs what the run has not.
        """
        from room2dgs.logs import to_terminal
        from room2dgs.pipeline.export import export_run

        _check_log(log)
        other = next((name for name in formats if not isinstance(name, str)), None)
        if other is not None:
            raise InputError(f'a format is {other!r}, but names are wanted: run.export("glb", "splats")')
        folder = None if out is None else Path(_path(out, "out"))
        return export_run(self._with(settings), formats, folder, log or to_terminal)

    def report(self, log: Log | None = None, **settings: Any) -> Path:
        """Write the page of the run again.

        Args:
            log: as in `reconstruct`.
            settings: such as `report__views=12`, on top of the run's own.

        Returns:
            The page, which opens without a network.

        Raises:
            InputError: the run is not finished, or a setting that cannot be.
        """
        from room2dgs.pipeline.loaded_run import loaded_run
        from room2dgs.pipeline.report import write_run_report

        _check_log(log)
        config = self._with(settings)
        with loaded_run(config, log) as (scene, surfels, run):
            return write_run_report(scene, surfels, config, run)

    def __repr__(self) -> str:
        return f"Run({str(self.path)!r})"

    def _repr_html_(self) -> str:
        """For notebooks: a picture, the scores and where the files are; without a network."""
        from room2dgs.pipeline.run_html import run_html

        return run_html(self)

    def _with(self, settings: Mapping[str, Any]) -> Config:
        return earlier_run([*overrides_of(settings), f"out={self.path}"])


def _path(value: Any, name: str) -> str:
    """A path as text.

    Raises:
        InputError: it is none.
    """
    if not isinstance(value, str | os.PathLike):
        raise InputError(f"{name} is {value!r}, but a path is wanted; give a text or a pathlib.Path")
    return os.fsdecode(value)


def _check_log(log: object) -> None:
    """Raises InputError for what no line can be given to."""
    if log is not None and not callable(log):
        raise InputError(f"log is {log!r}, but a function of one line is wanted, such as print")
