"""`room2dgs eval`: scores of a run's mesh and held-out views, or of any mesh."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from room2dgs.captures.scene import Frame, Scene
from room2dgs.commands.same_depth import same_depth_part
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.commands.short_keys import written_out
from room2dgs.commands.stages import read, rendered, trained_surfels, use_threads, with_poses_of_run
from room2dgs.config import Config, EvalConfig, load_config
from room2dgs.errors import InputError
from room2dgs.links_out import refuse_links_out
from room2dgs.logs import Log, in_lines, run_log, to_terminal
from room2dgs.owner import owned
from room2dgs.regular_files import check_regular
from room2dgs.runs.folder import (
    CONFIG,
    MESH,
    METRICS,
    absolute,
    at_work,
    earlier_run,
    last_value,
    required,
)
from room2dgs.runs.metrics import MESH_SCORES, earlier, record, stale, timed

if TYPE_CHECKING:
    from room2dgs.eval.alignment import Alignment
    from room2dgs.eval.protocol import MeshFile
    from room2dgs.splat.types import Surfels

USAGE = "room2dgs eval run=DIR | pred=MESH gt=MESH scene=DIR [out=DIR] [eval.KEY=VALUE ...]"
SHORT = {"pred": "eval.pred", "gt": "eval.gt", "scene": "scene.path"}


def main(argv: list[str]) -> int:
    """Score an earlier run, or any mesh against a ground truth seen by a capture's cameras."""
    if asked_for_help(argv):
        return show(USAGE, main.__doc__, ("scene", "eval"))
    overrides = written_out(argv, SHORT | {"run": "out"})
    out = last_value(overrides, "out")
    if out and (Path(out).expanduser() / CONFIG).is_file():
        config = earlier_run(overrides)
        ground_truth(config)
        with at_work(config) as folder:
            scene = with_poses_of_run(read(config), folder)
            surfels = trained_surfels(folder) if config.mesh.of_surfels else None
            score_run(scene, surfels, config, folder, {})
    else:
        score_mesh(overrides, out)
    return 0


def score_mesh(overrides: list[str], out: str | None) -> None:
    """Score a mesh that no run made: its cameras come from the capture, its scores go to `out`.

    Raises:
        InputError: prediction or ground truth are not named or not there.
    """
    pred = last_value(overrides, "eval.pred")
    if not pred:
        raise InputError("nothing to score; give out=DIR of an earlier run, or pred=MESH gt=MESH scene=DIR")
    if not out:
        path = Path(pred).expanduser()
        overrides = [*overrides, f"out={path.with_name(path.stem + '_scores')}"]
    config = absolute(load_config(overrides))
    gt = ground_truth(config)
    check_regular(Path(config.eval.pred), "give pred=MESH")
    scene = read(config)
    gt = gt or scene.gt_mesh
    if gt is None:
        raise InputError(f"{config.scene.path} has no gt_mesh.ply; give gt=MESH")
    folder = Path(config.out)
    refuse_links_out(folder, ("eval",))
    seconds: dict[str, float] = {}
    with owned(folder):
        with timed(seconds, "eval"):
            part = _mesh_part(Path(config.eval.pred), gt, scene, config.eval, folder, to_terminal)
        record(folder, stale(folder, MESH_SCORES) | part, seconds)
    to_terminal(f"scores: {folder / METRICS}, pictures: {folder / 'eval'}")


def score_run(scene: Scene, surfels: Surfels | None, config: Config, out: Path, seconds: dict[str, float]) -> None:
    """Held-out views against their photos, if there are surfels, and the mesh against the truth, if there is one."""
    log = run_log(out)
    use_threads(config)
    gt = ground_truth(config) or scene.gt_mesh
    with timed(seconds, "eval"):
        part = _image_part(scene, surfels, config, log) if surfels is not None and config.eval.image_metrics else {}
        if gt is None:
            log("no ground truth (gt_mesh.ply in the capture, or eval.gt=MESH): the mesh is not scored")
        else:
            pred = Path(config.eval.pred) if config.eval.pred else out / MESH
            part |= stale(out, MESH_SCORES) | _mesh_part(required(pred, "mesh"), gt, scene, config.eval, out, log)
            if config.eval.align == "none":
                part |= same_depth_part(scene, gt, config, earlier(out).get("depth_source", ""), log)
            log(f"pictures of the error: {out / 'eval'}")
    record(out, part, seconds)
    log(f"scores: {out / METRICS}")


def ground_truth(config: Config) -> Path | None:
    """The mesh that eval.gt names, or None.

    Raises:
        InputError: it is not there, or no file.
    """
    if not config.eval.gt:
        return None
    path = Path(config.eval.gt)
    check_regular(path, "give eval.gt the path of the ground-truth mesh")
    return path


def _mesh_part(pred: Path, gt: Path, scene: Scene, settings: EvalConfig, out: Path, log: Log) -> dict[str, Any]:
    """The mesh's scores, logged, with pictures of the error in the folder `eval`."""
    from room2dgs.eval import evaluate, write_pictures
    from room2dgs.eval.placement import misplaced
    from room2dgs.eval.protocol import load

    truth = _true_scene(settings)
    origin_m = scene.origin_m if truth is None else truth.origin_m
    meshes = load(pred, scene.origin_m), load(gt, origin_m)
    frames, part = scene.frames, {"align": "none"}
    if settings.align != "none":
        found = alignment(meshes, scene, truth, settings)
        log(found.line())
        meshes, frames = _in_truth_frame(meshes, frames, found)
        part = {"align": found.between_worlds(scene.origin_m, origin_m).as_dict()}
    doubt = misplaced(meshes[0].mesh, meshes[1].mesh)
    if doubt:
        log(f"WARNING: {doubt}")
    options = {"threshold_m": settings.threshold_m, "samples": settings.samples, "seed": settings.seed}
    found = evaluate(*meshes, [frame.camera for frame in frames], settings.protocols, **options)
    write_pictures(found, frames, out / "eval", origin_m)
    for line in found.lines():
        in_lines(log, line)
    return part | found.as_dict()


def _true_scene(settings: EvalConfig) -> Scene | None:
    """The capture with the true poses, if the mesh is to be aligned by it."""
    from room2dgs.captures.read import placed

    if settings.align == "none" or not settings.align_scene:
        return None
    return placed(load_config([f"scene.path={settings.align_scene}", "out=unused", "scene.test_every=0"]).scene)


def alignment(meshes: tuple[MeshFile, MeshFile], scene: Scene, truth: Scene | None, settings: EvalConfig) -> Alignment:
    """What brings the mesh and the scene's cameras to the ground truth, all in their scenes' frames.

    Args:
        truth: the capture with the true poses.

    Raises:
        InputError: as `by_cameras` and `by_surfaces`, or a capture is needed and not given.
    """
    from room2dgs.eval.alignment import by_cameras, by_surfaces

    by = None
    if truth is not None:
        centres = {frame.name: frame.camera.centre for frame in scene.frames}
        by = by_cameras(centres, {frame.name: frame.camera.centre for frame in truth.frames}, settings.align_scale)
    if settings.align == "cameras":
        if by is None:
            raise InputError("eval.align=cameras needs the true poses; give eval.align_scene=DIR of that capture")
        return by
    start = None if by is None else by.truth_from_pred
    return by_surfaces(meshes[0].mesh, meshes[1].mesh, start, settings.align_scale, settings.seed)


def _in_truth_frame(
    meshes: tuple[MeshFile, MeshFile], frames: tuple[Frame, ...], found: Alignment
) -> tuple[tuple[MeshFile, MeshFile], tuple[Frame, ...]]:
    from room2dgs.eval.alignment import moved_camera, moved_mesh

    pred = replace(meshes[0], mesh=moved_mesh(meshes[0].mesh, found.truth_from_pred))
    moved = tuple(replace(frame, camera=moved_camera(frame.camera, found.truth_from_pred)) for frame in frames)
    return (pred, meshes[1]), moved


def _image_part(scene: Scene, surfels: Surfels, config: Config, log: Log) -> dict[str, Any]:
    from room2dgs.eval import image_scores

    if not scene.test:
        log("no view is held out (scene.test_every=0): no image scores")
        return {}
    views = rendered(surfels, scene.test, config)
    scores = image_scores((frame.name, view.color.numpy(), frame.color(), frame.mask()) for frame, view in views)
    log(f"{len(scene.test)} held-out views: PSNR {scores['psnr_db']:.2f} dB, SSIM {scores['ssim']:.3f}")
    return {"psnr_db": scores["psnr_db"], "ssim": scores["ssim"], "test_views": scores["views"]}
