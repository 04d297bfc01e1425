"""Each bad capture is bad in its own way, and only in that."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from room2dgs.tools.make_bad_captures import KINDS, main


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    out = tmp_path_factory.mktemp("bad")
    assert main([str(out), "--frames", "8", "--width", "64", "--height", "48"]) == 0
    return {
        kind: (
            np.stack([np.loadtxt(out / kind / f"pose/{i}.txt") for i in range(8)]),
            np.stack([cv2.imread(str(out / kind / f"color/{i}.jpg")) for i in range(8)]).astype(float),
        )
        for kind in KINDS
    }


@pytest.mark.slow
def test_each_kind_differs_from_the_good_one_in_what_it_is_about(captures):
    poses, photos = captures["good"]
    for kind in ("exposure", "people", "blurred", "mirror"):
        np.testing.assert_array_equal(captures[kind][0], poses)
        assert np.abs(captures[kind][1] - photos).mean() > 0.3, kind
    step = np.linalg.norm(np.diff(captures["small_steps"][0][:, :3, 3], axis=0), axis=1)
    assert step.max() < 0.03 < np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).min()
    assert np.ptp(captures["turning"][0][:, :3, 3], axis=0).max() == 0
    brightness = captures["exposure"][1].mean(axis=(1, 2, 3)) / photos.mean(axis=(1, 2, 3))
    assert brightness.max() / brightness.min() > 1.3
    sharp = [cv2.Laplacian(image, cv2.CV_64F).std() for image in captures["blurred"][1]]
    before = [cv2.Laplacian(image, cv2.CV_64F).std() for image in photos]
    assert (np.array(sharp[1::2]) < np.array(before[1::2])).all() and np.allclose(sharp[0::2], before[0::2])
