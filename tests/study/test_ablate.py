"""`room2dgs ablate`: which runs it makes, how it goes on, what it refuses; one small study for real."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import trimesh

from room2dgs import cli
from room2dgs.commands.ablate import DEFAULTS
from room2dgs.config import Config, conf_dir, load_config
from room2dgs.runs.folder import last_value, new_run, write_config
from room2dgs.study import jobs as study
from room2dgs.study import launch

SCORES = {"full": 0.6, "no_mv": 0.5, "no_depth": 0.4, "no_seed": 0.3}


class FakeRuns:
    """Stands for the processes: writes what a finished run leaves, or fails as told.

    Attributes:
        made: row/seed of every run that was started, in order.
        failing: row -> (exit code, standard error).
    """

    def __init__(self) -> None:
        self.made: list[str] = []
        self.argv: list[list[str]] = []
        self.failing: dict[str, tuple[int, str]] = {}

    def __call__(self, command: list[str]) -> subprocess.CompletedProcess:
        argv = command[command.index("run") + 1 :]
        config = new_run(argv)  # refuses what `room2dgs run` would refuse
        out = Path(config.out)
        row = out.parent.name
        self.made.append(f"{row}/{out.name}")
        self.argv.append(argv)
        out.mkdir(parents=True, exist_ok=True)
        write_config(out, config)
        if row in self.failing:
            code, said = self.failing[row]
            return subprocess.CompletedProcess(command, code, None, said)
        trimesh.creation.box((1, 1, 0.1)).export(out / "mesh.ply")
        score = SCORES.get(row, 0.1) + 0.01 * config.train.seed
        seconds = {"train": 60.0, "mesh": 6.0, "eval": 1.0}
        metrics = {"f_score_5cm": score, "seconds": seconds, "primitives": 10, "priors": config.prior.depth.source}
        (out / "metrics.json").write_text(json.dumps(metrics))
        return subprocess.CompletedProcess(command, 0, None, "")


@pytest.fixture
def fake(monkeypatch) -> FakeRuns:
    runs = FakeRuns()
    monkeypatch.setattr("room2dgs.study.ablation_report.mesh_views", lambda *_: [])
    monkeypatch.setattr(launch, "ended", runs)
    return runs


def ablate(wall: Path, out: Path, *more: str) -> int:
    return cli.main(["ablate", f"scene.path={wall}", f"out={out}", *more])


def saved(out: Path) -> dict:
    return json.loads((out / "ablation.json").read_text())


def refused(capsys, argv: list[str]) -> str:
    capsys.readouterr()
    assert cli.main(argv) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_default_rows_and_seeds_each_row_once_before_any_twice(tmp_path):
    given = ["scene.path=x", "prior=files", "prior.depth.path=d", "prior.normal.path=n"]
    jobs = study.planned([*DEFAULTS, *given], tmp_path)
    rows = ["full", "no_seed", "no_depth", "no_normal", "no_mv", "no_distortion"]
    assert [(job.seed, job.row) for job in jobs] == [(seed, row) for seed in (0, 1, 2) for row in rows]
    assert [job.folder for job in jobs[:2]] == [tmp_path / "full/seed_0", tmp_path / "no_seed/seed_0"]


def test_a_second_call_runs_nothing_and_one_more_row_or_seed_runs_alone(wall, tmp_path, fake):
    out = tmp_path / "out"
    assert ablate(wall, out, "experiment=full,no_mv", "train.seed=0") == 0
    assert fake.made == ["full/seed_0", "no_mv/seed_0"]
    fake.made.clear()
    assert ablate(wall, out, "experiment=full,no_mv", "train.seed=0") == 0
    assert fake.made == []
    assert ablate(wall, out, "experiment=full,no_seed", "train.seed=0,1") == 0
    assert fake.made == ["no_seed/seed_0", "full/seed_1", "no_seed/seed_1"]
    rows = saved(out)["rows"]
    assert [row["name"] for row in rows] == ["full", "no_seed"]
    assert rows[0]["values"]["f_score"]["mean"] == pytest.approx(0.605)


def test_a_failed_row_is_told_and_the_others_go_on_then_it_goes_on(wall, tmp_path, fake, capsys):
    out = tmp_path / "out"
    fake.failing = {"full": (2, "warning: hot\nroom2dgs: \x1b[1;31mno depth map fits\n"), "no_mv": (-9, "")}
    assert ablate(wall, out, "experiment=full,no_mv,no_seed", "train.seed=0") == 2  # the first one's cause
    assert fake.made == ["full/seed_0", "no_mv/seed_0", "no_seed/seed_0"]
    runs = {row["name"]: row["runs"][0]["failed"] for row in saved(out)["rows"]}
    assert runs == {"full": "no depth map fits", "no_mv": "killed by signal 9 (out of memory?)", "no_seed": None}
    said = capsys.readouterr().out
    assert "full, seed 0, failed: no depth map fits" in said
    assert "no depth map fits" in (out / "ablation.html").read_text(encoding="utf-8")
    fake.failing, fake.argv = {}, []
    assert ablate(wall, out, "experiment=full,no_mv,no_seed", "train.seed=0") == 0
    assert fake.argv == [["resume=true", f"out={out}/{row}/seed_0"] for row in ("full", "no_mv")]
    assert all(row["values"]["f_score"] for row in saved(out)["rows"])


def test_an_unfinished_run_is_gone_on_with(wall, tmp_path, fake):
    out = tmp_path / "out"
    ablate(wall, out, "experiment=full", "train.seed=0")
    metrics = out / "full/seed_0/metrics.json"
    metrics.write_text(json.dumps({"seconds": {"train": 60.0}}))  # killed before its scores
    fake.made.clear()
    assert ablate(wall, out, "experiment=full", "train.seed=0") == 0
    assert fake.made == ["full/seed_0"]
    metrics.write_text(metrics.read_text()[:20])  # not whole
    assert ablate(wall, out, "experiment=full", "train.seed=0") == 0
    assert fake.made == ["full/seed_0"] * 2


def unfinished(run: Path) -> None:
    """As if it had been killed before its scores."""
    (run / "metrics.json").write_text(json.dumps({"seconds": {"train": 60.0}}))


def test_a_study_that_was_moved_with_its_capture_goes_on_where_it_is(wall, tmp_path, fake):
    shutil.copytree(wall, tmp_path / "here/room")
    before, now = tmp_path / "here", tmp_path / "there"
    assert ablate(before / "room", before / "out", "experiment=full,no_mv", "train.seed=0") == 0
    before.rename(now)
    unfinished(now / "out/full/seed_0")
    fake.made.clear()
    assert ablate(now / "room", now / "out", "experiment=full,no_mv", "train.seed=0") == 0
    assert fake.made == ["full/seed_0"]
    config = load_config((), now / "out/full/seed_0/config.yaml")
    found = (config.scene.path, config.points.cache, config.prior.cache)
    assert found == tuple(str(now / name) for name in ("room", "out/points", "out/priors"))
    assert not before.exists()


def test_a_study_that_was_moved_alone_keeps_its_capture_and_takes_no_other(wall, tmp_path, fake, capsys):
    out = tmp_path / "out"
    assert ablate(wall, out, "experiment=full", "train.seed=0") == 0
    now = tmp_path / "elsewhere/out"
    shutil.move(out, now)
    assert ablate(wall, now, "experiment=full", "train.seed=0") == 0
    assert fake.made == ["full/seed_0"]
    other = shutil.copytree(wall, tmp_path / "other")
    argv = ["ablate", f"scene.path={other}", f"out={now}", "experiment=full", "train.seed=0"]
    assert "full/seed_0 holds a run with another scene.path" in refused(capsys, argv)


def test_a_study_with_other_caches_goes_on_with_them(wall, tmp_path, fake):
    out = tmp_path / "out"
    assert ablate(wall, out, "experiment=full", "train.seed=0") == 0
    unfinished(out / "full/seed_0")
    caches = [f"points.cache={tmp_path / 'points'}", f"prior.cache={tmp_path / 'maps'}"]
    assert ablate(wall, out, "experiment=full", "train.seed=0", *caches) == 0
    config = load_config((), out / "full/seed_0/config.yaml")
    assert (config.points.cache, config.prior.cache) == (str(tmp_path / "points"), str(tmp_path / "maps"))


def test_an_interrupt_ends_the_study(wall, tmp_path, fake, capsys):
    fake.failing = {"full": (130, "")}
    assert ablate(wall, tmp_path / "out", "experiment=full,no_mv", "train.seed=0") == 130
    assert fake.made == ["full/seed_0"]


def test_other_settings_are_not_mixed_into_a_study(wall, tmp_path, fake, capsys):
    out = tmp_path / "out"
    ablate(wall, out, "experiment=full", "train.seed=0")
    before = (out / "ablation.json").read_bytes()
    argv = ["ablate", f"scene.path={wall}", f"out={out}", "experiment=full", "train.seed=0", "train.iterations=7"]
    said = refused(capsys, argv)
    assert "full/seed_0 holds a run with another train.iterations" in said
    assert (out / "ablation.json").read_bytes() == before


def test_any_setting_can_be_a_list_and_caches_are_shared(wall, tmp_path, fake):
    out = tmp_path / "out"
    assert ablate(wall, out, "experiment=full,no_mv", "train.seed=5", "loss.dssim=0.1,0.3") == 0
    assert [row["name"] for row in saved(out)["rows"]] == [
        "full, loss.dssim=0.1",
        "full, loss.dssim=0.3",
        "no_mv, loss.dssim=0.1",
        "no_mv, loss.dssim=0.3",
    ]
    config = load_config((), out / "no_mv,loss.dssim=0.3/seed_5/config.yaml")
    assert (config.loss.dssim, config.train.seed) == (0.3, 5)
    assert not config.loss.multiview_photometric.enabled
    assert (config.points.cache, config.prior.cache) == (str(out / "points"), str(out / "priors"))


def test_rows_with_the_same_settings_run_once(wall, tmp_path, fake):
    out = tmp_path / "out"
    more = [
        "experiment=full,no_distortion",
        "train.seed=0",
        "loss.distortion.enabled=false",
        "loss.distortion.weight=0",
    ]
    assert ablate(wall, out, *more) == 0
    assert fake.made == ["full/seed_0"]
    full, same = saved(out)["rows"]
    assert same["same_as"] == "full" and same["values"] == full["values"]


def test_paths_are_one_value_commas_and_all(wall, tmp_path, fake):
    out = tmp_path / "a, b=c"
    assert ablate(wall, out, "experiment=full", "train.seed=0") == 0
    assert (out / "full/seed_0/mesh.ply").exists()
    assert last_value(fake.argv[0], "out") == f"{out}/full/seed_0"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["out="], "out is not given"),
        (["experiment=full,no_such"], "experiment=no_such is not known; choose from distortion, full, "),
        (["train.iterations=10,-1"], "train.iterations=-1 is impossible"),
        (["train.iteration=1,2"], "did you mean train.iterations"),
        (["scene.path=nowhere"], "nowhere is not there"),
        (["--fast"], "settings are written KEY=VALUE"),
    ],
)
def test_bad_input_is_told_before_the_first_run(wall, tmp_path, monkeypatch, capsys, fake, more, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(capsys, ["ablate", f"scene.path={wall}", "out=x", "train.seed=0", *more])
    assert fake.made == [] and list(tmp_path.iterdir()) == []


def test_a_folder_with_other_things_is_not_taken(wall, tmp_path, capsys, fake):
    (tmp_path / "letter.txt").write_text("dear")
    assert "is not a study's folder" in refused(capsys, ["ablate", f"scene.path={wall}", f"out={tmp_path}"])
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def leaves(config: object, prefix: str = "") -> dict[str, object]:
    found = {}
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        inner = dataclasses.is_dataclass(value)
        found |= leaves(value, f"{prefix}{field.name}.") if inner else {prefix + field.name: value}
    return found


def with_priors(experiment: str) -> Config:
    priors = ["prior=files", "prior.depth.path=d", "prior.normal.path=n"]
    return load_config(["scene.path=x", "out=y", *priors, f"experiment={experiment}"])


def test_an_experiment_removes_its_part_and_nothing_else():
    full = leaves(with_priors("full"))
    parts = {
        "no_seed": ("strategy.", "seeds.init", "seeds.per_seed", "seeds.decoder"),
        "no_depth": ("prior.depth.source", "loss.depth_prior.enabled", "seeds.init"),
        "no_depth_seeds": ("seeds.init",),
        "no_normal": ("prior.normal.source", "loss.normal_prior.enabled"),
        "no_mv": ("loss.multiview_geometric.enabled", "loss.multiview_photometric.enabled"),
        "no_distortion": ("loss.distortion.",),
        "no_growth": ("strategy.",),
        "shared_decoder": ("seeds.decoder",),
        "softplus": ("seeds.scale_activation",),
    }
    for experiment, allowed in parts.items():
        other = leaves(with_priors(experiment))
        differing = [key for key in full if full[key] != other[key]]
        assert all(key.startswith(allowed) for key in differing), experiment


def test_the_full_method_has_every_part_and_plain_2dgs_none():
    full, plain = with_priors("full"), with_priors("plain_2dgs")
    terms = ("depth_prior", "normal_prior", "multiview_photometric")
    assert all(getattr(full.loss, term).enabled and getattr(full.loss, term).weight > 0 for term in terms)
    assert not any(getattr(plain.loss, term).enabled for term in terms)
    assert (full.prior.depth.source, full.prior.normal.source) == ("files", "files")
    assert (plain.prior.depth.source, plain.prior.normal.source) == ("none", "none")
    assert (full.strategy.name, plain.strategy.name) == ("seeds", "plain")
    assert (plain.seeds.init, plain.seeds.per_seed) == ("points", 1)


def test_every_experiment_says_in_words_what_it_is():
    for path in (conf_dir() / "experiment").glob("*.yaml"):
        assert len(study.words_of(path.stem)) > 20, path.name


def test_a_small_study_end_to_end(wall, tmp_path):
    quick = [
        "points.source=file",
        f"points.file={wall / 'points.ply'}",
        "prior=none",
        "seeds.voxel_m=0.1",
        "train.iterations=40",
        "train.rates.color=0.05",
        "train.tensorboard=false",
        "mesh.voxel_m=0.05",
        "mesh.min_triangles=1",
        "eval.samples=2000",
    ]
    out = tmp_path / "study"
    assert ablate(wall, out, "experiment=full,no_mv", "train.seed=0", *quick) == 0
    rows = {row["name"]: row for row in saved(out)["rows"]}
    assert list(rows) == ["full", "no_mv"]
    for row in rows.values():
        assert row["values"]["f_score"]["mean"] > 0.8
        assert row["values"]["peak_memory_mb"]["mean"] > 100
        assert row["training_seconds"]["render"] > 0
    text = (out / "ablation.html").read_text(encoding="utf-8")
    assert len(re.findall("<img", text)) == 3 * (5 * 2 + 4)
    assert not re.search(r"https?:|<script", text)
    assert "full > no_mv" in (out / "ablation.md").read_text(encoding="utf-8")
    assert (out / "ablation.png").stat().st_size > 10_000
