"""A real capture in every layout: what is compared, and that a difference is seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.captures.read import read_scene
from room2dgs.tools.capture_layouts.__main__ import differences, main
from room2dgs.tools.capture_layouts.made import image_file
from room2dgs.tools.capture_layouts.real import made_of
from room2dgs.tools.capture_layouts.registry import LAYOUTS
from room2dgs.tools.capture_layouts.scannet import scannet


@pytest.fixture
def capture(wall, tmp_path):
    """The wall with depth, which it does not bring."""
    import shutil

    root = tmp_path / "capture"
    shutil.copytree(wall, root)
    for view in range(8):
        image_file(root / f"depth/{view}.png", np.full((48, 64), 2000, np.uint16))
    return root


def test_a_capture_comes_back_from_its_numbers_and_a_change_of_one_is_told(capture, tmp_path, default_config):
    made = made_of(capture, 1, 5, 1)
    assert made.count == 5 and made.poses[0, 0, 3] == pytest.approx(0.1)
    np.testing.assert_allclose(made.xyz[:, 2], 2.0, atol=1e-9)
    assert all(len(index) > 500 for index, _ in made.seen)
    made = replace(made, jpegs=tuple(made.jpeg(i) for i in range(made.count)))
    wrong = made.poses.copy()
    wrong[3, 1, 3] += 1e-4
    found = {}
    for name, poses in (("right", made.poses), ("wrong", wrong)):
        scannet(tmp_path / name, replace(made, poses=poses))
        config = replace(default_config.scene, path=str(tmp_path / name), test_every=0)
        found[name] = differences(read_scene(config), made, LAYOUTS["scannet"])
    assert found["right"].pose < 1e-12 and found["right"].depth_m < 1e-6 and found["right"].K == 0
    assert found["wrong"].pose == pytest.approx(1e-4, abs=1e-9)
    assert found["right"].digest != found["wrong"].digest


def test_the_table_has_a_row_for_each_layout(capture, tmp_path, capsys):
    given = [str(capture), str(tmp_path / "out"), "--frames", "4", "--no-mesh", "--layouts", "tum", "colmap_binary"]
    assert main(given) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith(("| tum", "| colmap"))]
    assert len(rows) == 4  # as they come, and the whole table
    assert main([str(capture), str(tmp_path / "out"), "--frames", "40", "--no-mesh"]) == 2
    assert "too few" in capsys.readouterr().err
