"""Tables in the columns of the paper's Table I, and the lists of its scenes."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from room2dgs import cli
from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.json_files import update_json
from room2dgs.runs.folder import write_config
from room2dgs.study.scene_lists import expanded, lists
from room2dgs.study.score_table import Score, as_csv, as_html, as_latex, as_markdown, dataset_of, means, notes

FIGURES = ("accuracy_m", "completion_m", "precision", "recall", "f_score")
A, B, PLUS = "scene0050_00", "scene0085_00", "8b5caf3398"


def score(method: str, scene: str, *values: float) -> Score:
    return Score(method, scene, dict(zip(FIGURES, values, strict=True)))


SCORES = (
    score("ours", A, 0.05, 0.09, 0.6, 0.5, 0.55),
    score("ours", B, 0.07, 0.11, 0.8, 0.7, 0.75),
    score("ours", B, 0.09, 0.13, 0.6, 0.5, 0.55),  # another seed
    score("ours", PLUS, 0.26, 0.11, 0.45, 0.5, 0.46),
    score("2DGS & co", A, 0.04, 0.15, 0.3, 0.3, 0.3),
    Score("2DGS & co", B, {}, "mesh is empty"),
)


def test_means_are_over_scenes_not_runs_and_by_dataset():
    frame = means(SCORES)
    assert frame.loc["ours", ("ScanNet", "Acc.")] == pytest.approx((0.05 + 0.08) / 2)
    assert frame.loc["ours", ("ScanNet", "F-score")] == pytest.approx((0.55 + 0.65) / 2)
    assert frame.loc["ours", ("ScanNet++", "Acc.")] == 0.26
    assert frame.loc["2DGS & co"].isna().sum() == 5
    assert [dataset_of(one) for one in (A, PLUS, "kitchen")] == ["ScanNet", "ScanNet++", "other scenes"]


def test_failures_and_missing_scenes_are_named():
    said = notes(SCORES)
    assert said[0] == f"2DGS & co, {B}: mesh is empty"
    assert said[1] == f"2DGS & co: mean of 1 of 2 scenes of ScanNet, without {B}"


def test_the_best_of_a_column_is_bold_low_or_high_as_its_arrow_says():
    ours, other = (line for line in as_latex(SCORES, "t").splitlines() if line.startswith(("ours", "2DGS")))
    assert ours.startswith("ours & 0.065 & \\textbf{0.105} & \\textbf{0.650}")
    assert other.startswith("2DGS \\& co & \\textbf{0.040} & 0.150 & 0.300")
    assert "Acc. $\\downarrow$ & Comp. $\\downarrow$ & Prec. $\\uparrow$" in as_latex(SCORES, "t")
    assert "<td>2DGS &amp; co</td><td><b>0.040</b></td>" in as_html(SCORES, "t")
    assert "| 2DGS & co | **0.040** " in " ".join(as_markdown(SCORES, "t").split())


def test_csv_has_a_line_for_each_mesh():
    rows = list(csv.DictReader(io.StringIO(as_csv(SCORES))))
    assert len(rows) == 6 and float(rows[2]["recall"]) == 0.5 and rows[5]["failed"] == "mesh is empty"


def test_scene_lists_become_captures_and_settings():
    assert lists() == ["scannet_manhattan", "scannet_paper", "scannetpp_paper"]
    found = expanded(["scenes=scannet_paper", "root=/data", "scene.image_width=320", "out=x"])
    paths = [text for text in found if "=" not in text]
    assert len(paths) == 8 and paths[0] == "/data/scene0050_00" and dataset_of(Path(paths[3]).name) == "ScanNet"
    assert "scene.test_every=10" in found and found.count("scene.image_width=640") == 0
    settings = [text for text in found if "=" in text]
    for name in lists():
        load_config(
            [*(text for text in expanded([f"scenes={name}", "root=r", "out=x"]) if "=" in text), "scene.path=a"]
        )
    assert load_config([*settings, "scene.path=a"]).eval.protocols == ["neuris", "area"]
    assert len([text for text in expanded(["scenes=scannetpp_paper", "root=r"]) if "=" not in text]) == 4
    with pytest.raises(InputError, match="scannet_paper"):
        expanded(["scenes=mine", "root=r"])
    with pytest.raises(InputError, match="root=DIR"):
        expanded(["scenes=scannet_paper"])


def test_meshes_of_others_are_scored_beside_a_run_once_and_failures_do_not_stop(wall, tmp_path, capsys):
    run, meshes, out = tmp_path / "run", tmp_path / "meshes", tmp_path / "table"
    run.mkdir()
    write_config(run, load_config([f"scene.path={wall}", f"out={run}", "eval.samples=2000"]))
    at = {f"{figure}_5cm": 0.5 for figure in ("precision", "recall", "f_score")}
    update_json(run / "metrics.json", {"protocols": {"area": {"accuracy_m": 0.01, "completion_m": 0.02, **at}}})
    (meshes / "exact").mkdir(parents=True)
    (meshes / "exact/wall.ply").write_bytes((wall / "gt_mesh.ply").read_bytes())
    (meshes / "exact/attic.ply").write_bytes(b"")
    (meshes / "torn").mkdir()
    (meshes / "torn/wall.ply").write_bytes(b"ply\n")
    command = ["table", str(run), f"meshes={meshes}", f"out={out}"]
    assert cli.main(command) == 2
    rows = {(row["method"], row["scene"]): row for row in csv.DictReader(io.StringIO((out / "table.csv").read_text()))}
    assert float(rows["exact", "wall"]["f_score"]) == pytest.approx(1)
    assert float(rows["room2dgs", "wall"]["completion_m"]) == 0.02
    assert "decoded" in rows["torn", "wall"]["failed"] and "no run's capture" in rows["exact", "attic"]["failed"]
    assert {path.name for path in out.iterdir()} == {"table.csv", "table.md", "table.html", "table.tex", "scores"}
    assert "scored" in capsys.readouterr().out
    assert cli.main(command) == 2
    assert "scored /" not in capsys.readouterr().out
    kept = out / "scores/exact/wall.json"
    known = json.loads(kept.read_text())
    for damaged in (
        "{",
        "[1]",
        json.dumps({**known, "values": {"f_score": "high"}}),
        json.dumps({**known, "values": 5}),
    ):
        kept.write_text(damaged)  # made again
        assert cli.main(command) == 2
        assert "scored /" in capsys.readouterr().out and json.loads(kept.read_text()) == known


def run_of(folder: Path, capture: Path, f_score: float, *settings: str, same_depth: bool = False) -> str:
    folder.mkdir(parents=True)
    write_config(folder, load_config([f"scene.path={capture}", f"out={folder}", *settings]))
    at = {f"{figure}_5cm": f_score for figure in ("precision", "recall", "f_score")}
    scores = {"protocols": {"area": {"accuracy_m": 0.01, "completion_m": 0.02, **at}}}
    update_json(folder / "metrics.json", {**scores, "truth_from_same_depth": same_depth})
    return str(folder)


def rows_of(out: Path) -> list[list[str]]:
    lines = (out / "table.md").read_text().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]


def test_two_runs_of_a_capture_with_other_settings_are_rows_of_their_own(wall, tmp_path):
    runs = [run_of(tmp_path / "fine", wall, 0.8), run_of(tmp_path / "coarse", wall, 0.6, "mesh.voxel_m=0.1")]
    assert cli.main(["table", *runs, f"out={tmp_path / 'table'}"]) == 0
    rows = {row[0]: row[-1] for row in rows_of(tmp_path / "table")[2:4]}
    assert rows == {"fine": "**0.800**", "coarse": "0.600"}
    assert cli.main(["table", *runs, f"out={tmp_path / 'named'}", "name=mine"]) == 0
    assert rows_of(tmp_path / "named")[2][0::5] == ["mine", "0.700"]  # and nothing to be better than


def test_runs_that_differ_by_their_seed_are_one_row(wall, tmp_path):
    runs = [run_of(tmp_path / f"{seed}", wall, 0.5 + seed / 10, f"train.seed={seed}") for seed in (1, 2)]
    assert cli.main(["table", *runs, f"out={tmp_path / 'table'}"]) == 0
    assert rows_of(tmp_path / "table")[2][0::5] == ["room2dgs", "0.650"]


def test_the_methods_of_two_suites_are_called_by_their_folders(wall, tmp_path):
    for suite, voxel in (("a", 0.02), ("b", 0.05)):
        run_of(tmp_path / suite / wall.name, wall, 0.5, f"mesh.voxel_m={voxel}")
    assert cli.main(["table", str(tmp_path / "a"), str(tmp_path / "b"), f"out={tmp_path / 'table'}"]) == 0
    assert [row[0] for row in rows_of(tmp_path / "table")[2:4]] == ["a", "b"]


def test_a_score_against_a_truth_of_the_same_depth_is_marked_and_never_the_best(wall, tmp_path):
    runs = [
        run_of(tmp_path / "sensor", wall, 0.9, same_depth=True),
        run_of(tmp_path / "photos", wall, 0.6, "mesh.voxel_m=0.1"),
    ]
    out = tmp_path / "table"
    assert cli.main(["table", *runs, f"out={out}"]) == 0
    rows = {row[0]: row[-1] for row in rows_of(out)[2:4]}
    assert rows == {"sensor": "0.900†", "photos": "**0.600**"}
    assert "0.900†" in rows_of(out)[-2][-1] + rows_of(out)[-1][-1]  # of the list of all scores, too
    assert "† the truth was made from the depth that the run used" in (out / "table.md").read_text()
    assert "$^\\dagger$" in (out / "table.tex").read_text()
    made = list(csv.DictReader(io.StringIO((out / "table.csv").read_text())))
    assert [row["truth_from_same_depth"] for row in made] == ["True", "False"]


def test_a_run_with_strange_figures_is_named_and_the_rest_goes_on(tmp_path, capsys):
    for run, scores in (("good", {"accuracy_m": 0.01}), ("strange", "high")):
        (tmp_path / run).mkdir()
        write_config(tmp_path / run, load_config([f"scene.path={tmp_path / run}", f"out={tmp_path / run}"]))
        (tmp_path / run / "metrics.json").write_text(json.dumps({"protocols": {"area": scores}}))
    assert cli.main(["table", str(tmp_path / "good"), str(tmp_path / "strange"), f"out={tmp_path / 'table'}"]) == 2
    rows = {row["scene"]: row for row in csv.DictReader(io.StringIO((tmp_path / "table/table.csv").read_text()))}
    assert "protocols is no object of scores" in rows["strange"]["failed"]
    assert "not scored by area" in rows["good"]["failed"]


def test_captures_with_folders_of_one_name_are_scenes_of_their_own(tmp_path):
    """Those made of videos lie in their runs as "capture"."""
    places = {"first": "first/capture", "second": "second/capture", "a": "x/hall", "b": "y/hall"}
    for run, capture in places.items():
        (tmp_path / run).mkdir()
        write_config(tmp_path / run, load_config([f"scene.path={tmp_path / capture}", f"out={tmp_path / run}"]))
        at = {f"{figure}_5cm": 0.5 for figure in ("precision", "recall", "f_score")}
        update_json(
            tmp_path / run / "metrics.json", {"protocols": {"area": {"accuracy_m": 0.01, "completion_m": 0.02, **at}}}
        )
    assert cli.main(["table", *(str(tmp_path / run) for run in places), f"out={tmp_path / 'table'}"]) == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "table/table.csv").read_text())))
    scenes = [row["scene"] for row in rows if row["scene"] and "mean" not in row["scene"]]
    assert {"first", "second"} <= set(scenes) and sum(scene.endswith("_hall") for scene in scenes) == 2


def test_meshes_are_not_compared_with_a_truth_in_another_frame(wall, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    write_config(run, load_config([f"scene.path={wall}", f"out={run}", "eval.align=icp"]))
    (tmp_path / "meshes/exact").mkdir(parents=True)
    (tmp_path / "meshes/exact/wall.ply").write_bytes((wall / "gt_mesh.ply").read_bytes())
    cli.main(["table", str(run), f"meshes={tmp_path / 'meshes'}", f"out={tmp_path / 'table'}"])
    rows = csv.DictReader(io.StringIO((tmp_path / "table/table.csv").read_text()))
    assert "eval.align=icp" in next(row["failed"] for row in rows if row["method"] == "exact")


def test_what_is_no_run_is_refused(tmp_path, capsys):
    assert cli.main(["table", str(tmp_path)]) == 2
    assert "holds no run" in capsys.readouterr().err
    assert cli.main(["table"]) == 2
    assert cli.main(["table", str(tmp_path), "train.seed=1"]) == 2
    assert "train.seed=1" in capsys.readouterr().err
