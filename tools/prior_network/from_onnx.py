"""The weights of an exported network, to train on from them where its checkpoint is not at hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor

from room2dgs.errors import InputError
from room2dgs.tools.prior_network.network import PriorNetwork

MODULE = "network"  # of `FullSize`


def exported_weights(path: Path) -> dict[str, Tensor]:
    """Parameters by name, as `export_prior` has stored them.

    Raises:
        InputError: the file is no export of this network.
    """
    try:
        graph = onnx.load(str(path)).graph
    except Exception as error:  # protobuf's own kinds, and the disk's
        raise InputError(f"{path} is no ONNX file; give one that export_prior wrote") from error
    stored = {weight.name.removesuffix(".half"): numpy_helper.to_array(weight) for weight in graph.initializer}
    for node in graph.node:
        # tracing turns linear layers over and calls them by a number, and keeps equal arrays once
        known = [stored[name] for name in node.input if name in stored]
        if node.op_type == "MatMul" and known:
            stored[f"{_module(node.name)}.weight"] = known[0].T
        elif node.op_type == "Identity" and known:
            stored[node.output[0]] = known[0]
    wanted = {name: parameter.shape for name, parameter in PriorNetwork().named_parameters()}
    found = {name: stored.get(f"{MODULE}.{name}") for name in wanted}
    if any(values is None or values.shape != wanted[name] for name, values in found.items()):
        raise InputError(f"{path} is not of this network; give a file that export_prior wrote")
    return {name: torch.from_numpy(np.array(values, np.float32)) for name, values in found.items()}


def _module(node: str) -> str:
    """ "/network/context.0/perceptron/perceptron.2/MatMul" -> "network.context.0.perceptron.2"."""
    parts = node.strip("/").split("/")[:-1]
    inner = [part for part, after in zip(parts, [*parts[1:], ""], strict=True) if not after.startswith(f"{part}.")]
    return ".".join(inner)
