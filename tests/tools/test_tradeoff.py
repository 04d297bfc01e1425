"""`tools/tradeoff`: which runs it makes, what its table says, how it goes on."""

from __future__ import annotations

import json
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

from room2dgs.runs.folder import new_run, write_config
from room2dgs.study import launch
from room2dgs.study.ablation import Row, Value
from room2dgs.tools.tradeoff.__main__ import main
from room2dgs.tools.tradeoff.page import drawing
from room2dgs.tools.tradeoff.points import Tradeoff, points_of

POINTS = ["point=first: mesh.source=depth train.iterations=1", "point=last, whole: train.iterations=70"]


class FakeRuns:
    """Stands for the processes: the score is that of the settings."""

    def __init__(self) -> None:
        self.made: list[str] = []
        self.fails = ""

    def __call__(self, command: list[str]) -> subprocess.CompletedProcess:
        config = new_run(command[command.index("run") + 1 :])
        out = Path(config.out)
        self.made.append(str(out.relative_to(out.parents[2])))
        out.mkdir(parents=True, exist_ok=True)
        write_config(out, config)
        if self.fails and self.fails in str(out):
            return subprocess.CompletedProcess(command, 2, None, "room2dgs: no such thing")
        trained = config.mesh.source == "surfels"
        metrics = {"f_score_5cm": 0.5 + 0.2 * trained + 0.1 * (Path(config.scene.path).name == "b"), "commit": "abc"}
        by_distance = {"5-10 cm": {"wrong": 0.5}, "10-20 cm": {"wrong": 0.3}, "over 20 cm": {"wrong": 0.2}}
        metrics["where_the_error_sits"] = {"precision": {"wrong": 0.1, "by_distance": by_distance}}
        metrics["stereo_coverage"] = 0.45 if config.stereo.enabled else None
        seconds = {"priors": 10.0, "mesh": 5.0, "eval": 100.0} | ({"train": 20.0} if trained else {})
        cpu = {name: 2 * value for name, value in seconds.items()}
        (out / "metrics.json").write_text(json.dumps({**metrics, "seconds": seconds, "cpu_seconds": cpu}))
        return subprocess.CompletedProcess(command, 0, None, "")


@pytest.fixture
def fake(monkeypatch) -> FakeRuns:
    runs = FakeRuns()
    monkeypatch.setattr(launch, "ended", runs)
    return runs


def bench(wall, out: Path, *more: str) -> int:
    scenes = [out.parent / name for name in ("a", "b")]
    for scene in scenes:
        if not scene.exists():
            shutil.copytree(wall, scene)
    return main([*map(str, scenes), f"out={out}", *POINTS, *more])


def test_every_capture_runs_with_every_points_settings_and_the_means_are_told(fake, wall, tmp_path):
    out = tmp_path / "out"
    assert bench(wall, out, "train.iterations=9") == 0  # a point's own settings have the last word
    assert fake.made == ["first/a/seed_0", "first/b/seed_0", "last_whole/a/seed_0", "last_whole/b/seed_0"]
    rows = {row["name"]: row["values"] for row in json.loads((out / "tradeoff.json").read_text())["rows"]}
    assert rows["b, last, whole"]["f_score"]["mean"] == pytest.approx(0.8)
    assert rows["a, first"]["run_s"]["mean"] == 15 and rows["a, first"]["cpu_s"]["mean"] == 30  # scoring aside
    text = (out / "tradeoff.md").read_text()
    means = [line.split("|") for line in text.splitlines() if line.startswith("| mean of 2")]
    assert [(line[2].strip(), line[3].strip()) for line in means] == [("first", "0.550"), ("last, whole", "0.750")]
    assert "last, whole: train.iterations=70" in text
    assert len((out / "tradeoff.csv").read_text().splitlines()) == 7
    assert "<img" in (out / "tradeoff.html").read_text() and (out / "tradeoff.png").stat().st_size > 10_000


def test_the_seconds_on_the_axis_are_plain_numbers_that_do_not_touch():
    points = {"poisson": (), "sketch": (), "standard": ()}
    rows = [
        Row(f"a, {name}", name, {"f_score": Value(0.9), "cpu_s": Value(cpu)}, {}, ())
        for name, cpu in zip(points, (18.0, 66.0, 639.0), strict=True)
    ]
    figure = drawing(Tradeoff("", points, 0.05, {}, tuple(rows)))
    figure.draw_without_rendering()
    axes = figure.axes[0]
    low, high = axes.get_xlim()
    shown = (label for label in axes.get_xticklabels(which="both") if label.get_text())
    labels = [label for label in shown if low <= label.get_position()[0] <= high]
    assert {"20", "50", "100", "200", "500"} <= {label.get_text() for label in labels}
    boxes = sorted((label.get_window_extent() for label in labels), key=lambda box: box.x0)
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))


def test_stereos_share_and_what_is_far_off_stand_beside_the_scores(fake, wall, tmp_path):
    out = tmp_path / "out"
    assert main([str(wall), f"out={out}", "points=stereo", "mesh.source=depth"]) == 0
    table = [line.split("|") for line in (out / "tradeoff.md").read_text().splitlines() if line.startswith("| ")]
    assert [cell.strip() for cell in table[0]][7:9] == ["over 20 cm off (%)", "stereo covers (%)"]
    cells = {line[2].strip(): (line[7].strip(), line[8].strip()) for line in table[1:]}
    assert cells["with stereo"] == ("2.0", "45") and cells["without"][0] == "2.0" and "45" not in cells["without"][1]


def test_a_failed_run_is_named_and_what_is_finished_stays(fake, wall, tmp_path, capsys):
    out = tmp_path / "out"
    fake.fails = "last_whole/a"
    assert bench(wall, out) == 2
    assert "a, last, whole, seed 0, failed: no such thing" in (out / "tradeoff.md").read_text()
    fake.fails, fake.made = "", []
    assert bench(wall, out) == 0
    assert fake.made == ["last_whole/a/seed_0"]


def test_the_sets_that_come_with_the_package_are_settings_that_exist(wall, tmp_path):
    from room2dgs.config import load_config

    for name in ("presets", "steps"):
        points = points_of([f"points={name}"])
        assert len(points) > 3
        for settings in points.values():
            load_config([f"scene.path={wall}", f"out={tmp_path}", *settings])
    assert points_of([]) == points_of(["points=presets"])
    peers = [settings[0] for settings in points_of([]).values()][:2]
    assert peers == ["mesh.source=stereo", "mesh.source=points"]  # trained by nobody, and no network looks


def test_points_of_ones_own_come_after_a_set_that_is_named_and_instead_of_one_that_is_not():
    own = "point=mine: train.iterations=5"
    assert list(points_of([own])) == ["mine"]
    both = points_of([own, "points=steps"])
    assert list(both) == [*points_of(["points=steps"]), "mine"] and both["mine"] == ("train.iterations=5",)


@pytest.mark.parametrize(
    "more, words",
    [
        (["points=nothing"], "presets, steps"),
        (["points=nothing", POINTS[0]], "presets, steps"),
        (["points=presets", "point=quick: train.iterations=5"], "that name is taken"),
        (["point=one"], "not understood"),
        (["point=a: x"], "point="),
    ],
)
def test_what_is_not_understood_is_refused(more, words, wall, tmp_path, capsys):
    assert main([str(wall), f"out={tmp_path / 'o'}", *more]) == 2
    assert words in capsys.readouterr().err
