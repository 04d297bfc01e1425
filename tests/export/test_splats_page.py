"""Splats as one page: what lies inside, and that a browser draws it without asking for anything else."""

from __future__ import annotations

import base64
import importlib.util
import json
import re
import zlib
from pathlib import Path

import numpy as np
import pytest
import torch

from room2dgs.export.splats_page import splats_page
from room2dgs.geometry.camera import Camera
from room2dgs.geometry.rotations import normals

spec = importlib.util.spec_from_file_location("chromium", Path(__file__).parents[1] / "runs/chromium.py")
chromium = importlib.util.module_from_spec(spec)
spec.loader.exec_module(chromium)

UP = np.array([0, 0, 1.0])
LOOK = """
new Promise((done) => {
  const look = () => {
    const frame = document.getElementById("viewer"), canvas = frame?.querySelector("canvas");
    const { shown, drawn, mode } = frame?.dataset ?? {};
    if (shown !== "discs" || !drawn || mode !== "MODE") return setTimeout(look, 20);
    setTimeout(() => done(opaque(canvas)), 700); // the picture is drawn after it was asked for
  };
  const opaque = (canvas) => {
    const small = document.createElement("canvas");
    small.width = small.height = 64;
    const ink = small.getContext("2d");
    ink.drawImage(canvas, 0, 0, 64, 64);
    const pixels = ink.getImageData(0, 0, 64, 64).data;
    return pixels.filter((value, index) => index % 4 === 3 && value > 0).length;
  };
  look();
})"""


@pytest.fixture
def cameras(make) -> list[Camera]:
    return make.all_around()


def blocks(text: str) -> tuple[dict, bytes]:
    about = re.search(r'id="scene">(.*?)</script>', text, re.S)[1]
    discs = re.search(r'id="bytes-discs">(.*?)</script>', text, re.S)[1]
    return json.loads(about), zlib.decompress(base64.b64decode(discs))


def test_the_page_has_every_splat_turned_towards_the_cameras(surfels, cameras):
    about, data = blocks(splats_page(surfels, cameras, UP, "room", "m"))
    count = about["discs"]["count"]
    assert count == len(surfels.centers) == 300
    steps = np.frombuffer(data, "<u2", 3 * count).reshape(-1, 3)
    places = steps * about["discs"]["step"] + about["discs"]["low"]
    np.testing.assert_allclose(places, surfels.centers, atol=2e-4)
    at = 6 * count + 8 * count
    scales = np.frombuffer(data, "<f4", 2 * count, 6 * count).reshape(-1, 2)
    np.testing.assert_allclose(scales, surfels.scales, rtol=1e-6)
    quaternions = torch.from_numpy(np.frombuffer(data, "<i2", 4 * count, at).reshape(-1, 4) / 32767)
    towards = (normals(quaternions).numpy() * (cameras[0].centre - places)).sum(axis=1)
    assert (towards > -1e-3).all()  # all of these cameras stand at one place
    before = (normals(surfels.rotations.double()).numpy() * (cameras[0].centre - places)).sum(axis=1)
    assert (before < 0).any()  # else nothing was to be turned


def test_text_of_the_capture_is_text(surfels, cameras):
    text = splats_page(surfels, cameras, UP, "<script>alert(1)</script>", "m")
    assert "<script>alert" not in text and "default-src 'none'" in text
    assert not re.findall(r"(?:src|href)=[\"']?(?:https?:)?//", text)


@pytest.mark.slow
@pytest.mark.skipif(not chromium.CHROMIUM, reason="no Chromium here (Debian: apt install chromium)")
def test_a_browser_draws_it_and_asks_for_nothing_else(surfels, cameras, tmp_path):
    page = tmp_path / "splats.html"
    large = surfels._replace(scales=surfels.scales * 10)
    page.write_text(splats_page(large, cameras, UP, "room", "m"), encoding="utf-8")
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Page.navigate", url=page.as_uri())
        assert tab.run(LOOK.replace("MODE", "around")) > 20
        for way in ("walk", "above"):
            tab.run(f"document.getElementById('viewer-{way}').click()")
            assert tab.run(LOOK.replace("MODE", way)) > 20
        assert tab.said == []
        assert [one for one in tab.asked_for if not one.startswith(("data:", "blob:"))] == [page.as_uri()]
