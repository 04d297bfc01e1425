"""`tools/prior_error`: which runs it makes, with which priors, how it goes on, what it says."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from room2dgs.config import load_config
from room2dgs.errors import InputError
from room2dgs.runs.folder import new_run, write_config
from room2dgs.study import launch
from room2dgs.study.ablation import Run, rows_of
from room2dgs.tools.prior_error.__main__ import NOISE, NONE, main, planned, real_priors, simulated_priors
from room2dgs.tools.prior_error.curve import Curve, Point, Quality, interpolated, sentences

SCORES = {"no_prior": 0.2, "simulated_x_0.5": 0.8, "simulated_x_1": 0.6, "pure_noise": 0.1}


@pytest.fixture
def room(wall, tmp_path) -> Path:
    """Four photos of the wall, with the depth of a slope: of one depth alone, a shift would explain any error."""
    folder = tmp_path / "room"
    shutil.copytree(wall, folder)
    (folder / "depth").mkdir()
    for photo in sorted((folder / "color").iterdir()):
        height, width = cv2.imread(str(photo)).shape[:2]
        if photo.stem in "0246":
            slope = np.tile(np.linspace(1500, 4000, height)[:, None], width)
            cv2.imwrite(str(folder / "depth" / photo.name), slope.astype(np.uint16))
        else:
            photo.unlink()
    return folder


class FakeRuns:
    """Stands for the processes: writes what a finished run leaves, or fails as told."""

    def __init__(self) -> None:
        self.made: list[str] = []
        self.failing = ""

    def __call__(self, command: list[str]) -> subprocess.CompletedProcess:
        config = new_run(command[command.index("run") + 1 :])
        out = Path(config.out)
        row = out.parent.name
        self.made.append(f"{row}/{out.name}")
        depth = config.prior.depth
        assert depth.source != "files" or any(Path(depth.path or "").iterdir())  # the maps were made before
        out.mkdir(parents=True, exist_ok=True)
        write_config(out, config)
        if row == self.failing:
            return subprocess.CompletedProcess(command, 2, None, "room2dgs: no luck\n")
        score = {name.replace(" ", "_"): score for name, score in SCORES.items()}.get(
            row, 0.5
        ) + 0.01 * config.train.seed
        scores = {"f_score_5cm": score, "protocol": "area", "protocols": {"area": {"f_score_2cm": score / 2}}}
        metrics = {**scores, "seconds": {"train": 60.0, "eval": 1.0}, "primitives": 10, "priors": depth.source}
        (out / "metrics.json").write_text(json.dumps(metrics))
        return subprocess.CompletedProcess(command, 0, None, "")


@pytest.fixture
def fake(monkeypatch) -> FakeRuns:
    runs = FakeRuns()
    monkeypatch.setattr(launch, "ended", runs)
    return runs


def bench(room: Path, out: Path, *more: str) -> int:
    return main([f"scene.path={room}", f"out={out}", "factors=0.5,1", *more])


def saved(out: Path) -> dict[str, dict]:
    return {point["name"]: point for point in json.loads((out / "prior_error.json").read_text())["points"]}


def files_point(room: Path, name: str = "sensor") -> str:
    return f"point={name}: prior/depth=files prior.depth.path={room / 'depth'} prior/normal=none"


def test_each_quality_runs_with_its_own_maps_and_stands_at_its_measured_error(room, tmp_path, fake):
    out = tmp_path / "out"
    assert bench(room, out, files_point(room)) == 0
    rows = ("no_prior", "simulated_x_0.5", "simulated_x_1", "pure_noise", "sensor")
    assert fake.made == [f"{row}/seed_0" for row in rows]
    points = saved(out)
    assert [point["kind"] for point in points.values()] == ["none", "simulated", "simulated", "noise", "real"]
    assert [name for name, point in points.items() if point["simulated"]] == ["simulated x 0.5", "simulated x 1", NOISE]
    assert points[NONE]["quality"] is None
    angles = [points[f"simulated x {factor}"]["quality"]["normal_deg"] for factor in ("0.5", "1")]
    # 8-bit normals of 64 x 48 pixels, on some of the frames
    assert angles == [pytest.approx(8, rel=0.3), pytest.approx(16, rel=0.3)]
    depths = [points[f"simulated x {factor}"]["quality"]["abs_rel"] for factor in ("0.5", "1")]
    assert depths == [pytest.approx(0.025, rel=0.3), pytest.approx(0.05, rel=0.3)]
    assert points["sensor"]["quality"]["abs_rel"] == pytest.approx(0.0, abs=1e-6)
    assert points["simulated x 0.5"]["values"]["f_score"]["mean"] == 0.8
    config = load_config((), out / "runs/simulated_x_1/seed_0/config.yaml")
    assert config.prior.normal.path == str(out / "simulated/x1/normal")
    assert (config.points.cache, config.train.iterations) == (str(out / "points"), 1000)
    text = (out / "prior_error.md").read_text(encoding="utf-8")
    assert "simulated priors" in text and "| simulated x 1 | 0.0" in text and "| 0.600 | 0.300 |" in text
    page = (out / "prior_error.html").read_text(encoding="utf-8")
    assert page.count("<img") == 1 and "made from the ground truth" in page and not re.search(r"https?:|<script", page)
    assert "<svg" in (out / "prior_error.svg").read_text(encoding="utf-8")


def test_what_is_there_is_neither_run_nor_made_nor_measured_again(room, tmp_path, fake, monkeypatch):
    out = tmp_path / "out"
    assert bench(room, out) == 0
    fake.made.clear()
    from room2dgs.bench import prior as bench_prior
    from room2dgs.tools.prior_error import __main__ as prior_error

    for module, name in ((prior_error, "simulate_priors"), (bench_prior, "measured_scenes")):
        monkeypatch.setattr(module, name, lambda *_, **__: pytest.fail("done twice"))
    before = saved(out)
    assert bench(room, out) == 0
    assert fake.made == [] and saved(out) == before
    assert bench(room, out, "train.seed=0,1") == 0
    assert fake.made == [f"{row}/seed_1" for row in ("no_prior", "simulated_x_0.5", "simulated_x_1", "pure_noise")]
    assert saved(out)["simulated x 1"]["values"]["f_score"]["mean"] == pytest.approx(0.605)


def test_a_failed_run_is_told_and_tried_again(room, tmp_path, fake, capsys):
    out = tmp_path / "out"
    fake.failing = "simulated_x_0.5"
    assert bench(room, out) == 2
    assert len(fake.made) == 4
    assert "simulated x 0.5, seed 0, failed: no luck" in (out / "prior_error.md").read_text(encoding="utf-8")
    fake.failing, fake.made = "", []
    assert bench(room, out) == 0
    assert fake.made == ["simulated_x_0.5/seed_0"]


def test_a_factor_scales_the_errors_and_nothing_else(tmp_path):
    one, two = (next(p.options for p in simulated_priors([f"factors={x}"], tmp_path) if p.options) for x in (1, 2))
    assert (two.abs_rel, two.normal_deg, two.edge_blur) == (2 * one.abs_rel, 2 * one.normal_deg, 2 * one.edge_blur)
    assert (two.scale_sigma, two.shift_sigma, two.shared, two.seed) == (
        one.scale_sigma, one.shift_sigma, one.shared, one.seed,
    )  # fmt: skip
    names = [prior.name for prior in simulated_priors(["factors=2,0.5,2"], tmp_path)]
    assert names == [NONE, "simulated x 0.5", "simulated x 2", NOISE]


def test_a_point_takes_its_settings_over_the_common_ones(tmp_path):
    (given,) = real_priors(["point=mine, new: prior=none prior.depth.joint=false"])
    assert given.name == "mine, new"
    jobs = planned(["scene.path=x", "prior.depth.joint=true", "train.iterations=7"], [given], tmp_path)
    (job,) = jobs["mine, new"]
    assert not job.config.prior.depth.joint and job.config.train.iterations == 7
    assert job.folder == tmp_path / "runs/mine_new/seed_0"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["factors=1,x"], "factors=1,x is no list of numbers"),
        (["factors=3"], "each is above 0 and at most 2.8"),
        (["factors=0"], "each is above 0"),
        (["point=prior=none"], "it is not understood; write point="),
        (["point=pure noise: prior=none"], "that name is taken"),
        (["point=a: prior=none", "point=a: prior=none"], "that name is taken"),
        (["point=a: prior/depth=depth_pro prior.depth.model=nowhere.onnx"], "nowhere.onnx is not there"),
        (["train.iterations=10,20"], "train.iterations is a list"),
        (["train.iteration=1"], "did you mean train.iterations"),
        (["out="], "out is not given"),
    ],
)
def test_bad_input_is_told_before_the_first_run(room, tmp_path, monkeypatch, capsys, fake, more, said):
    monkeypatch.chdir(tmp_path)
    assert bench(room, Path("x"), *more) == 2
    told = capsys.readouterr().err
    assert said in told and told.count("\n") == 1
    assert fake.made == [] and not (tmp_path / "x").exists()


def test_a_capture_without_depth_or_truth_is_refused(wall, room, tmp_path, capsys, fake):
    assert bench(wall, tmp_path / "x") == 2
    assert "has no depth maps" in capsys.readouterr().err
    (room / "gt_mesh.ply").unlink()
    assert bench(room, tmp_path / "x") == 2
    assert "has no gt_mesh.ply" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_the_curve_says_what_a_better_network_would_bring():
    figures = {"a": (10.0, 0.8), "b": (20.0, 0.6), "ours": (20.0, 0.5)}
    runs = [Run(name, 0, Path(name), {"f_score_5cm": score}) for name, (_, score) in figures.items()]
    points = [
        Point("real" if row.name == "ours" else "simulated", row, Quality(0.1, 0.9, figures[row.name][0], 5))
        for row in rows_of(runs, {}, 0.05)
    ]
    curve = Curve("title", "command", 0.05, tuple(points))
    line = curve.line("normal_deg", "f_score")
    assert interpolated(line, 15.0) == pytest.approx(0.7)
    assert interpolated(line, 9.0) is None and interpolated(line[:1], 10.0) is None
    assert sentences(curve)[0] == (
        "ours: F @ 5cm 0.500 with normals 20.0° off; simulated priors as far off have 0.600, half as far off 0.800"
    )


def test_an_unknown_list_is_no_sweep(tmp_path):
    with pytest.raises(InputError, match="is a list"):
        planned(["scene.path=x", "loss.dssim=0.1,0.2"], simulated_priors([], tmp_path), tmp_path)
