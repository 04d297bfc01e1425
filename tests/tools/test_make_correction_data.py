"""Completed depth of filmed rooms with how far off it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from room2dgs.depth.completion import evidence
from room2dgs.tools import make_correction_data
from room2dgs.tools.correction_network.samples import read_rooms

pytestmark = pytest.mark.slow


def test_a_room_becomes_evidence_and_truth_of_both_looks_and_is_kept(tmp_path, monkeypatch):
    honest = make_correction_data.capture_options
    small = {
        "photos": 14,
        "width": 160,
        "height": 120,
        "pose_noise_deg": 0.0,
        "pose_noise_cm": 0.0,
        "sensor_noise": 1.0,
    }
    monkeypatch.setattr(make_correction_data, "capture_options", lambda *given: replace(honest(*given), **small))
    folder = make_correction_data.make_room(tmp_path / "data", 5, 1)
    (room,) = read_rooms(tmp_path / "data").values()
    count = len(room.shift)
    assert count >= 20 and count % 2 == 0 and room.evidence.shape[2:] == (120, 160)
    found, shift = room.evidence.astype(np.float32), room.shift.astype(np.float32)
    assert np.isfinite(found).all() and np.isfinite(shift).mean() > 0.8
    # truth and completed depth are of the same pixels: stereo's, where it is trusted, leads to the truth
    held = np.isfinite(shift) & (found[:, evidence.SAMPLE_WEIGHT] > 0.4)
    assert held.mean() > 0.05 and np.median(np.abs(shift - found[:, evidence.SAMPLE])[held]) < 0.02
    before = (folder / "shift.npy").stat().st_mtime_ns
    assert make_correction_data.make_room(tmp_path / "data", 5, 1) == folder
    assert (folder / "shift.npy").stat().st_mtime_ns == before
