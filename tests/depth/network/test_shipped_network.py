"""The network that is shipped keeps to what its settings say of it; how good it is, `room2dgs bench prior` measures."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest

from room2dgs.config import load_config
from room2dgs.depth.network.card import format_of
from room2dgs.depth.network.network import predictions, same_input
from room2dgs.depth.network.session import open_network
from room2dgs.depth.network.shipped import model_path, shipped_network
from room2dgs.geometry.camera import Camera

MAX_BYTES = 12_000_000


@pytest.fixture(scope="module")
def session():
    return onnxruntime.InferenceSession(str(shipped_network()), providers=["CPUExecutionProvider"])


def test_it_is_small_and_has_a_model_card():
    path = shipped_network()
    assert path.stat().st_size <= MAX_BYTES
    assert "Apache-2.0" in (path.parent / "README.md").read_text(encoding="utf-8")


def test_its_inputs_and_outputs_have_the_names_that_its_card_gives(session):
    prior = load_config(["scene.path=a", "out=b", "prior=room_prior"]).prior
    depth, normal = (format_of(getattr(prior, kind), kind) for kind in ("depth", "normal"))
    inputs = {arg.name: arg for arg in session.get_inputs()}
    outputs = {arg.name for arg in session.get_outputs()}
    assert set(inputs) == {depth.input, depth.intrinsics}
    assert inputs["image"].shape[:2] == [1, 3] and inputs["intrinsics"].shape == [1, 3, 3]
    named = {depth.output, depth.error_output, normal.output, normal.error_output}
    assert outputs == named == {"depth", "depth_error", "normal", "normal_error"}
    # one inference gives both
    assert same_input(depth, normal)
    assert model_path(prior.depth) == model_path(prior.normal) == shipped_network()


@pytest.mark.parametrize("size", [(96, 128), (64, 160)])
def test_any_multiple_of_32_gives_metres_unit_normals_and_positive_errors(session, size):
    image = np.random.default_rng(0).uniform(0, 1, (1, 3, *size)).astype(np.float32)
    K = np.array([[[100.0, 0, size[1] / 2], [0, 100.0, size[0] / 2], [0, 0, 1]]], np.float32)
    names = ["depth", "depth_error", "normal", "normal_error"]
    found = dict(zip(names, session.run(names, {"image": image, "intrinsics": K}), strict=True))
    for name, values in found.items():
        assert values.shape == (1, 3 if name == "normal" else 1, *size) and values.dtype == np.float32
        assert np.isfinite(values).all()
    assert all((found[name] > 0).all() for name in ("depth", "depth_error", "normal_error"))
    np.testing.assert_allclose(np.linalg.norm(found["normal"], axis=1), 1, atol=1e-3)
    x, y = np.meshgrid(*((np.arange(side) + 0.5 - side / 2) / 100 for side in size[::-1]))
    facing = -(found["normal"][0] * np.stack([x, y, np.ones_like(x)])).sum(0)
    assert (facing > 0).mean() > 0.95


def test_the_settings_run_it_on_a_photo_of_any_shape():
    prior = load_config(["scene.path=a", "out=b", "prior=room_prior"]).prior
    session, networks = None, []
    for kind in ("depth", "normal"):
        given = format_of(getattr(prior, kind), kind)
        networks.append(open_network(shipped_network(), kind, given, 1, "cpu", session))
        session = networks[0].session
    photo = np.random.default_rng(0).integers(0, 255, (130, 100, 3), dtype=np.uint8)
    camera = Camera(np.array([[90.0, 0, 50], [0, 90.0, 65], [0, 0, 1]]), 100, 130, np.eye(4))
    depth, normal = predictions(networks, photo, camera)
    assert depth.valid.all() and depth.values.shape == depth.error.shape == normal.valid.shape
    height, width = depth.values.shape
    assert height % 32 == width % 32 == 0 and height > width
    # twice the focal length with the same pixels is another scene
    longer = Camera(camera.K * [[2], [2], [1]] - [[0, 0, 50], [0, 0, 65], [0, 0, 0]], 100, 130, np.eye(4))
    assert np.abs(predictions(networks[:1], photo, longer)[0].values / depth.values - 1).max() > 0.01
