"""`room2dgs bench table CAPTURE...`: the methods of the paper's Table I and parts of ours, on one's own captures."""

from __future__ import annotations

import shlex
from pathlib import Path

from room2dgs.commands import ablate
from room2dgs.commands.bench_prior import split_scenes
from room2dgs.commands.settings_help import asked_for_help, show
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.pipeline.evaluate import evaluate_mesh
from room2dgs.runs.folder import absolute, last_value

USAGE = "room2dgs bench table CAPTURE... out=DIR [other=NAME:FILE] [experiment=A,B] [KEY=VALUE ...]"
HELP = """Runs plain 3DGS, one like RaDe-GS, plain 2DGS, one like PGSR, and room2dgs with and without its parts on
captures with ground truth: F-scores, PSNR, minutes and primitives as one table and one picture, published figures
beside them.

For example: room2dgs bench table room out=table
Rows take 1,500 iterations and make no pages of their own, unless the settings say otherwise.
Each capture is an ablation (`room2dgs ablate`) in out/<capture>/runs; what is finished is not run again.
other=NAME:FILE scores a mesh of another program in the capture's world. The files are bench_table.html and
bench_table.csv.
"""
OURS = ("out", "other", "scene.path", "resume")
BRIEF = ("train.seed=0", "train.iterations=1500", "export.textured=false", "report.enabled=false")


def main(argv: list[str]) -> int:
    """Run, score, write.

    Raises:
        InputError: settings that cannot be; as `ablate` and `eval`.
    """
    if asked_for_help(argv):
        return show(argv, USAGE, HELP, ("scene", "train", "eval"))
    from room2dgs.eval.geometry_scores import threshold_name
    from room2dgs.study.ablation_report import JSON
    from room2dgs.study.method_table import HTML, METHODS, Line, line_of_mesh, lines_of_study, write_report
    from room2dgs.study.method_table import OURS as PARTS

    out = last_value(argv, "out")
    if not out:
        raise InputError("out is not given; add out=DIR")
    folder = Path(out).expanduser().absolute()
    captures, settings = split_scenes([text for text in argv if text.partition("=")[0] not in OURS])
    meshes = [parsed(text) for text in argv if text.startswith("other=")]
    rows = [f"experiment={','.join((*METHODS, *PARTS))}", *BRIEF, *settings]
    scoring = [text for text in settings if text.startswith(("scene.", "eval."))]
    threshold = threshold_name(load_config([*scoring, "scene.path=any", "out=any"]).eval.threshold_m)
    command = shlex.join(["room2dgs", "bench", "table", *argv])
    lines: list[Line] = []
    code = 0
    for capture in captures:
        name = Path(capture).name
        code = ablate.main([f"scene.path={capture}", f"out={folder / name / 'runs'}", *rows]) or code
        lines += lines_of_study(name, folder / name / "runs" / JSON)
        for label, mesh in meshes:
            scores = folder / name / f"scores_{label}"
            places = [f"scene.path={capture}", f"eval.pred={mesh}", f"out={scores}"]
            evaluate_mesh(absolute(load_config([*scoring, *places])))
            lines.append(line_of_mesh(name, label, scores, threshold))
        text = write_report(folder, lines, command, threshold)
    print(text)
    print(f"report: {folder / HTML}")
    return code


def parsed(text: str) -> tuple[str, Path]:
    """The name and the file of other=NAME:FILE.

    Raises:
        InputError: it is not of this form, or there is no such file.
    """
    name, colon, file = text.partition("=")[2].partition(":")
    path = Path(file).expanduser()
    if not (name and colon and file):
        raise InputError(f"{text} is not understood; write other=NAME:FILE")
    if not path.is_file():
        raise InputError(f"{text}: {path} is no file")
    return name, path
