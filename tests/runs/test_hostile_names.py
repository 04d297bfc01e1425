"""A photo and a capture with hostile names through a whole run: nothing that it writes or prints runs or colours."""

from __future__ import annotations

import csv
import json
import math
import shutil

import pytest

from room2dgs import cli

# a file's name has no slash; views are called by letters that fit a file's name, if enough are left
NAMES = ("a\x1b[31m<script>alert(1)<\u2215script>\n\r", "=<script>alert(1)<\u2215script>,\"b|'{{7*7}}")


@pytest.fixture(scope="module")
def hostile(wall, tmp_path_factory):
    """The wall as transforms.json, with its first photos and its folder called so."""
    root = tmp_path_factory.mktemp("hostile") / "<b>\x1b[1m${out}"
    (root / "images").mkdir(parents=True)
    frames = []
    for view in range(8):
        name = f"images/{NAMES[view] if view < len(NAMES) else view}.png"
        shutil.copy(wall / f"color/{view}.png", root / name)
        pose = [[1, 0, 0, 0.1 * view], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
        frames.append({"file_path": name, "transform_matrix": pose})
    lens = {"fl_x": 60.0, "fl_y": 60.0, "cx": 32.0, "cy": 24.0, "w": 64, "h": 48}
    (root / "transforms.json").write_text(json.dumps({**lens, "frames": frames}))
    shutil.copy(wall / "points.ply", root / "points.ply")
    shutil.copy(wall / "gt_mesh.ply", root / "gt_mesh.ply")
    return root


def test_no_door_out_lets_a_name_through(hostile, tmp_path, capsys):
    out = tmp_path / "${oc.env:HOME}"
    settings = ["prior=none", "seeds.init=sfm", "points.source=file", f"points.file={hostile / 'points.ply'}"]
    settings += ["train.iterations=4", "mesh.voxel_m=0.1", "mesh.min_triangles=1", "scene.test_every=4"]
    settings += ["eval.samples=500", "report.views=2", "sfm.refine_poses=false", f"eval.gt={hostile / 'gt_mesh.ply'}"]
    assert cli.main(["run", f"scene.path={hostile}", f"out={out}", *settings]) == 0
    assert cli.main(["export", f"run={out}", "to=transforms,ply,colmap_text"]) == 0
    assert cli.main(["table", str(out), f"out={tmp_path / 'table'}"]) == 0
    said = capsys.readouterr()
    for text in (said.out, said.err, (out / "log.txt").read_text()):
        assert all(letter.isprintable() or letter == "\n" for letter in text)
    pages = [out / "report.html", tmp_path / "table" / "table.html"]
    for path in pages:
        text = path.read_text()
        assert "\x1b" not in text and "<script>alert" not in text and "<b>\\x1b" not in text
    assert "[1m" in pages[0].read_text() and "script_alert_1_" in pages[0].read_text()
    assert "\u2502 mesh against ground truth   \u2502" in (out / "log.txt").read_text()  # our own lines stay lines
    for path in (tmp_path / "table").glob("*.csv"):
        assert len(list(csv.reader(path.open()))) == 2
    assert math.isfinite(json.loads((out / "metrics.json").read_text())["psnr_db"])
    assert all("\x1b" not in path.name and "\n" not in path.name for path in out.rglob("*"))
