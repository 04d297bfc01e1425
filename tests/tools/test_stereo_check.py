"""`tools/stereo_check`: its table on a wall whose depth is known."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pandas as pd
import pytest

from room2dgs.tools.stereo_check.__main__ import main


@pytest.fixture
def measured_wall(wall, tmp_path):
    """The wall with depth maps that are 4 cm too far: what stereo finds is within 5 cm and not within 2."""
    folder = tmp_path / "wall"
    shutil.copytree(wall, folder)
    (folder / "depth").mkdir()
    for photo in sorted((folder / "color").iterdir()):
        height, width = cv2.imread(str(photo)).shape[:2]
        cv2.imwrite(str(folder / "depth" / f"{photo.stem}.png"), np.full((height, width), 2040, np.uint16))
    return folder


def test_the_table_says_what_is_right_and_what_it_costs(measured_wall, tmp_path, capsys):
    out = tmp_path / "out"
    points = ["points.source=file", f"points.file={measured_wall / 'points.ply'}"]
    assert main([str(measured_wall), f"out={out}", "widths=64,48", *points]) == 0
    table = pd.read_csv(out / "stereo.csv")
    assert list(table["scene"]) == ["wall 64x48", "wall 48x36"]
    for row in table.to_dict("records"):
        assert row["photos"] == 8
        assert 0.3 < row["kept"] <= 1
        assert row["2 cm"] < 0.4 and row["5 cm"] > 0.8
        assert row["AbsRel"] == pytest.approx(0.04 / 2.04, abs=0.008)
        assert row["seconds a photo"] >= 0 and row["threads"] >= 1 and row["scaling"] > 0
        assert row["sweep / bare"] > 0.5  # a sweep also draws, lends and weighs: it cannot be much faster
    said = capsys.readouterr().out
    assert "sweep / bare" in said and "commit" in said


def test_a_capture_without_depth_is_refused(wall, capsys):
    assert main([str(wall)]) == 2
    assert "add a depth folder" in capsys.readouterr().err
