"""Scores of finished runs, and of meshes of other methods as those runs were scored, as one table."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.json_files import read_json, update_json
from room2dgs.logs import Log, to_terminal
from room2dgs.pipeline.evaluate import ground_truth
from room2dgs.pipeline.scene import scene_of_run
from room2dgs.pipeline.truth import truth_in_scene
from room2dgs.registries.protocols import MESH as MESH_TRUTH
from room2dgs.registries.protocols import against
from room2dgs.runs.folder import CAPTURE, CONFIG, MESH, earlier_run
from room2dgs.runs.metrics import read_metrics
from room2dgs.runs.schema import is_number
from room2dgs.study.score_table import FIGURES, Score, as_csv, as_html, as_latex, as_markdown, values_of

MESHES = (".ply", ".obj", ".off", ".stl", ".glb")
NO_METHOD = ("out", "resume", "strict", "memory", "report", "export")  # settings that make no other mesh
NO_METHOD_OF_TRAINING = ("seed", "viewer", "tensorboard", "log_every", "checkpoint_every")
SCORES, OURS = "scores", "room2dgs"


def write_score_table(
    folders: Sequence[str],
    out: Path,
    *,
    protocol: str | None = None,
    name: str | None = None,
    meshes: Path | None = None,
    log: Log = to_terminal,
) -> list[Score]:
    """table.csv, table.md, table.html and table.tex in `out`.

    Args:
        folders: of runs, or folders that hold some.
        protocol: whose scores; None: the first one of the first run.
        name: of the method that the runs are of; None: "room2dgs", or the names of the runs' folders where runs of one
            capture differ by more than their seed.
        meshes: folder with METHOD/SCENE.ply; they are scored by the cameras of the run of that scene, once.
        log: takes one line at a time.

    Returns:
        A score for each run and mesh; some may have failed.

    Raises:
        InputError: no run, a folder without any, or no mesh in `meshes`.
    """
    configs = [earlier_run([f"out={folder}"]) for folder in _runs_in(folders)]
    protocol = protocol or next(iter(against(MESH_TRUTH, configs[0].eval.protocols)), "area")
    if not against(MESH_TRUTH, [protocol]):
        raise InputError(f"protocol {protocol} compares with no ground truth; the table is of protocols that do")
    scenes = _scene_names(configs)
    methods = [name] * len(configs) if name else _methods(configs, scenes)
    scores = [
        _score_of_run(config, method, scene, protocol)
        for config, method, scene in zip(configs, methods, scenes, strict=True)
    ]
    if meshes is not None:
        first = {scene: config for scene, config in zip(scenes[::-1], configs[::-1], strict=True)}
        scores += _scores_of_meshes(meshes, first, protocol, out, log)
    title = f"Protocol {protocol}, {configs[0].eval.threshold_m * 100:g} cm"
    texts = {"table.csv": as_csv(scores), "table.md": as_markdown(scores, title)}
    texts |= {"table.html": as_html(scores, title), "table.tex": as_latex(scores, title)}
    for file, text in texts.items():
        with whole_file(out / file) as temporary:
            temporary.write_text(text, encoding="utf-8")
    print(texts["table.md"])
    log(f"tables: {out}")
    return scores


def _runs_in(given: Sequence[str]) -> list[Path]:
    found: list[Path] = []
    for text in given:
        folder = Path(text).expanduser()
        inside = (
            [folder] if (folder / CONFIG).is_file() else sorted(path.parent for path in folder.glob(f"*/**/{CONFIG}"))
        )
        if not inside:
            raise InputError(f"{folder} holds no run ({CONFIG} is missing); give folders of earlier runs")
        found += inside
    if not found:
        raise InputError("no run is given; name the folders of earlier runs: room2dgs table runs/a runs/b")
    return list(dict.fromkeys(found))


def _scene_names(configs: list[Config]) -> list[str]:
    """What each run's capture is called; one that was made in a run's folder has the run's name."""
    from room2dgs.study.suite import names

    paths = [Path(config.scene.path) for config in configs]
    known = {path: path.parent if path.name == CAPTURE else path for path in paths}
    called = dict(zip(known, names([str(path) for path in known.values()]), strict=True))
    return [called[path] for path in paths]


def _methods(configs: Sequence[Config], scenes: Sequence[str]) -> list[str]:
    """What each run's method is called: all alike, unless two runs of one capture have other settings than a seed."""
    kinds: dict[str, set[str]] = {}
    for config, scene in zip(configs, scenes, strict=True):
        kinds.setdefault(scene, set()).add(_settings_of(config))
    if all(len(one) == 1 for one in kinds.values()):
        return [OURS] * len(configs)
    folders = [Path(config.out) for config in configs]
    common = Path(os.path.commonpath([folder.parent for folder in folders]))
    # in the folders of two suites each run is called as its capture: the suites' names are the methods'
    parts = [folder.relative_to(common).parts for folder in folders]
    return [
        "/".join(part[:-1] if len(part) > 1 and part[-1] == scene else part)
        for part, scene in zip(parts, scenes, strict=True)
    ]


def _settings_of(config: Config) -> str:
    """All that may make a run of the same capture another method."""
    settings = {section: value for section, value in asdict(config).items() if section not in NO_METHOD}
    training = {key: value for key, value in settings["train"].items() if key not in NO_METHOD_OF_TRAINING}
    return repr({**settings, "train": training})


def _score_of_run(config: Config, name: str, scene: str, protocol: str) -> Score:
    from room2dgs.eval.geometry_scores import threshold_name

    try:
        metrics = read_metrics(Path(config.out))
    except InputError as error:
        return Score(name, scene, {}, str(error))
    values = values_of(metrics, protocol, threshold_name(config.eval.threshold_m))
    if values is not None:
        return Score(name, scene, values, same_depth=metrics.get("truth_from_same_depth") is True)
    if metrics.get("protocols"):
        why = f"not scored by {protocol}; run `room2dgs eval out={config.out} eval.protocols=[{protocol}]`"
    elif (Path(config.out) / MESH).is_file():
        why = f"not scored since its mesh was made; run `room2dgs eval out={config.out}`, if there is a ground truth"
    else:
        why = f"not finished: {config.out}"
    return Score(name, scene, {}, why)


def _scores_of_meshes(folder: Path, by_scene: dict[str, Config], protocol: str, out: Path, log: Log) -> list[Score]:
    """Raises InputError if there is none."""
    files = sorted(path for path in folder.glob("*/*") if path.suffix.lower() in MESHES)
    if not files:
        raise InputError(f"{folder} has no meshes; give meshes=DIR with DIR/METHOD/SCENE.ply")
    found = []
    for path in files:
        method, scene = path.parent.name, path.stem
        if scene not in by_scene:
            found.append(Score(method, scene, {}, f"{path} belongs to no run's capture ({', '.join(by_scene)})"))
            continue
        try:
            values = _score_mesh(path, by_scene[scene], protocol, out / SCORES / method / f"{scene}.json", log)
            found.append(Score(method, scene, values))
        except InputError as error:
            found.append(Score(method, scene, {}, str(error)))
    return found


def _score_mesh(path: Path, config: Config, protocol: str, file: Path, log: Log) -> dict[str, float]:
    """The mesh's figures, which are kept in a file for the next call."""
    from room2dgs.eval import evaluate
    from room2dgs.eval.geometry_scores import threshold_name
    from room2dgs.eval.protocol import load

    if config.eval.align != "none":
        raise InputError(
            f"{config.out} was scored with eval.align={config.eval.align}; meshes= are compared where they are, "
            "so give the run a truth in the capture's own frame"
        )
    scene = scene_of_run(config)
    gt = ground_truth(config) or scene.gt_mesh
    if gt is None:
        raise InputError(f"{config.scene.path} has no ground truth; give the run eval.gt=MESH")
    settings = config.eval
    key = hashlib.sha256(path.read_bytes() + gt.read_bytes())
    key.update(repr((protocol, settings.threshold_m, settings.samples, settings.seed, str(config.out))).encode())
    known = _kept_scores(file, key.hexdigest())
    if known is not None:
        return known
    result = evaluate(
        load(path, scene.origin_m),
        truth_in_scene(gt, scene),
        [frame.camera for frame in scene.frames],
        (protocol,),
        threshold_m=settings.threshold_m,
        samples=settings.samples,
        seed=settings.seed,
    )
    values = values_of(result.as_dict(), protocol, threshold_name(settings.threshold_m))
    if values is None:
        raise InputError(f"{path} has no surface that a camera sees; check its frame and its units")
    file.parent.mkdir(parents=True, exist_ok=True)
    update_json(file, {"key": key.hexdigest(), "values": values})
    log(f"scored {path}")
    return values


def _kept_scores(path: Path, key: str) -> dict[str, float] | None:
    """The scores of an earlier call; None: of another mesh or setting, or damaged, and then they are made again."""
    if not path.is_file():
        return None
    try:
        found = read_json(path)
    except InputError:
        path.unlink()
        return None
    values = found.get("values")
    whole = isinstance(values, dict) and set(values) == set(FIGURES) and all(map(is_number, values.values()))
    return values if whole and found.get("key") == key else None
