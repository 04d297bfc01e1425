"""The comparison of two runs sees what differs, and no times."""

from __future__ import annotations

import zipfile

import pytest

from room2dgs.errors import InputError
from room2dgs.tools.same_bits import built, compared, groups


def test_other_bits_are_named_and_an_archive_s_times_are_not(tmp_path):
    for which, hour in (("old", 1), ("new", 2)):
        out = tmp_path / which
        (out / "priors" / "depth").mkdir(parents=True)
        (out / "mesh.ply").write_bytes(b"mesh" if which == "old" else b"mesH")
        (out / "poses.json").write_bytes(b"same")
        (out / "priors" / "depth" / f"{which}.npy").write_bytes(b"map")
        with zipfile.ZipFile(out / "trust.npz", "w") as archive:
            archive.writestr(zipfile.ZipInfo("a", (2020, 1, 1, hour, 0, 0)), b"same")
    assert compared(tmp_path / "old", tmp_path / "new") == [
        "  mesh.ply: differs",
        "  priors/depth/new.npy: only the newer has it",
        "  priors/depth/old.npy: only the older has it",
    ]


def test_settings_are_grouped_and_captures_found_from_elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert groups(["scene.path=a", "prior=none", "+", "scene.path=b"]) == [
        [f"scene.path={tmp_path / 'a'}", "prior=none"],
        [f"scene.path={tmp_path / 'b'}"],
    ]


def test_an_unknown_commit_is_told(tmp_path):
    with pytest.raises(InputError, match="is no commit"):
        built("0000000", tmp_path)
