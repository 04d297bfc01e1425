"""`room2dgs table`: runs, and meshes of other methods, in the columns of the paper's Table I."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from room2dgs.commands.eval import ground_truth
from room2dgs.commands.settings_help import asked_for_help
from room2dgs.commands.stages import read, with_poses_of_run
from room2dgs.config import Config
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.json_files import read_json, update_json
from room2dgs.logs import to_terminal
from room2dgs.runs.folder import CAPTURE, CONFIG, MESH, earlier_run, last_value
from room2dgs.runs.metrics import earlier
from room2dgs.runs.schema import is_number

if TYPE_CHECKING:
    from room2dgs.study.score_table import Score

USAGE = "room2dgs table RUN... [out=table] [meshes=DIR] [protocol=NAME] [name=room2dgs]"
OURS = ("out", "meshes", "protocol", "name")
MESHES = (".ply", ".obj", ".off", ".stl", ".glb")
SCORES = "scores"


def main(argv: list[str]) -> int:
    """Write table.csv, table.md, table.html and table.tex of finished runs, with means over the scenes of each dataset.

    RUN is the folder of a run, or a folder of such (of a suite or a multirun). meshes=DIR has the meshes of other
    methods as DIR/METHOD/SCENE.ply, where SCENE is the name of a run's capture: they are scored as that run was, by its
    cameras against its truth. What was scored is kept in out/scores and not scored again; what fails is named, and
    the rest goes on. protocol= is the runs' first unless given.
    """
    if asked_for_help(argv):
        print(f"{USAGE}\n\n{main.__doc__}")
        return 0
    unknown = next((text for text in argv if "=" in text and text.partition("=")[0] not in OURS), None)
    if unknown and not Path(unknown).exists():
        raise InputError(f"{unknown} is not known here; give runs, and of settings {', '.join(OURS)} alone")
    given = [text for text in argv if text.partition("=")[0] not in OURS]
    configs = [earlier_run([f"out={folder}"]) for folder in _runs(given)]
    protocol = last_value(argv, "protocol") or str(configs[0].eval.protocols[0])
    out = Path(last_value(argv, "out") or "table").expanduser().absolute()
    scenes = _scenes(configs)
    name = last_value(argv, "name") or "room2dgs"
    scores = [_of_run(config, name, scene, protocol) for config, scene in zip(configs, scenes, strict=True)]
    meshes = last_value(argv, "meshes")
    if meshes:
        first = {scene: config for scene, config in zip(scenes[::-1], configs[::-1], strict=True)}
        scores += _of_meshes(Path(meshes).expanduser(), first, protocol, out)
    title = f"Protocol {protocol}, {configs[0].eval.threshold_m * 100:g} cm"
    return _written(scores, title, out)


def _written(scores: list[Score], title: str, out: Path) -> int:
    from room2dgs.study.score_table import as_csv, as_html, as_latex, as_markdown

    texts = {"table.csv": as_csv(scores), "table.md": as_markdown(scores, title)}
    texts |= {"table.html": as_html(scores, title), "table.tex": as_latex(scores, title)}
    for name, text in texts.items():
        with whole_file(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    print(texts["table.md"])
    to_terminal(f"tables: {out}")
    return 2 if any(score.failed for score in scores) else 0


def _runs(given: list[str]) -> list[Path]:
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


def _scenes(configs: list[Config]) -> list[str]:
    """What each run's capture is called; one that was made in a run's folder has the run's name."""
    from room2dgs.study.suite import names

    paths = [Path(config.scene.path) for config in configs]
    known = {path: path.parent if path.name == CAPTURE else path for path in paths}
    called = dict(zip(known, names([str(path) for path in known.values()]), strict=True))
    return [called[path] for path in paths]


def _of_run(config: Config, name: str, scene: str, protocol: str) -> Score:
    from room2dgs.eval.geometry_scores import threshold_name
    from room2dgs.study.score_table import Score, values_of

    try:
        metrics = earlier(Path(config.out))
    except InputError as error:
        return Score(name, scene, {}, str(error))
    values = values_of(metrics, protocol, threshold_name(config.eval.threshold_m))
    if values is not None:
        return Score(name, scene, values)
    if metrics.get("protocols"):
        why = f"not scored by {protocol}; run `room2dgs eval out={config.out} eval.protocols=[{protocol}]`"
    elif (Path(config.out) / MESH).is_file():
        why = f"not scored since its mesh was made; run `room2dgs eval out={config.out}`, if there is a ground truth"
    else:
        why = f"not finished: {config.out}"
    return Score(name, scene, {}, why)


def _of_meshes(folder: Path, by_scene: dict[str, Config], protocol: str, out: Path) -> list[Score]:
    """Raises InputError if there is none."""
    files = sorted(path for path in folder.glob("*/*") if path.suffix.lower() in MESHES)
    if not files:
        raise InputError(f"{folder} has no meshes; give meshes=DIR with DIR/METHOD/SCENE.ply")
    from room2dgs.study.score_table import Score

    found = []
    for path in files:
        method, scene = path.parent.name, path.stem
        if scene not in by_scene:
            found.append(Score(method, scene, {}, f"{path} belongs to no run's capture ({', '.join(by_scene)})"))
            continue
        try:
            values = _scored(path, by_scene[scene], protocol, out / SCORES / method / f"{scene}.json")
            found.append(Score(method, scene, values))
        except InputError as error:
            found.append(Score(method, scene, {}, str(error)))
    return found


def _scored(path: Path, config: Config, protocol: str, kept: Path) -> dict[str, float]:
    from room2dgs.eval import evaluate
    from room2dgs.eval.geometry_scores import threshold_name
    from room2dgs.eval.protocol import load
    from room2dgs.study.score_table import values_of

    if config.eval.align != "none":
        raise InputError(
            f"{config.out} was scored with eval.align={config.eval.align}; meshes= are compared where they are, "
            "so give the run a truth in the capture's own frame"
        )
    scene = with_poses_of_run(read(config), Path(config.out))
    gt = ground_truth(config) or scene.gt_mesh
    if gt is None:
        raise InputError(f"{config.scene.path} has no ground truth; give the run eval.gt=MESH")
    settings = config.eval
    key = hashlib.sha256(path.read_bytes() + gt.read_bytes())
    key.update(repr((protocol, settings.threshold_m, settings.samples, settings.seed, str(config.out))).encode())
    known = _kept(kept, key.hexdigest())
    if known is not None:
        return known
    options = {"threshold_m": settings.threshold_m, "samples": settings.samples, "seed": settings.seed}
    meshes = load(path, scene.origin_m), load(gt, scene.origin_m)
    result = evaluate(*meshes, [frame.camera for frame in scene.frames], (protocol,), **options)
    values = values_of(result.as_dict(), protocol, threshold_name(settings.threshold_m))
    if values is None:
        raise InputError(f"{path} has no surface that a camera sees; check its frame and its units")
    kept.parent.mkdir(parents=True, exist_ok=True)
    update_json(kept, {"key": key.hexdigest(), "values": values})
    to_terminal(f"scored {path}")
    return values


def _kept(path: Path, key: str) -> dict[str, float] | None:
    """The scores of an earlier call; None: of another mesh or setting, or damaged, and then they are made again."""
    from room2dgs.study.score_table import FIGURES

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
