"""Hydra's multirun: which jobs it makes, where they go, what a failed one says."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from hydra.core.global_hydra import GlobalHydra
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import cli
from room2dgs.errors import InputError
from room2dgs.runs.folder import new_run, write_config
from room2dgs.study import launch
from room2dgs.study.launch import combinations


class Processes:
    """Stands for `room2dgs run`: keeps what was typed, leaves a config.yaml and scores.

    Attributes:
        failing: seed -> (exit code, standard error).
    """

    def __init__(self) -> None:
        self.configs = []
        self.failing: dict[int, tuple[int, str]] = {}

    def __call__(self, command: list[str]) -> subprocess.CompletedProcess:
        config = new_run(command[command.index("run") + 1 :])
        self.configs.append(config)
        code, said = self.failing.get(config.train.seed, (0, ""))
        if not code:
            out = Path(config.out)
            out.mkdir(parents=True, exist_ok=True)
            write_config(out, config)
            (out / "metrics.json").write_text(json.dumps({"f_score_5cm": 0.5}))
        return subprocess.CompletedProcess(command, code, None, said)


@pytest.fixture
def processes(monkeypatch) -> Processes:
    found = Processes()
    monkeypatch.setattr(launch, "ended", found)
    return found


def test_the_first_key_changes_slowest_and_a_later_key_takes_the_place_of_an_earlier_one():
    assert combinations(["train.seed=9", "train.seed=0,1", "experiment=full,no_mv", "loss.dssim=0.2"]) == [
        ("train.seed=0", "experiment=full", "loss.dssim=0.2"),
        ("train.seed=0", "experiment=no_mv", "loss.dssim=0.2"),
        ("train.seed=1", "experiment=full", "loss.dssim=0.2"),
        ("train.seed=1", "experiment=no_mv", "loss.dssim=0.2"),
    ]


@pytest.mark.parametrize(
    "text",
    [
        "eval.protocols=[area,neuris]",
        "train.resolutions=[{fraction:0.5,until:100}]",
        "scene.path='a,b'",
        "out='/rooms/a=b,(c'",
    ],
)
def test_what_is_no_list_of_choices_is_one_value(text):
    assert combinations([text]) == [(text,)]


def test_ranges_and_doubles():
    assert combinations(["train.seed=range(0,3)"]) == [("train.seed=0",), ("train.seed=1",), ("train.seed=2",)]
    assert combinations(["train.seed=4,4"]) == [("train.seed=4",)]


@pytest.mark.parametrize(("text", "said"), [("nonsense", "KEY=VALUE"), ("train.sed=1,2", "train.seed"), ("out=(", "(")])
def test_what_cannot_be_read_is_told(text, said):
    with pytest.raises(InputError) as caught:
        combinations([text])
    assert said in str(caught.value)


KEYS = ("train.seed", "eval.seed", "train.log_every", "mesh.min_triangles")


@settings(max_examples=20, deadline=None)  # Hydra's parser takes milliseconds a text
@given(st.dictionaries(st.sampled_from(KEYS), st.lists(st.integers(0, 99), min_size=1, max_size=3), min_size=1))
def test_every_combination_once(choices):
    found = combinations([f"{key}={','.join(map(str, values))}" for key, values in choices.items()])
    expected = 1
    for values in choices.values():
        expected *= len(set(values))
    assert len(found) == len(set(found)) == expected


def test_each_job_of_a_multirun_is_a_run_in_a_folder_of_its_own(tmp_path, processes):
    out = tmp_path / "a, b=(c"
    more = ["train.seed=3,4", "mesh.voxel_m=0.02", "experiment=full,no_mv"]
    assert cli.main(["run", "-m", "scene.path='x,1',y", f"out={out}", *more]) == 0
    made = [(one.out, Path(one.scene.path).name, one.train.seed, one.mesh.voxel_m) for one in processes.configs]
    assert made == [
        (str(out / str(2 * n + m)), scene, seed, 0.02)
        for n, (scene, seed) in enumerate([("x,1", 3), ("x,1", 4), ("y", 3), ("y", 4)])
        for m in (0, 1)
    ]
    photometric = [one.loss.multiview_photometric.enabled for one in processes.configs]
    assert photometric == [True, False] * 4
    assert not GlobalHydra.instance().is_initialized()


def test_a_multirun_refuses_wrong_settings_before_its_first_job(tmp_path, processes, capsys):
    for wrong, said in (("train.seed=0,x", "train.seed wants a whole number"), ("train.sed=1,2", "did you mean")):
        assert cli.main(["run", "-m", "scene.path=x", f"out={tmp_path / 'out'}", wrong]) == 2
        assert said in capsys.readouterr().err
    assert cli.main(["run", "-m", "scene.path=x", "train.seed=0,1"]) == 2
    assert "out is not given" in capsys.readouterr().err
    assert processes.configs == [] and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("ends", "code"),
    [
        ((2, "room2dgs: no such room"), 2),
        ((1, "room2dgs: a wheel"), 1),
        ((-9, ""), 137),
        ((130, ""), 130),
        ((143, ""), 143),
    ],
)
def test_a_multirun_has_the_exit_code_of_its_failed_job(tmp_path, processes, capsys, ends, code):
    processes.failing = {1: ends}
    assert cli.main(["run", "-m", "scene.path=x", f"out={tmp_path}", "train.seed=0,1,2"]) == code
    assert [one.train.seed for one in processes.configs] == ([0, 1] if code in (130, 143) else [0, 1, 2])
    said = capsys.readouterr().err.splitlines()[-1]
    assert {2: "no such room", 1: "a wheel", 137: "out of memory?"}.get(code, "interrupted") in said


def test_hydras_own_settings_reach_hydra(tmp_path, processes):
    named = "hydra.sweep.subdir=seed_${train.seed}"
    assert cli.main(["run", "-m", "scene.path=x", f"out={tmp_path}", "train.seed=5,6", named]) == 0
    assert [Path(one.out).name for one in processes.configs] == ["seed_5", "seed_6"]
    assert cli.main(["run", "-m", "scene.path=x", f"out={tmp_path}", "hydra/launcher=catapult"]) == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("launcher", "plugin", "more"),
    [
        ("joblib", "hydra_joblib_launcher", ["hydra.launcher.n_jobs=2"]),
        ("submitit_local", "hydra_submitit_launcher", ["hydra.launcher.timeout_min=5"]),  # Slurm's, without a cluster
        ("ray", "hydra_ray_launcher", []),
    ],
)
def test_launchers_run_the_jobs_in_processes_of_their_own(wall, tmp_path, launcher, plugin, more):
    pytest.importorskip(f"hydra_plugins.{plugin}")
    quick = [f"points.file={wall / 'gone.ply'}", "points.source=file", "prior=none", "seeds.init=sfm"]
    argv = ["run", "-m", f"scene.path={wall}", f"out={tmp_path}", "train.seed=0,1", f"hydra/launcher={launcher}"]
    assert cli.main([*argv, *more, *quick]) == 2  # both jobs were started, and both found no points
    assert {"0", "1"} <= {path.name for path in tmp_path.iterdir()}
    if launcher == "submitit_local":
        assert len(list(tmp_path.glob(".submitit/*/*_submitted.pkl"))) == 2


def test_a_study_has_one_owner(wall, tmp_path, capsys):
    code = (
        "import sys, time\nfrom pathlib import Path\nfrom room2dgs.owner import owned\n"
        "with owned(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)\n"
    )
    out = tmp_path / "study"
    with subprocess.Popen([sys.executable, "-c", code, str(out)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        assert cli.main(["ablate", f"scene.path={wall}", f"out={out}", "experiment=full"]) == 2
        assert f"another run works in {out} (process {other.pid})" in capsys.readouterr().err
        other.kill()
    assert [path.name for path in out.iterdir()] == [".lock"]
