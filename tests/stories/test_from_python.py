"""A run from Python: `room2dgs.reconstruct`, `room2dgs.open_run` and what a `Run` gives."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import room2dgs
from room2dgs.pipeline import reconstruct as steps

# the settings of tests/stories/conftest.py in the three ways that Python may write them
SETTINGS = {
    "points": {"source": "file"},
    "seeds__voxel_m": 0.1,
    "train": {"iterations": 30, "rates": {"color": 0.05}, "checkpoint_every": 15, "tensorboard": False},
    "mesh__voxel_m": 0.06,
    "mesh.min_triangles": 1,
    "mesh__max_error_m": None,
    "eval__samples": 2000,
    "scene__test_every": 3,
    "report": {"views": 2, "max_surfels": 300},
    "prior": "none",
}
RESULTS = ("mesh.ply", "surfels.safetensors", "poses.json")


@pytest.fixture(scope="module")
def said() -> list[str]:
    return []


@pytest.fixture(scope="module")
def made(room, tmp_path_factory, said) -> room2dgs.Run:
    """A run from Python with the settings of `trained`; not to be written to."""
    out = tmp_path_factory.mktemp("python") / "run"
    return room2dgs.reconstruct(room, out, log=said.append, points__file=room / "points.ply", **SETTINGS)


def test_python_and_the_command_give_the_same_bits(made, trained):
    for name in RESULTS:
        assert (made.path / name).read_bytes() == (trained / name).read_bytes(), name
    ours, theirs = (room2dgs.open_run(path).settings for path in (made.path, trained))
    ours.out = theirs.out
    assert ours == theirs


def test_lines_go_where_they_are_wanted_and_to_the_log(made, said, capsys):
    assert "F-score @ 5 cm" in "\n".join(said)
    assert (made.path / "log.txt").read_text().splitlines() == said
    assert capsys.readouterr().out == ""


def test_a_run_gives_what_lies_in_its_folder(made, untrained, story):
    run = room2dgs.open_run(str(made.path))
    assert repr(run) == f"Run({str(made.path)!r})"
    written = trimesh.load(made.path / "mesh.ply", process=False)
    assert np.array_equal(run.mesh.faces, written.faces) and np.allclose(run.mesh.vertices, written.vertices, atol=1e-6)
    assert len(run.surfels.centers) == story.metrics(made.path)["primitives"]
    assert list(run.cameras) == [frame.name for frame in run.scene.frames] and len(run.cameras) == 6
    assert run.scores["f_score_5cm"] == story.metrics(made.path)["f_score_5cm"]
    assert "peak_memory_mb" not in run.scores and "psnr_db" in run.scores
    assert run.paths["mesh"] == made.path / "mesh.ply" and run.paths["surfels"].is_file()
    assert "surfels" not in room2dgs.open_run(untrained).paths
    assert run.settings.train.iterations == 30


def test_a_notebook_shows_a_picture_without_a_network(made, untrained):
    html = made._repr_html_()
    assert "data:image/jpeg;base64," in html and "F-score 5cm" in html
    assert "http" not in html and "mesh.ply" in html
    # of a run that trains nothing, the mesh itself where nothing else is drawn
    assert "data:image/jpeg;base64," in room2dgs.open_run(untrained)._repr_html_()


def test_what_is_there_is_shown_of_a_run_that_was_stopped(made, tmp_path):
    (tmp_path / "config.yaml").write_bytes((made.path / "config.yaml").read_bytes())
    html = room2dgs.open_run(tmp_path)._repr_html_()
    assert "config.yaml" in html and "<img" not in html


def test_it_is_scored_exported_and_reported_again(made, copied):
    run = room2dgs.open_run(copied(made.path))
    before = run.scores
    scores = run.evaluate(log=lambda _: None, eval__threshold_m=0.2)
    assert scores["threshold_m"] == 0.2 and "f_score_5cm" not in scores
    assert scores["f_score_20cm"] >= before["f_score_5cm"]
    assert scores["psnr_db"] == before["psnr_db"]
    files = run.export("glb", "splats", log=lambda _: None)
    assert files == [run.path / "export/mesh.glb", run.path / "export/splats.ply"]
    assert all(path.stat().st_size for path in files)
    (run.path / "report.html").unlink()
    assert run.report(log=lambda _: None, report__views=1) == run.path / "report.html"
    assert (run.path / "report.html").is_file()


def test_a_run_that_was_stopped_goes_on_to_the_same_bits(made, room, tmp_path, monkeypatch):
    class Stopped(Exception):
        pass

    def stopped(*_):
        raise Stopped

    out = tmp_path / "run"
    with monkeypatch.context() as patched:
        patched.setattr(steps, "make_mesh", stopped)
        with pytest.raises(Stopped):
            room2dgs.reconstruct(room, out, log=lambda _: None, points__file=room / "points.ply", **SETTINGS)
    with pytest.raises(room2dgs.InputError, match="holds another run; add resume=true"):
        room2dgs.reconstruct(room, out, log=lambda _: None)
    run = room2dgs.reconstruct(out=out, resume=True, log=lambda _: None)
    for name in RESULTS:
        assert (run.path / name).read_bytes() == (made.path / name).read_bytes(), name


@pytest.mark.parametrize(
    ("given", "settings", "sentence"),
    [
        (("room",), {}, "out is not given"),
        ((), {"out": "run"}, "scene.path is not given"),
        ((3, "run"), {}, "scene.path is 3, but a path is wanted"),
        (("nowhere", "run"), {}, "nowhere is not there"),
        (("room", "run"), {"train__iteration": 3}, "train.iteration is no setting; did you mean train.iterations"),
        (("room", "run"), {"train": {"iterations": "many"}}, "train.iterations=many does not fit"),
        (("room", "run"), {"prior": "best"}, "prior=best is not known; choose from"),
        (("room", "run"), {"mesh__source": "pillows"}, "mesh.source=pillows is not known; choose from surfels, depth"),
        (("room", "run"), {"train__iterations": object()}, "which no setting can be"),
        (("room", "run"), {"video": "walk.mp4"}, "scene.path has poses already"),
        ((), {"out": "run", "video": "walk.mp4", "images": "photos"}, "give video=FILE or images=DIR and not both"),
    ],
)
def test_what_is_wrong_is_one_sentence_and_leaves_nothing(tmp_path, monkeypatch, given, settings, sentence):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(room2dgs.InputError) as error:
        room2dgs.reconstruct(*given, **settings)
    assert sentence in str(error.value) and "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_values_of_a_wrong_kind_get_a_sentence(made, tmp_path):
    run = room2dgs.open_run(made.path)
    for wrong, sentence in (
        (lambda: room2dgs.reconstruct("room", tmp_path / "x", resume="yes"), "resume is 'yes', but True or False"),
        (lambda: room2dgs.reconstruct("room", tmp_path / "x", log="log.txt"), "log is 'log.txt', but a function"),
        (lambda: run.export(3), "a format is 3, but names are wanted"),
        (lambda: run.export(["glb"]), "a format is \\['glb'\\], but names are wanted"),
        (lambda: run.export("glb", log=3), "log is 3, but a function"),
        (lambda: run.report(log="x"), "log is 'x', but a function"),
        (lambda: run.evaluate(log="x"), "log is 'x', but a function"),
    ):
        with pytest.raises(room2dgs.InputError, match=sentence):
            wrong()
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("wrong", ["", "config.yaml", "elsewhere"])
def test_a_folder_that_is_no_run_cannot_be_opened(made, tmp_path, wrong):
    if wrong == "config.yaml":
        shutil.copy(made.path / "mesh.ply", tmp_path / "config.yaml")  # a file of this name, but no settings
    with pytest.raises(room2dgs.InputError, match=r"holds no run|is not the configuration of a run"):
        room2dgs.open_run(tmp_path / wrong if wrong == "elsewhere" else tmp_path)


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, room2dgs\nassert 'reconstruct' in dir(room2dgs)\n"
        "assert not {'torch', 'open3d', 'cv2', 'numpy', 'hydra'} & set(sys.modules)\n"
        "room2dgs.reconstruct\nassert not {'torch', 'open3d', 'pycolmap'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path.home())
