"""report.html: whole in itself, escaped, and what it shows is what the run left."""

from __future__ import annotations

import base64
import json
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from room2dgs.eval.shading import error_color
from room2dgs.json_files import update_json
from room2dgs.mesh.io import write_mesh
from room2dgs.runs.page.mesh_layer import page_mesh, with_error, with_expected
from room2dgs.runs.page.plots import HELD_OUT, PSNR, drawings, read_plots, ticks
from room2dgs.runs.page.surfel_layer import turned_over
from room2dgs.runs.page.trust import picture, sentences
from room2dgs.runs.page.write import SCRIPTS as SCRIPT_FILES
from room2dgs.runs.trust import read_trust

CODE = SCRIPT_FILES  # three.js and ours
SCRIPTS = {"scene", "views", "bytes-mesh", "bytes-discs"}
MB = 1_000_000


class Page(HTMLParser):
    """Tags with their attributes, the text of scripts by id, and the text outside of them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.scripts: dict[str, str] = {}
        self.code: list[str] = []
        self.text = ""
        self._in: str | None = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag in ("script", "style"):
            self._in = dict(attrs).get("id", "")

    def handle_endtag(self, tag):
        if tag in ("script", "style"):
            self._in = None

    def handle_data(self, data):
        if self._in is None:
            self.text += data
        elif self._in:
            self.scripts[self._in] = self.scripts.get(self._in, "") + data
        else:
            self.code.append(data)


@pytest.fixture(scope="module")
def page(reported) -> Page:
    return Page(reported.path.read_text(encoding="utf-8"))


def arrays(page: Page, name: str, *kinds: tuple[str, int]) -> list[np.ndarray]:
    """A block's arrays, as room.js reads them: each begins at a multiple of four bytes."""
    raw = zlib.decompress(base64.b64decode(page.scripts[f"bytes-{name}"]))
    found, at = [], 0
    for kind, count in kinds:
        found.append(np.frombuffer(raw, kind, count, at))
        at += -(-found[-1].nbytes // 4) * 4
    assert at == len(raw)
    return found


def test_nothing_is_loaded_from_elsewhere(page, reported):
    for tag, attributes in page.tags:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        for name in ("src", "action", "data", "poster"):
            assert attributes.get(name, "data:").startswith("data:"), (tag, attributes)
        if "href" in attributes:  # files beside the page, and those alone
            assert tag == "a" and (reported.out / attributes["href"]).is_file() and "download" in attributes
    policy = next(a["content"] for t, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in policy and "http" not in policy
    assert not re.search(r"url\(|@import", "".join(code for code in page.code if "Three.js" not in code))
    assert reported.path.stat().st_size < 15 * MB


def test_text_of_the_user_is_text(page, reported):
    assert f"photos of {reported.capture.name} by" in page.text  # unescaped by the parser: it was escaped in the file
    assert "<b>the normals</b> are poor" in page.text
    ids = {attributes["id"] for tag, attributes in page.tags if tag == "script" and "id" in attributes}
    assert ids == SCRIPTS
    assert len([tag for tag, _ in page.tags if tag == "script"]) == len(SCRIPTS) + len(CODE)


def test_the_page_says_what_the_run_was(page):
    for words in ("0.625", "12.3 mm", "0.75 GB", "90%", "train.iterations", "Only 6 photos", "PSNR of 19.0 dB"):
        assert words in page.text, words


def test_the_mesh_comes_back_within_a_step(page, reported):
    about = json.loads(page.scripts["scene"])["mesh"]
    layers = about["layers"]
    assert layers == ["color", "shape", "error", "seen"]
    vertices, faces = about["vertices"], about["faces"]
    place, index, *colors, off_mm = arrays(
        page, "mesh", ("<u2", 3 * vertices), ("<u4", 3 * faces), *[("u1", 3 * vertices)] * len(layers), ("u1", vertices)
    )
    points = np.array(about["low"]) + place.reshape(-1, 3) * about["step"]
    true = np.asarray(reported.mesh.vertices)
    assert vertices == len(true) and np.abs(points - true).max() <= about["step"]
    assert np.array_equal(index.reshape(-1, 3), reported.mesh.faces)
    assert (colors[0] == 200).all()
    assert (colors[2].reshape(-1, 3) == np.round(np.array([0.15, 0.30, 0.80]) * 255)).all()  # no error: blue
    assert (off_mm == 1).all()  # the depth that was kept is the wall's: within a millimetre
    assert len(np.unique(colors[3].reshape(-1, 3), axis=0)) > 1  # the wall's ends are seen by fewer photos


def test_discs_face_as_the_mesh_does(page, reported):
    count = json.loads(page.scripts["scene"])["discs"]["count"]
    assert count == len(reported.surfels.centers)
    kinds = (("<u2", 3 * count), ("<f4", 2 * count), ("<i2", 4 * count), ("u1", 4 * count))
    _, scales, turned, color = arrays(page, "discs", *kinds)
    w, x, y, z = turned.reshape(-1, 4).T / 32767
    normal_z = w * w - x * x - y * y + z * z
    facing = np.sign(reported.mesh.face_normals[:, 2].mean())
    assert np.allclose(normal_z, facing, atol=1e-3)
    assert np.allclose(scales, 0.04)
    assert color.reshape(-1, 4)[0].tolist() == [round((0.5 + 0.28209479 * 0.5) * 255)] * 3 + [204]


def test_a_disc_turned_over_is_the_same_disc():
    from scipy.spatial.transform import Rotation

    one = np.array([[0.5, -0.1, 0.7, 0.3]]) / np.linalg.norm([0.5, -0.1, 0.7, 0.3])
    before, after = (Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()[0] for q in (one, turned_over(one)))
    assert np.allclose(after[:, 0], before[:, 0])
    assert np.allclose(after[:, 1:], -before[:, 1:])


def test_cameras_stand_where_the_photos_were_taken(page, reported):
    about = json.loads(page.scripts["scene"])
    frames = {frame.name: frame for frame in reported.scene.frames}
    assert {one["name"] for one in about["cameras"]} == set(frames)
    for one in about["cameras"]:
        camera = frames[one["name"]].camera
        assert np.allclose(one["at"], camera.centre, atol=1e-4)
        ahead = np.array(one["turn"]).reshape(3, 3) @ [0, 0, 1]
        assert np.allclose(ahead, camera.forward, atol=1e-5)
        assert one["fy"] == pytest.approx(camera.K[1, 1], abs=1e-3) and one["photo"].startswith("data:image/jpeg")
    in_order = sorted(frames.values(), key=lambda frame: frame.index)
    assert np.allclose(about["path"], [frame.camera.centre for frame in in_order], atol=1e-4)


def test_nothing_tells_of_the_folders_of_the_machine(page, reported):
    attributes = [value or "" for _, found in page.tags for value in found.values()]
    written = [page.text, page.scripts["scene"], *(value for value in attributes if not value.startswith("data:"))]
    for folder in {reported.capture.parents[1], reported.out.parent, Path.home()}:
        assert not [text for text in written if str(folder) in text]


def test_views_have_their_pictures(page):
    views = json.loads(page.scripts["views"])
    assert [view["title"].split("(")[1] for view in views] == ["held out)"] * 2 + ["training)"] * 2
    assert "trust" not in views[0]["pictures"] and "trust" in views[2]["pictures"]
    for view in views:
        assert all(uri.startswith("data:image/jpeg;base64,") for uri in view["pictures"].values())


def test_curves_are_those_of_the_log(reported):
    plots = read_plots((reported.out / "log.txt").read_text().splitlines())
    assert plots["loss"]["training"] == {10: 0.5, 20: 0.25}  # what the resumed run did anew counts
    assert plots["loss: normal_prior"]["training"] == {10: 0.1, 20: 0.05}
    assert plots[PSNR] == {"training views": {10: 18.0, 20: 24.0}, HELD_OUT: {20: 22.5}}
    drawn = {one["title"]: one for one in drawings(plots)}
    assert drawn["loss"]["lines"][0]["points"] == "56.0,10.0 310.0,150.0"  # it falls
    assert [tick["label"] for tick in drawn["loss"]["up"]] == ["0.3", "0.4", "0.5"]
    assert float(drawn["loss"]["up"][-1]["at"]) == 10.0 and drawn["loss"]["across"][0] == {"at": "56.0", "label": "10"}


@pytest.mark.parametrize("kind", ["surfels", "Gaussians"])
def test_the_curve_of_their_number_is_called_what_they_are(kind):
    log = [f"iteration {n}0/20: loss 0.5 (rgb 0.5), PSNR 20.00 dB, {n * 100} {kind}, 9.0 it/s" for n in (1, 2)]
    plots = read_plots(log)
    assert plots[kind] == {"training": {10: 100.0, 20: 200.0}}
    assert [one["title"] for one in drawings(plots)] == [PSNR, "loss", kind, "loss: rgb"]


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
def test_ticks_are_round_even_and_inside(low, width):
    found = ticks(low, low + width)
    assert 1 <= len(found) <= 6
    assert all(low - 1e-6 * width <= one <= low + width * (1 + 1e-6) for one in found)
    if len(found) > 1:
        step = found[1] - found[0]
        assert np.allclose(np.diff(found), step) and f"{step:.0e}"[0] in "125"


def test_trust_is_told_apart_by_its_source(reported):
    maps = read_trust(reported.out / "trust.npz")
    assert set(maps) == {frame.name for frame in reported.scene.train}
    drawn = picture(next(iter(maps.values()))).astype(int)
    nothing, network, stereo = drawn[4, 8], drawn[18, 8], drawn[40, 8]
    assert np.ptp(nothing) == 0 and network.argmax() == 2 and stereo.argmax() == 1
    said = " ".join(sentences(maps, "room_prior"))
    assert "in 50% of the pixels; trusted 50%" in said and "25% have depth of network (room_prior) alone" in said
    (reported.out / "damaged.npz").write_bytes(b"no archive")
    assert read_trust(reported.out / "damaged.npz") == {}


def test_the_error_of_an_aligned_mesh_is_where_it_belongs(tmp_path):
    """error.ply is in the truth's frame then, here turned by half and shifted."""
    box = trimesh.creation.box((4.0, 3.0, 2.0)).subdivide_to_size(0.5)
    wrong = box.vertices[:, 0] > 1.9
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    turn[:3, 3] = [0.3, -0.2, 0.1]
    colors = np.where(wrong[:, None], [255, 0, 0, 255], [0, 0, 255, 255]).astype(np.uint8)
    scored = trimesh.Trimesh(
        box.vertices @ turn[:3, :3].T + turn[:3, 3], box.faces, vertex_colors=colors, process=False
    )
    (tmp_path / "eval").mkdir()
    write_mesh(tmp_path / "eval/error.ply", scored)
    update_json(tmp_path / "metrics.json", {"protocol": "area", "align": {"truth_from_pred": turn.tolist()}})
    layer = with_error(page_mesh(box, 10**6), tmp_path, (0.0, 0.0, 0.0)).layers["error"]
    np.testing.assert_array_equal(layer[:, 0] > 200, wrong)


def test_the_expected_error_has_the_colours_of_the_true_one():
    box = trimesh.creation.box((4.0, 3.0, 2.0)).subdivide_to_size(0.5)
    told = np.where(box.vertices[:, 0] > 1.9, 0.2, 0.0).astype(np.float32)
    box.vertex_attributes["expected_error"] = told
    room = page_mesh(box, 10**6)
    layer = with_expected(room, box, 0.1).layers["expected"]
    np.testing.assert_array_equal(layer, np.round(error_color(told, 0.1) * 255))
    np.testing.assert_array_equal(with_expected(room, box, 0.1).off_m, told)  # the ± of the page's tape
    del box.vertex_attributes["expected_error"]
    assert with_expected(room, box, 0.1) is room
