"""A model's file is looked at before anything opens it: what it names, and whether it is a model at all."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from room2dgs.depth.network.model_file import external_locations, read_model
from room2dgs.errors import InputError


def weights_in(path: Path, *locations: str) -> Path:
    """A copy of a model whose constants lie in other files, by those names, whether they are there or not."""
    model = onnx.load(str(path))
    for tensor, location in zip(model.graph.initializer, locations, strict=True):
        tensor.ClearField("raw_data")
        tensor.data_location = onnx.TensorProto.EXTERNAL
        for key, value in (("location", location), ("offset", "0"), ("length", "12")):
            tensor.external_data.add(key=key, value=value)
    other = path.with_name("apart.onnx")
    other.write_bytes(model.SerializeToString())
    return other


@pytest.fixture
def scaled(onnx_file) -> Path:
    constants = {"a": np.ones(3, np.float32), "b": np.full(3, 2, np.float32)}
    return onnx_file([("Mul", ["photo", "a"], ["t"], {}), ("Add", ["t", "b"], ["map"], {})], constants=constants)


def test_a_whole_model_is_known_by_its_bytes(scaled):
    digest = hashlib.sha256(scaled.read_bytes()).hexdigest()
    assert external_locations(scaled) == []
    assert read_model(scaled, digest.upper()).digest == digest
    with pytest.raises(InputError, match=f"has the SHA-256 {digest}, not {'0' * 64}"):
        read_model(scaled, "0" * 64)


def test_weights_apart_are_found_and_belong_to_the_digest(scaled):
    apart = weights_in(scaled, "b.bin", "sub/a.bin")
    assert external_locations(apart) == ["b.bin", "sub/a.bin"]
    with pytest.raises(InputError, match=r"needs .*b\.bin beside it"):
        read_model(apart)
    (apart.parent / "sub").mkdir()
    for name in ("b.bin", "sub/a.bin"):
        (apart.parent / name).write_bytes(bytes(12))
    before = read_model(apart).digest
    assert read_model(apart).bytes == apart.stat().st_size + 24
    (apart.parent / "sub" / "a.bin").write_bytes(bytes(11) + b"x")
    assert read_model(apart).digest != before


def test_weights_in_a_nodes_own_constant_and_in_a_branch_are_found(tmp_path):
    tensor = onnx.TensorProto(name="t", data_type=onnx.TensorProto.FLOAT, dims=[3])
    tensor.data_location = onnx.TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="../outside.bin")
    constant = onnx.helper.make_node("Constant", [], ["c"], value=tensor)
    output = onnx.helper.make_tensor_value_info("c", onnx.TensorProto.FLOAT, [3])
    branch = onnx.helper.make_graph([constant], "branch", [], [output])
    node = onnx.helper.make_node("If", ["yes"], ["map"], then_branch=branch, else_branch=branch)
    graph = onnx.helper.make_graph([node], "g", [], [])
    path = tmp_path / "branches.onnx"
    path.write_bytes(onnx.helper.make_model(graph).SerializeToString())
    assert external_locations(path) == ["../outside.bin"]


@pytest.mark.parametrize("location", ["../w.bin", "/etc/passwd", "a/../../w.bin", "C:\\w.bin", "..\\w.bin", "\\w", ""])
def test_weights_outside_the_models_folder_are_refused_though_they_exist(scaled, location):
    (scaled.parent.parent / "w.bin").write_bytes(bytes(12))
    with pytest.raises(InputError, match="outside its own folder") as refused:
        read_model(weights_in(scaled, "a.bin", location))
    assert repr(location) in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n", b"<!DOCTYPE html>", bytes(64), b"\x0a\x02\x08\x01"])
def test_what_is_no_model_is_named(tmp_path, content):
    path = tmp_path / "network.onnx"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"network\.onnx is not an ONNX model"):
        read_model(path)


def test_a_missing_model_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.onnx is not there"):
        read_model(tmp_path / "gone.onnx")


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_bytes_are_refused_or_read_but_never_crash(scaled, data):
    whole = bytearray(weights_in(scaled, "a.bin", "b.bin").read_bytes())
    for place in data.draw(st.lists(st.integers(0, len(whole) - 1), max_size=4)):
        whole[place] = data.draw(st.integers(0, 255))
    path = scaled.with_name("damaged.onnx")
    path.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    try:
        assert isinstance(external_locations(path), list)
    except InputError as error:
        assert "is not an ONNX model" in str(error)
