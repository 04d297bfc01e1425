"""Writes a trained network as one ONNX file and checks it against torch.

    python -m room2dgs.tools.export_prior RUN room_prior.onnx

Inputs: image (1, 3, H, W) RGB in [0, 1], H and W multiples of 32; intrinsics (1, 3, 3) in pixels of the image, centres
at +0.5. Outputs: depth, depth_error (1, 1, H, W), normal (1, 3, H, W), normal_error (1, 1, H, W); see
`prior_network.network.FullSize`. Weights are stored as half floats and computed with as floats.
"""

from __future__ import annotations

import argparse
import io
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn

from room2dgs.config import conf_dir
from room2dgs.config.card import FOLDER
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.tools.command_line import command_line
from room2dgs.tools.prior_network.checkpoint import average_network, load_checkpoint
from room2dgs.tools.prior_network.network import FullSize

INPUTS, OUTPUTS = ("image", "intrinsics"), ("depth", "depth_error", "normal", "normal_error")
OUTPUT_AXES = dict.fromkeys(OUTPUTS, 4)
OPSET = 17
# smaller constants stay floats: biases and sizes cost nothing
LEAST_HALF = 256
CHECK_SIZES = ((224, 320), (256, 192))
TOLERANCE = 1e-3
TIMED_SIZE, TIMED_RUNS, TIMED_THREADS = (256, 320), 20, 2


def export_prior(checkpoint: Path, out: Path) -> dict[str, float]:
    """Writes the averaged network of a checkpoint and its card beside it; neither is there when the check fails.

    Args:
        checkpoint: the file or its run's folder.
        out: .onnx file to write.

    Returns:
        "error": the largest difference from torch (see `difference`); "megabytes"; "milliseconds": a frame of
        TIMED_SIZE on TIMED_THREADS threads.

    Raises:
        InputError: the checkpoint cannot be used, or onnxruntime and torch disagree.
    """
    network = average_network(load_checkpoint(checkpoint))
    round_weights(network)
    example = example_inputs(*CHECK_SIZES[0], seed=0)
    model = with_half_weights(as_onnx(FullSize(network), example, INPUTS, OUTPUTS, {"image": 4, **OUTPUT_AXES}))
    data = model.SerializeToString()
    session = open_session(data, TIMED_THREADS)
    error = max(difference(session, FullSize(network), size, seed) for seed, size in enumerate(CHECK_SIZES))
    if not error <= TOLERANCE:
        raise InputError(f"{checkpoint} gives maps that differ by {error:.1e} in onnxruntime; train it further")
    with whole_file(out) as temporary:
        temporary.write_bytes(data)
    with whole_file(out.with_suffix(".json")) as temporary:
        temporary.write_bytes((conf_dir() / FOLDER / "room_prior.json").read_bytes())
    return {"error": error, "megabytes": len(data) / 2**20, "milliseconds": milliseconds(session)}


def round_weights(network: nn.Module) -> None:
    """Rounds in place what `with_half_weights` will store as half floats."""
    with torch.no_grad():
        for parameter in network.parameters():
            if parameter.numel() >= LEAST_HALF:
                parameter.copy_(parameter.half().float())


def as_onnx(
    network: nn.Module,
    example: tuple[Tensor, ...],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    images: dict[str, int],
) -> onnx.ModelProto:
    """Traces a network; height and width of its images stay free.

    Args:
        example: what it is traced with.
        inputs, outputs: their names.
        images: name -> number of axes, of which height and width are the last.
    """
    axes = {name: {count - 2: "height", count - 1: "width"} for name, count in images.items()}
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # the tracing exporter warns that it is no longer the newest; the newer one needs onnxscript
        warnings.simplefilter("ignore")
        torch.onnx.export(
            network,
            example,
            buffer,  # type: ignore[arg-type]  # the tracing exporter takes it
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes=axes,
            opset_version=OPSET,
            dynamo=False,
        )
    return onnx.load_from_string(buffer.getvalue())


def with_half_weights(model: onnx.ModelProto) -> onnx.ModelProto:
    """Stores the float weights as half floats, each with a cast to float, which onnxruntime does once when it loads."""
    casts = []
    for weight in model.graph.initializer:
        if weight.data_type != TensorProto.FLOAT or np.prod(weight.dims) < LEAST_HALF:
            continue
        name = weight.name
        half = numpy_helper.from_array(numpy_helper.to_array(weight).astype(np.float16), f"{name}.half")
        weight.CopyFrom(half)
        casts.append(helper.make_node("Cast", [f"{name}.half"], [name], f"{name}.cast", to=TensorProto.FLOAT))
    nodes = list(model.graph.node)
    del model.graph.node[:]
    model.graph.node.extend(casts + nodes)
    onnx.checker.check_model(model)
    return model


def open_session(data: bytes, threads: int) -> onnxruntime.InferenceSession:
    """A session on the CPU."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])


def difference(session: onnxruntime.InferenceSession, network: nn.Module, size: tuple[int, int], seed: int) -> float:
    """Largest difference of any output on random input: of depth and the errors relative, of normals absolute.

    Args:
        session, network: the two to compare.
        size: (height, width).
        seed: of the input.
    """
    inputs = example_inputs(*size, seed=seed)
    with torch.no_grad():
        wanted = [output.numpy() for output in network(*inputs)]
    found = session.run(list(OUTPUTS), {name: value.numpy() for name, value in zip(INPUTS, inputs, strict=True)})
    largest = 0.0
    for name, one, other in zip(OUTPUTS, found, wanted, strict=True):
        if one.shape != other.shape:
            return float("inf")
        scale = 1.0 if name == "normal" else np.abs(other)
        largest = max(largest, float(np.nan_to_num(np.abs(one - other) / scale, nan=np.inf).max()))
    return largest


def example_inputs(height: int, width: int, seed: int) -> tuple[Tensor, Tensor]:
    """A smooth random picture with a little noise, and intrinsics off the middle."""
    generator = torch.Generator().manual_seed(seed)
    coarse = torch.rand(1, 3, height // 32, width // 32, generator=generator)
    image = nn.functional.interpolate(coarse, size=(height, width), mode="bilinear")
    image = (image + 0.05 * torch.randn(image.shape, generator=generator)).clamp(0.0, 1.0)
    focal = 0.8 * width
    intrinsics = torch.tensor([[focal, 0.0, 0.48 * width], [0.0, 1.02 * focal, 0.53 * height], [0.0, 0.0, 1.0]])
    return image, intrinsics[None]


def milliseconds(session: onnxruntime.InferenceSession) -> float:
    """Median time of a frame of TIMED_SIZE."""
    inputs = example_inputs(*TIMED_SIZE, seed=0)
    feed = {name: value.numpy() for name, value in zip(INPUTS, inputs, strict=True)}
    times = []
    for _ in range(TIMED_RUNS):
        start = time.perf_counter()
        session.run(None, feed)
        times.append(1000.0 * (time.perf_counter() - start))
    return float(np.median(times))


@command_line("export_prior")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="export_prior", description="Write a trained network as one ONNX file.")
    parser.add_argument("checkpoint", type=Path, help="checkpoint, or its run's folder")
    parser.add_argument("out", type=Path, help=".onnx file to write")
    given = parser.parse_args(arguments)
    made = export_prior(given.checkpoint, given.out)
    height, width = TIMED_SIZE
    print(
        f"{given.out}: {made['megabytes']:.1f} MB, at most {made['error']:.1e} from torch, "
        f"{made['milliseconds']:.0f} ms a frame of {width}x{height} on {TIMED_THREADS} threads"
    )


if __name__ == "__main__":
    sys.exit(main())
