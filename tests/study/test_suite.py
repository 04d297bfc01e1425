"""`room2dgs bench suite`: which runs it makes, how it goes on, what its table says."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from room2dgs import cli
from room2dgs.errors import InputError
from room2dgs.runs.folder import new_run, write_config
from room2dgs.study import launch
from room2dgs.study.suite import NEITHER, REPORT, TUNE, half_of, names, planned

SCORES = {"room_00": 0.9, "room_01": 0.5, "room_02": 0.7, "greywhite": 0.8}


class FakeRuns:
    """Stands for the processes: writes what a finished run leaves, or fails as told."""

    def __init__(self) -> None:
        self.made: list[str] = []
        self.failing: dict[str, tuple[int, str]] = {}

    def __call__(self, command: list[str]) -> subprocess.CompletedProcess:
        config = new_run(command[command.index("run") + 1 :])
        out = Path(config.out)
        name = out.parent.name
        self.made.append(f"{name}/{out.name}")
        assert Path(config.scene.path).name == name
        assert (config.points.cache, config.train.iterations) == (str(out.parent / "points"), 70)
        out.mkdir(parents=True, exist_ok=True)
        write_config(out, config)
        if name in self.failing:
            code, said = self.failing[name]
            return subprocess.CompletedProcess(command, code, None, said)
        score = SCORES[name] + 0.02 * config.train.seed
        fine = {"protocol": "area", "protocols": {"area": {"f_score_2cm": score / 2}}}
        scores = {"f_score_5cm": score, "precision_5cm": score + 0.05, "recall_5cm": score - 0.05, "chamfer_m": 0.03}
        seconds = {"read": 0.5, "points": 8.5, "train": 60.0, "mesh": 6.0, "render": 100.0, "eval": 100.0}
        costs = {"seconds": seconds, "primitives": 1234, "peak_memory_mb": 2100.0, "commit": "abc"}
        (out / "metrics.json").write_text(json.dumps({**scores, **fine, **costs}))
        return subprocess.CompletedProcess(command, 0, None, "")


@pytest.fixture
def fake(monkeypatch) -> FakeRuns:
    runs = FakeRuns()
    monkeypatch.setattr(launch, "ended", runs)
    return runs


@pytest.fixture
def captures(wall, tmp_path) -> list[str]:
    for name in SCORES:
        shutil.copytree(wall, tmp_path / "captures" / name)
    return [str(tmp_path / "captures" / name) for name in SCORES]


def bench(captures: list[str], out: Path, *more: str) -> int:
    return cli.main(["bench", "suite", *captures, f"out={out}", "train.iterations=70", *more])


def saved(out: Path) -> dict:
    return json.loads((out / "suite.json").read_text())


def cells(out: Path) -> dict[str, list[str]]:
    """First two cells of a line of the table -> the others."""
    lines = [line for line in (out / "suite.md").read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {" ".join(row[:2]): row[2:] for row in rows}


def test_each_capture_is_run_and_the_halves_are_averaged_apart(captures, tmp_path, fake, capsys):
    out = tmp_path / "out"
    assert bench(captures, out) == 0
    assert fake.made == [f"{name}/seed_0" for name in SCORES]
    table = cells(out)
    assert table["scene half"] == [
        "F @ 2cm", "F @ 5cm", "precision", "recall", "chamfer (cm)", "seconds", "surfels", "memory (GB)",
    ]  # fmt: skip
    assert table["room_00 tune"] == ["0.450", "0.900", "0.950", "0.850", "3.0", "75", "1,234", "2.1"]
    assert table["greywhite -"][1] == "0.800"
    assert table["mean of 2 tune"][:2] == ["0.400", "0.800"]
    assert table["mean of 1 report"][1] == "0.500"
    assert table["mean of 4 all"][1] == "0.725"
    whole = saved(out)
    assert whole["means"][TUNE]["f_score"] == pytest.approx(0.8)
    assert (whole["settings"], whole["commits"]) == (["train.iterations=70"], ["abc"])
    text = (out / "suite.md").read_text(encoding="utf-8")
    assert "settings: train.iterations=70" in text and "commit: abc" in text and "cores" in text
    assert text in capsys.readouterr().out


def test_a_failed_capture_is_named_the_others_go_on_and_only_it_is_tried_again(captures, tmp_path, fake):
    out = tmp_path / "out"
    fake.failing = {"room_00": (2, "warning: hot\nroom2dgs: no photo fits\n")}
    assert bench(captures, out) == 2
    assert len(fake.made) == 4
    assert "room_00, seed 0, failed: no photo fits" in (out / "suite.md").read_text(encoding="utf-8")
    table = cells(out)
    assert table["room_00 (failed) tune"] == ["-"] * 8
    assert table["mean of 1 of 2 tune"][1] == "0.700"
    fake.failing, fake.made = {}, []
    assert bench(captures, out) == 0
    assert fake.made == ["room_00/seed_0"]
    assert cells(out)["mean of 2 tune"][1] == "0.800"


def test_what_is_finished_is_not_run_again_another_seed_or_capture_is(captures, tmp_path, fake):
    out = tmp_path / "out"
    assert bench(captures[:1], out) == 0
    fake.made = []
    assert bench(captures[:2], out, "train.seed=0,1") == 0
    assert fake.made == ["room_01/seed_0", "room_00/seed_1", "room_01/seed_1"]
    row = saved(out)["rows"][0]
    assert row["values"]["f_score"] == {"mean": pytest.approx(0.91), "spread": pytest.approx(0.02 / 2**0.5)}
    assert cells(out)["room_00 tune"][1] == "0.910 ± 0.014"


def test_other_settings_need_another_folder(captures, tmp_path, fake, capsys):
    assert bench(captures[:1], tmp_path / "out") == 0
    assert bench(captures[:1], tmp_path / "out", "loss.dssim=0.1") == 2
    assert "loss.dssim" in capsys.readouterr().err
    assert len(fake.made) == 1


def test_a_capture_without_ground_truth_is_told_and_counts_in_no_mean_score(captures, tmp_path, fake, monkeypatch):
    def unscored(command):
        done = fake(command)
        path = Path(new_run([*command[command.index("run") + 1 :], "resume=true"]).out) / "metrics.json"
        metrics = json.loads(path.read_text())
        kept = {name: metrics[name] for name in ("seconds", "primitives", "peak_memory_mb", "commit")}
        path.write_text(json.dumps(kept))
        return done

    monkeypatch.setattr(launch, "ended", unscored)
    assert bench(captures[:1], tmp_path / "out") == 0
    assert "room_00 has no ground truth" in (tmp_path / "out/suite.md").read_text(encoding="utf-8")
    assert cells(tmp_path / "out")["mean of 1 tune"] == ["-"] * 5 + ["75", "1,234", "2.1"]


def test_halves_are_told_by_the_number_at_the_names_end():
    assert [half_of(name) for name in ("room_00", "room_07", "12", "redkitchen", "7_of_mine")] == [
        TUNE, REPORT, TUNE, NEITHER, NEITHER,
    ]  # fmt: skip


def test_captures_of_one_name_are_told_apart_and_none_comes_twice(tmp_path):
    first, second, third = (str(tmp_path / name) for name in ("a/room", "b/room", "b/hall"))
    assert names([first, second, third])[2] == "hall"
    assert [name.rpartition(tmp_path.name)[2] for name in names([first, second, third])[:2]] == ["_a_room", "_b_room"]
    with pytest.raises(InputError, match="given twice"):
        names([first, f"{first}/../room"])


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["loss.dssim=0.1,0.2"], "loss.dssim is a list"),
        (["scene.path=elsewhere"], "without a key"),
        (["train.iteration=3"], "train.iteration"),
    ],
)
def test_settings_that_cannot_be_are_refused(overrides, said, tmp_path):
    with pytest.raises(InputError, match=said):
        planned(["room"], overrides, tmp_path)


def test_it_needs_captures_and_a_folder(tmp_path, capsys):
    assert cli.main(["bench", "suite", f"out={tmp_path / 'out'}"]) == 2
    assert "no scene is given" in capsys.readouterr().err
    assert cli.main(["bench", "suite", str(tmp_path)]) == 2
    assert "out=DIR" in capsys.readouterr().err
