"""Scores: of a run's mesh and held-out views, or of any mesh, against the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from room2dgs.captures.scene import Frame, Scene
from room2dgs.config import Config, EvalConfig, load_config
from room2dgs.errors import InputError
from room2dgs.links_out import refuse_links_out
from room2dgs.logs import Log, in_lines, to_terminal
from room2dgs.owner import owned
from room2dgs.pipeline.depth_scores import depth_figures
from room2dgs.pipeline.exposure import with_noted_exposure
from room2dgs.pipeline.run_folder import RunFolder
from room2dgs.pipeline.same_depth import same_depth_figures
from room2dgs.pipeline.scene import read_capture
from room2dgs.pipeline.surfels import render_frames, use_threads
from room2dgs.pipeline.truth import truth_in_scene
from room2dgs.registries.protocols import DEPTH as DEPTH_TRUTH
from room2dgs.registries.protocols import MESH as MESH_TRUTH
from room2dgs.registries.protocols import against
from room2dgs.regular_files import check_regular
from room2dgs.runs.folder import MESH, METRICS, required
from room2dgs.runs.metrics import MESH_SCORES, cleared, read_metrics

if TYPE_CHECKING:
    from room2dgs.eval.alignment import Alignment
    from room2dgs.eval.protocol import MeshFile
    from room2dgs.primitives.primitive import Splats


def evaluate_run(scene: Scene, surfels: Splats | None, config: Config, run: RunFolder) -> None:
    """Held-out views against their photos, if there are surfels, and the mesh against the truth, if there is one.

    With protocol `depth` also the mesh and the surfels against the capture's depth maps.

    Raises:
        InputError: no mesh, or as `ground_truth` and `alignment`.
    """
    use_threads(config)
    gt = ground_truth(config) or scene.gt_mesh
    by_mesh, by_depth = (against(truth, config.eval.protocols) for truth in (MESH_TRUTH, DEPTH_TRUTH))
    figures: dict[str, Any] = {}
    with run.timed("eval"):
        if surfels is not None and config.eval.image_metrics:
            figures = _image_scores(with_noted_exposure(scene, run.path), surfels, config, run.log)
        mesh = Path(config.eval.pred) if config.eval.pred else run.path / MESH
        if by_depth or (by_mesh and gt is not None):
            figures |= cleared(run.path, MESH_SCORES)
        if by_depth:
            source = read_metrics(run.path).get("depth_source", "")
            figures |= depth_figures(required(mesh, "mesh"), scene, surfels, config, source, run.log)
        if gt is None:
            has_depth = not by_depth and any(frame.depth_path for frame in scene.frames)
            also = "; eval.protocols=[depth] compares it with the capture's depth maps" if has_depth else ""
            run.log(f"no ground truth (gt_mesh.ply in the capture, or eval.gt=MESH): the mesh is not scored{also}")
        elif by_mesh:
            figures |= _mesh_scores(required(mesh, "mesh"), gt, scene, config.eval, run.path, run.log)
            if config.eval.align == "none":
                source = read_metrics(run.path).get("depth_source", "")
                figures |= same_depth_figures(scene, gt, config, source, run.log)
            run.log(f"pictures of the error: {run.path / 'eval'}")
        if mesh.is_file():
            figures |= _quality(mesh, gt, scene, config, run.path, run.log)
    run.record(figures)
    run.log(f"scores: {run.path / METRICS}")


def evaluate_mesh(config: Config, log: Log = to_terminal) -> Path:
    """Scores a mesh that no run made: its cameras come from the capture.

    Args:
        config: `eval.pred` is the mesh, `eval.gt` the truth unless the capture has one. Protocol `depth` alone needs
            no truth but the capture's depth maps.

    Returns:
        The folder that the scores went to, which is config.out.

    Raises:
        InputError: prediction or ground truth are not named or not there, or no photo has the depth asked for.
    """
    gt = ground_truth(config)
    pred = Path(config.eval.pred or "")
    check_regular(pred, "give pred=MESH")
    scene = read_capture(config)
    gt = gt or scene.gt_mesh
    by_mesh, by_depth = (against(truth, config.eval.protocols) for truth in (MESH_TRUTH, DEPTH_TRUTH))
    if not by_mesh and not any(frame.depth_path for frame in scene.frames):
        raise InputError(
            f"{config.scene.path} has no depth maps, which protocol depth needs; give gt=MESH and another protocol"
        )
    run = RunFolder(Path(config.out), log)
    refuse_links_out(run.path, ("eval",))
    with owned(run.path):
        with run.timed("eval"):
            scores: dict[str, Any] = {}
            if by_depth:
                scores = depth_figures(pred, scene, None, config, "", log)
            if by_mesh and gt is not None:
                scores |= _mesh_scores(pred, gt, scene, config.eval, run.path, log)
            elif by_mesh:
                log(f"{config.scene.path} has no gt_mesh.ply: without gt=MESH nothing says how far the mesh is off")
            scores |= _quality(pred, gt, scene, config, run.path, log)
        run.record(cleared(run.path, MESH_SCORES) | scores)
    log(f"scores: {run.path / METRICS}, pictures: {run.path / 'eval'}")
    return run.path


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


def alignment(meshes: tuple[MeshFile, MeshFile], scene: Scene, truth: Scene | None, settings: EvalConfig) -> Alignment:
    """What brings the mesh and the scene's cameras to the ground truth, all in their scenes' frames.

    Args:
        meshes: prediction and ground truth.
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


def _mesh_scores(pred: Path, gt: Path, scene: Scene, settings: EvalConfig, out: Path, log: Log) -> dict[str, Any]:
    """The mesh's scores, logged, with pictures of the error in the folder `eval`."""
    from room2dgs.eval import evaluate, write_pictures
    from room2dgs.eval.placement import misplaced
    from room2dgs.eval.protocol import load

    truth = _true_scene(settings)
    origin_m = scene.origin_m if truth is None else truth.origin_m
    in_capture = truth is None and settings.align == "none"
    meshes = load(pred, scene.origin_m), truth_in_scene(gt, scene) if in_capture else load(gt, origin_m)
    frames = scene.frames
    scores: dict[str, Any] = {"align": "none"}
    if settings.align != "none":
        found = alignment(meshes, scene, truth, settings)
        log(found.line())
        meshes, frames = _in_truth_frame(meshes, frames, found)
        scores = {"align": found.between_worlds(scene.origin_m, origin_m).as_dict()}
    doubt = misplaced(meshes[0].mesh, meshes[1].mesh)
    if doubt:
        log(f"WARNING: {doubt}")
    result = evaluate(
        *meshes,
        [frame.camera for frame in frames],
        against(MESH_TRUTH, settings.protocols),
        threshold_m=settings.threshold_m,
        samples=settings.samples,
        seed=settings.seed,
    )
    write_pictures(result, frames, out / "eval", origin_m)
    for line in result.lines():
        in_lines(log, line)
    return scores | result.as_dict()


def _quality(mesh: Path, gt: Path | None, scene: Scene, config: Config, out: Path, log: Log) -> dict[str, Any]:
    """How whole the mesh is; a truth in another frame stays aside."""
    from room2dgs.mesh.world import read_in_scene
    from room2dgs.pipeline.mesh_quality import quality_figures

    truth = truth_in_scene(gt, scene).mesh if gt is not None and config.eval.align == "none" else None
    return quality_figures(read_in_scene(mesh, scene.origin_m), scene, config, out, truth, log)


def _true_scene(settings: EvalConfig) -> Scene | None:
    """The capture with the true poses, if the mesh is to be aligned by it."""
    from room2dgs.captures.read import placed

    if settings.align == "none" or not settings.align_scene:
        return None
    return placed(load_config([f"scene.path={settings.align_scene}", "out=unused", "scene.test_every=0"]).scene)


def _in_truth_frame(
    meshes: tuple[MeshFile, MeshFile], frames: tuple[Frame, ...], found: Alignment
) -> tuple[tuple[MeshFile, MeshFile], tuple[Frame, ...]]:
    from room2dgs.eval.alignment import transformed_camera, transformed_mesh

    pred = replace(meshes[0], mesh=transformed_mesh(meshes[0].mesh, found.truth_from_pred))
    aligned = tuple(replace(frame, camera=transformed_camera(frame.camera, found.truth_from_pred)) for frame in frames)
    return (pred, meshes[1]), aligned


def _image_scores(scene: Scene, surfels: Splats, config: Config, log: Log) -> dict[str, Any]:
    from room2dgs.eval import image_scores
    from room2dgs.eval.image_metrics import SCORES

    if not scene.test:
        log("no view is held out (scene.test_every=0): no image scores")
        return {}
    views = render_frames(surfels, scene.test, config)
    scores = image_scores(
        (frame.name, frame.exposed(view.color.numpy()), frame.color(), frame.mask()) for frame, view in views
    )
    fitted = f"{scores['psnr_fitted_db']:.2f} dB after an affine colour fit of each photo"
    log(f"{len(scene.test)} held-out views: PSNR {scores['psnr_db']:.2f} dB ({fitted}), SSIM {scores['ssim']:.3f}")
    return {**{key: scores[key] for key in SCORES}, "test_views": scores["views"]}
