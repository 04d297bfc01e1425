"""Networks of every make give the map that their settings say, and a misfit is reported with what they have."""

from __future__ import annotations

import numpy as np
import onnx
import pytest

from room2dgs.config.card import read_card
from room2dgs.depth.network.card import card_format
from room2dgs.depth.network.model_file import read_model
from room2dgs.depth.network.network import predicted
from room2dgs.depth.network.session import open_network
from room2dgs.errors import InputError
from room2dgs.geometry.camera import Camera
from tests.depth.cards import write_card

CAMERA = Camera(np.array([[50.0, 0, 8.5], [0, 50.0, 6.0], [0, 0, 1.0]]), 16, 12, np.eye(4))
MEAN = [("ReduceMean", ["photo"], ["map"], {"axes": [1], "keepdims": 1})]
SAME = [("Identity", ["photo"], ["map"], {})]
STILL = {"height": 12, "width": 16}


@pytest.fixture
def photo() -> np.ndarray:
    return np.random.default_rng(0).integers(1, 255, (12, 16, 3)).astype(np.uint8)


def opened(path, kind="depth", threads=1, **changes):
    card = read_card(write_card(path.with_suffix(".json"), kind, changes))
    return open_network(path, kind, card_format(card, kind), threads, "cpu")


def test_a_depth_map_is_the_networks_own(onnx_file, photo):
    values, valid, _ = predicted(opened(onnx_file(MEAN), white=255, **STILL), photo, CAMERA)
    np.testing.assert_allclose(values, photo.mean(axis=2), rtol=1e-5)
    assert valid.all() and values.dtype == np.float32


@pytest.mark.parametrize("shape", ["1 1 h w", "1 h w", "h w", "1 h w 1"])
def test_any_arrangement_of_one_channel_is_a_map(onnx_file, photo, shape):
    steps = {"1 1 h w": [], "1 h w": [1], "h w": [0, 1], "1 h w 1": [1]}[shape]
    nodes = [("ReduceMean", ["photo"], ["mean"], {"axes": [1], "keepdims": 1})]
    nodes.append(("Squeeze", ["mean", "axes"], ["flat"], {}) if steps else ("Identity", ["mean"], ["flat"], {}))
    nodes.append(
        ("Unsqueeze", ["flat", "last"], ["map"], {}) if shape.endswith("w 1") else ("Identity", ["flat"], ["map"], {})
    )
    path = onnx_file(nodes, constants={"axes": np.array(steps, np.int64), "last": np.array([3], np.int64)})
    values, *_ = predicted(opened(path, white=255, **STILL), photo, CAMERA)
    np.testing.assert_allclose(values, photo.mean(axis=2), rtol=1e-5)


def test_half_precision_is_given_and_taken(onnx_file, photo):
    inputs, outputs = {"photo": ("FLOAT16", (1, 3, 12, 16))}, {"map": ("FLOAT16", None)}
    values, *_ = predicted(opened(onnx_file(MEAN, inputs, outputs), white=255), photo, CAMERA)
    np.testing.assert_allclose(values, photo.mean(axis=2), rtol=1e-3)
    assert values.dtype == np.float32


def test_channels_last_in_and_one_channel_of_three_out(onnx_file, photo):
    path = onnx_file(SAME, {"photo": ("FLOAT", (1, 12, 16, 3))})
    values, *_ = predicted(opened(path, white=255, layout="nhwc", output_channel=2), photo, CAMERA)
    np.testing.assert_allclose(values, photo[..., 2])


def test_canonical_depth_becomes_metres_of_this_focal_length(onnx_file, photo):
    path = onnx_file(MEAN, {"photo": ("FLOAT", (1, 3, 24, 40))})
    canonical, *_ = predicted(opened(path, white=255, fit="pad"), photo, CAMERA)
    metres, valid, _ = predicted(opened(path, white=255, fit="pad", canonical_focal_px=1000), photo, CAMERA)
    # twice as large in the input, so 100 px of focal length there
    np.testing.assert_allclose(metres, 0.1 * canonical, rtol=1e-6)
    assert metres.shape == valid.shape == (24, 32)


def test_intrinsics_and_patches_go_in_where_they_are_named(onnx_file, photo):
    inputs = {"photo": ("FLOAT", (1, 3, "h", "w")), "K": ("FLOAT", (1, 3, 3)), "n": ("INT64", ())}
    nodes = [
        ("ReduceMean", ["photo"], ["mean"], {"axes": [1], "keepdims": 1}),
        ("ReduceSum", ["K"], ["sum"], {"keepdims": 0}),
        ("Cast", ["n"], ["count"], {"to": 1}),
        ("Mul", ["mean", "zero"], ["nought"], {}),
        ("Add", ["nought", "sum"], ["with_K"], {}),
        ("Mul", ["with_K", "count"], ["map"], {}),
    ]
    path = onnx_file(nodes, inputs, constants={"zero": np.float32(0)})
    network = opened(path, intrinsics="K", tokens="n", fit="cover", multiple=4, height=24, width=24)
    values, *_ = predicted(network, photo, CAMERA)
    assert values.shape == (24, 32)
    np.testing.assert_allclose(values, 48 * (100 + 100 + 17 + 12 + 1), rtol=1e-6)
    with pytest.raises(InputError, match=r"wants more than a photo, n; name it as input\.intrinsics"):
        opened(path, input="photo", intrinsics="K")


def test_a_mask_says_what_is_valid(onnx_file, photo):
    nodes = [*MEAN, ("Greater", ["map", "limit"], ["over"], {}), ("Cast", ["over"], ["mask"], {"to": 1})]
    outputs = {"map": ("FLOAT", None), "mask": ("FLOAT", None)}
    path = onnx_file(nodes, outputs=outputs, constants={"limit": np.float32(100)})
    _, valid, _ = predicted(opened(path, white=255, mask="mask", **STILL), photo, CAMERA)
    np.testing.assert_array_equal(valid, photo.mean(axis=2) > 100)


@pytest.mark.parametrize(("values", "white"), [("zero_to_one", 1), ("signed", 1)])
@pytest.mark.parametrize("layout", ["nchw", "nhwc"])
def test_normals_come_as_unit_vectors(onnx_file, values, white, layout):
    rng = np.random.default_rng(1)
    normals = np.abs(rng.normal(size=(12, 16, 3))) + 0.1
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    stored = (normals + 1) / 2 if values == "zero_to_one" else normals
    shape = (1, 3, 12, 16) if layout == "nchw" else (1, 12, 16, 3)
    network = opened(onnx_file(SAME, {"photo": ("FLOAT", shape)}), "normal", values=values, white=white, layout=layout)
    found, valid, _ = predicted(network, np.round(stored * 255).astype(np.uint8), CAMERA)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-5)
    assert valid.all() and (found * normals).sum(axis=-1).min() > 0.9999


def test_the_same_photo_gives_the_same_bits_with_any_number_of_threads(onnx_file, photo):
    kernel = np.random.default_rng(2).normal(size=(1, 3, 5, 5)).astype(np.float32)
    path = onnx_file([("Conv", ["photo", "k"], ["map"], {"pads": [2, 2, 2, 2]})], constants={"k": kernel})
    one, two = (predicted(opened(path, threads=n, **STILL), photo, CAMERA)[0].tobytes() for n in (1, 2))
    assert one == two == predicted(opened(path, threads=2, **STILL), photo, CAMERA)[0].tobytes()


def test_weights_beside_the_model_are_found_from_any_folder(onnx_file, photo, tmp_path, monkeypatch):
    model = onnx.load(str(onnx_file([("Mul", ["photo", "k"], ["map"], {})], constants={"k": np.full((1,), 2, "f")})))
    path = tmp_path / "apart" / "model.onnx"
    path.parent.mkdir()
    onnx.save(model, str(path), save_as_external_data=True, location="model.onnx_data", size_threshold=0)
    monkeypatch.chdir(tmp_path.parent)
    values, *_ = predicted(opened(read_model(path).path, white=255, output_channel=1, **STILL), photo, CAMERA)
    np.testing.assert_allclose(values, 2.0 * photo[..., 1])


HAS = r"in: photo float \(1, 3, any, any\); out: map float"


@pytest.mark.parametrize(
    ("nodes", "kind", "changes", "said"),
    [
        (MEAN, "depth", {"input": "image"}, rf"input\.name=image in the card is not in .*; it has {HAS}"),
        (MEAN, "depth", {"output": "depth"}, rf"depth\.output=depth in the card is not in .*; it has {HAS}"),
        (MEAN, "depth", {"mask": "m"}, rf"depth\.mask=m in the card is not in .*{HAS}"),
        (MEAN, "depth", {"tokens": "n"}, rf"input\.tokens=n in the card is not in .*{HAS}"),
        (MEAN, "depth", {"height": "null"}, r"takes photos of any height; give input\.height in its card"),
        (MEAN, "depth", {"layout": "nhwc"}, r"no three channels where input\.layout=nhwc in its card expects them"),
        (MEAN, "normal", {}, r"gives map as \(1, 1, 12, 16\), no normal map: normals have three channels"),
        (SAME, "depth", {}, r"gives map as \(1, 3, 12, 16\), no depth map: a depth map has one channel; three may"),
        (SAME, "depth", {"output_channel": 3}, r"there is no channel 3"),
        (SAME, "normal", {"white": 255}, r"vectors of length \d+\.\d+, no normals"),
        ([("Log", ["photo"], ["l"], {}), ("Log", ["l"], ["map"], {})], "normal", {}, r"gives NaN or infinite .* 100%"),
        ([("Flatten", ["photo"], ["map"], {})], "depth", {}, r"gives map as \(1, 576\), no depth map"),
        ([("ReduceMean", ["photo"], ["map"], {"axes": [1, 2]})], "depth", {}, r"another shape than the photo's 12"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_sentence_with_what_the_model_has(onnx_file, photo, nodes, kind, changes, said):
    with pytest.raises(InputError, match=said) as refused:
        predicted(opened(onnx_file(nodes), kind, **(STILL | changes)), photo, CAMERA)
    assert "\n" not in str(refused.value) and "model.onnx" in str(refused.value)


def test_fixed_inputs_name_their_size(onnx_file, photo):
    path = onnx_file(MEAN, {"photo": ("FLOAT", (1, 3, 12, 16))})
    with pytest.raises(InputError, match=r"input\.width=32 in the card does not fit .* have width 16"):
        predicted(opened(path, width=32), photo, CAMERA)
    # a size that follows the photo is the model's where it has one
    assert predicted(opened(path, fit="cover", height=24, width=24), photo, CAMERA)[0].shape == (12, 16)
    with pytest.raises(InputError, match="takes 4 photos at a time"):
        opened(onnx_file(MEAN, {"photo": ("FLOAT", (4, 3, 12, 16))}))
    with pytest.raises(InputError, match="which has 3 axes"):
        opened(onnx_file([("Identity", ["photo"], ["map"], {})], {"photo": ("FLOAT", (3, 12, 16))}))
    with pytest.raises(InputError, match="no photo of floating-point numbers"):
        opened(onnx_file(SAME, {"photo": ("STRING", (1, 3, 12, 16))}, {"map": ("STRING", None)}))


def test_one_of_several_outputs_has_to_be_named(onnx_file, photo):
    nodes = [*MEAN, ("Neg", ["map"], ["minus"], {})]
    path = onnx_file(nodes, outputs={"map": ("FLOAT", None), "minus": ("FLOAT", None)})
    with pytest.raises(InputError, match=r"needs depth\.output=NAME in its card; it has .*map float.*minus float"):
        opened(path)
    values, *_ = predicted(opened(path, output="minus", white=255, **STILL), photo, CAMERA)
    np.testing.assert_allclose(values, -photo.mean(axis=2), rtol=1e-5)


def test_a_model_that_cannot_run_says_why_and_what_it_has(onnx_file, photo):
    path = onnx_file([("Add", ["photo", "b"], ["map"], {})], constants={"b": np.ones((1, 3, 5, 5), np.float32)})
    with pytest.raises(InputError, match=r"cannot run on a photo of 16x12 \(.*\); it has in: photo"):
        predicted(opened(path, **STILL), photo, CAMERA)
    unknown = onnx_file([("NoSuchOperator", ["photo"], ["map"], {})])
    with pytest.raises(InputError, match="cannot be loaded by onnxruntime"):
        opened(unknown)


def test_a_provider_that_is_not_there_is_named(onnx_file, tmp_path, monkeypatch):
    monkeypatch.setattr("onnxruntime.get_available_providers", lambda: ["CPUExecutionProvider"])
    format_ = card_format(read_card(write_card(tmp_path / "card.json", "depth", {})), "depth")
    with pytest.raises(InputError, match=r"prior\.provider=cuda cannot be used: onnxruntime .* has CPUExecutionPr"):
        open_network(onnx_file(MEAN), "depth", format_, 1, "cuda")
