"""The exported file."""

import numpy as np
import onnx
import pytest
import torch

from room2dgs.config import load_config
from room2dgs.depth.network.card import format_of
from room2dgs.depth.network.session import open_network
from room2dgs.errors import InputError
from room2dgs.tools import export_prior
from room2dgs.tools.prior_network.checkpoint import PARTS, Checkpoint, save_checkpoint
from room2dgs.tools.prior_network.from_onnx import exported_weights
from room2dgs.tools.prior_network.network import FullSize, PriorNetwork

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def network() -> PriorNetwork:
    torch.manual_seed(1)
    made = PriorNetwork().eval()
    with torch.no_grad():
        # heads that say something, unlike those of an untrained network
        made.heads[-1].weight.mul_(20.0)
    return made


@pytest.fixture(scope="module")
def checkpoint(network, tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "checkpoint.safetensors"
    average = {name: parameter.detach() for name, parameter in network.named_parameters()}
    # only the mean of the weights is exported
    parts = {part: {name: torch.zeros_like(value) for name, value in average.items()} for part in PARTS}
    parts["average"] = average
    save_checkpoint(path, Checkpoint(1, 1, 0.0, {}, [], [], parts))
    return path


@pytest.fixture(scope="module")
def exported(checkpoint):
    path = checkpoint.with_name("room_prior.onnx")
    export_prior.export_prior(checkpoint, path)
    return path


def test_the_file_gives_the_networks_maps_at_sizes_it_was_not_traced_with(exported, network):
    session = export_prior.open_session(exported.read_bytes(), 1)
    for size in ((32, 64), (96, 32), (160, 224)):
        # half floats round the weights; nothing else may differ
        assert export_prior.difference(session, FullSize(network), size, seed=7) < 0.03


def test_the_file_names_what_goes_in_and_out_and_is_small(exported):
    graph = onnx.load(exported).graph
    shapes = {
        value.name: [axis.dim_param or axis.dim_value for axis in value.type.tensor_type.shape.dim]
        for value in (*graph.input, *graph.output)
    }
    assert [value.name for value in graph.input] == ["image", "intrinsics"]
    assert [value.name for value in graph.output] == ["depth", "depth_error", "normal", "normal_error"]
    assert shapes["image"] == [1, 3, "height", "width"]
    assert shapes["intrinsics"] == [1, 3, 3]
    assert exported.stat().st_size < 12 * 2**20


def test_the_file_has_its_card_beside_it(exported):
    given = ["scene.path=a", "out=b", "prior=none", "prior/depth=onnx", f"prior.depth.model={exported}"]
    prior = load_config(given).prior
    network = open_network(exported, "depth", format_of(prior.depth, "depth"), 1, "cpu")
    assert prior.depth.meaning == "metric_depth" and network.outputs == ("depth", "depth_error")


def test_large_weights_are_half_floats_and_those_of_the_average(exported, network):
    halves = {
        weight.name.removesuffix(".half"): onnx.numpy_helper.to_array(weight)
        for weight in onnx.load(exported).graph.initializer
        if weight.data_type == onnx.TensorProto.FLOAT16
    }
    assert sum(array.size for array in halves.values()) > 4_000_000
    stem = network.encoder.stem.weight.detach().half().numpy()
    assert any(array.shape == stem.shape and np.array_equal(array, stem) for array in halves.values())


def test_a_file_that_computes_something_else_is_not_written(checkpoint, tmp_path, monkeypatch, capsys):
    honest = export_prior.with_half_weights

    def spoil(model: onnx.ModelProto) -> onnx.ModelProto:
        model = honest(model)
        weight = max(model.graph.initializer, key=lambda one: np.prod(one.dims))
        weight.CopyFrom(onnx.numpy_helper.from_array(onnx.numpy_helper.to_array(weight) * np.float16(1.1), weight.name))
        return model

    monkeypatch.setattr(export_prior, "with_half_weights", spoil)
    assert export_prior.main([str(checkpoint), str(tmp_path / "room_prior.onnx")]) == 2
    assert "differ" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_missing_checkpoint_is_named(tmp_path):
    with pytest.raises(InputError, match=r"checkpoint\.safetensors is missing"):
        export_prior.export_prior(tmp_path, tmp_path / "room_prior.onnx")


def test_an_exported_network_can_be_trained_on(exported, network):
    """Its weights come back as they were but for the rounding to half floats; layers are told from one another."""
    found = exported_weights(exported)
    for name, parameter in network.named_parameters():
        torch.testing.assert_close(found[name], parameter.detach(), rtol=1e-3, atol=1e-6)


def test_a_file_of_another_network_is_not_trained_on(tmp_path, exported):
    model = onnx.load(exported)
    del model.graph.initializer[0]
    onnx.save(model, tmp_path / "other.onnx")
    with pytest.raises(InputError, match=r"other\.onnx is not of this network"):
        exported_weights(tmp_path / "other.onnx")
    (tmp_path / "none.onnx").write_bytes(b"no model")
    with pytest.raises(InputError, match=r"none\.onnx is no"):
        exported_weights(tmp_path / "none.onnx")
