"""An ablation's pictures: the same cameras and colours for every row, in one page without a network."""

from __future__ import annotations

import base64
import re

import cv2
import numpy as np
import pytest

import room2dgs.eval.pictures
from room2dgs.captures.scene import Frame, Scene
from room2dgs.eval.pictures import COLUMNS
from room2dgs.mesh.io import write_mesh
from room2dgs.study.ablation import Run, Study, rows_of
from room2dgs.study.ablation_page import page
from room2dgs.study.ablation_pictures import ERROR, mesh_views
from room2dgs.study.ablation_report import write_page


@pytest.fixture
def scene(make, tmp_path, monkeypatch):
    monkeypatch.setattr(room2dgs.eval.pictures, "TILE_WIDTH", 48)
    monkeypatch.setattr(room2dgs.eval.pictures, "TOP_PIXELS", 60)
    frames = []
    for index, camera in enumerate(make.all_around()):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.full((camera.height, camera.width, 3), 90, np.uint8))
        frames.append(Frame(f"{index:06d}", camera, tmp_path / f"{index}.png"))
    write_mesh(tmp_path / "gt.ply", make.room())
    return Scene(tmp_path, tuple(frames), (), gt_mesh=tmp_path / "gt.ply")


@pytest.fixture
def study(make, tmp_path):
    """full is exact, no_depth lies 3 cm off everywhere, no_mv failed, no_seed is the same run as full."""
    shifted = make.room(size=tuple(side + 0.06 for side in make.SIZE))
    runs = []
    for row, mesh, f in (("full", make.room(), 0.9), ("no_depth", shifted, 0.5)):
        folder = tmp_path / row
        folder.mkdir()
        write_mesh(folder / "mesh.ply", mesh)
        runs.append(Run(row, 3, folder, {"f_score_5cm": f, "priors": "simulated" if row == "full" else "none"}))
    runs.append(Run("no_mv", 3, tmp_path / "gone", None, "killed by signal 9 <out of memory?>"))
    runs.append(Run("no_seed", 3, tmp_path / "full", runs[0].metrics, "", "full"))
    return Study("Ablation of a <room>", "room2dgs ablate a&b", 0.05, rows_of(runs, {"full": "a < b"}, 0.05))


def meshes(study: Study) -> dict:
    return {name: study.rows[index].runs[0].folder / "mesh.ply" for index, name in enumerate(("full", "no_depth"))}


def test_rows_are_seen_by_the_same_cameras_on_one_scale(scene, study):
    views = mesh_views(meshes(study), scene.gt_mesh, scene, 0.05)
    assert [view.title for view in views] == ["view 1", "view 2", "view 3", "view 4", "from above"]
    assert views[-1].photo is None and all(view.photo is not None for view in views[:-1])
    for view in views:
        assert list(view.tiles) == ["full", "no_depth"]
        exact, off = (view.tiles[row][ERROR].astype(float) for row in view.tiles)
        assert exact.shape == off.shape
        red_over_blue = [picture[..., 0] - picture[..., 2] for picture in (exact, off)]
        assert np.median(red_over_blue[0]) < -0.2  # 0 cm is blue
        assert np.median(red_over_blue[1] - red_over_blue[0]) > 0.1  # 3 cm of 10 is on its way to yellow


def test_the_page_stands_alone_and_shows_every_mesh(scene, study):
    views = mesh_views(meshes(study), scene.gt_mesh, scene, 0.05)
    text = page(study, [], ["one > two"], views)
    assert not re.findall(r"(?:src|href)=\"(?!data:)|url\(|https?:|<script|<link|@import", text)
    images = re.findall(r'<img alt="([^"]*)" src="data:image/jpeg;base64,([^"]+)"', text)
    assert len(images) == len(COLUMNS) * (5 * 2 + 4)  # rows in five views, photos in four
    for caption, encoded in images:
        picture = cv2.imdecode(np.frombuffer(base64.b64decode(encoded), np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None and picture.shape[0] > 10
        assert caption == "photo" or "seed 3" in caption
    assert sum("no_depth, seed 3, priors: none, F @ 5cm 0.500" in caption for caption, _ in images) == 15
    assert sum("priors: simulated" in caption for caption, _ in images) == 15
    assert "simulated priors" in text
    for escaped in ("Ablation of a &lt;room&gt;", "a&amp;b", "a &lt; b", "one &gt; two", "9 &lt;out of memory?&gt;"):
        assert escaped in text
    assert "same settings as full" in text


def test_files_appear_and_a_study_without_truth_has_no_pictures(scene, study, tmp_path):
    out = tmp_path / "study"
    write_page(study, out, scene, scene.gt_mesh)
    assert sorted(path.name for path in out.iterdir()) == ["ablation.html", "ablation.png"]
    assert cv2.imread(str(out / "ablation.png")).std() > 5
    write_page(study, tmp_path / "blind", scene, None)
    assert [path.name for path in (tmp_path / "blind").iterdir()] == ["ablation.html"]
    assert "<img" not in (tmp_path / "blind/ablation.html").read_text(encoding="utf-8")
