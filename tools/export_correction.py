"""Writes a trained correction of depth as one ONNX file and checks it against torch.

    python -m room2dgs.tools.export_correction RUN depth_correction.onnx

Input: evidence (1, 26, H, W), see `room2dgs.depth.completion.evidence`; H and W multiples of 8. Outputs: shift
(1, H, W), to add to ln depth, and error (1, H, W), the relative error to be expected then. Weights are stored as half
floats and computed with as floats.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from room2dgs.depth.completion.evidence import CHANNELS
from room2dgs.errors import InputError
from room2dgs.files import whole_file
from room2dgs.tools.command_line import command_line
from room2dgs.tools.correction_network.network import CorrectionNetwork, WithErrors
from room2dgs.tools.correction_network.training import load
from room2dgs.tools.export_prior import as_onnx, open_session, round_weights, with_half_weights

OUTPUTS = ("shift", "error")
CHECK_SIZES = ((120, 160), (216, 160), (88, 160))
TOLERANCE = 1e-4


def export_correction(run: Path, out: Path) -> dict[str, float]:
    """Writes the network of a run; nothing is left at `out` when the check fails.

    Returns:
        "error": the largest difference from torch; "megabytes".

    Raises:
        InputError: the run cannot be used, or onnxruntime and torch disagree.
    """
    network = CorrectionNetwork().eval()
    network.load_state_dict(load(run))
    round_weights(network)
    images = {"evidence": 4, **dict.fromkeys(OUTPUTS, 3)}
    example = example_evidence(*CHECK_SIZES[0], 0)
    data = with_half_weights(
        as_onnx(WithErrors(network), (example,), ("evidence",), OUTPUTS, images)
    ).SerializeToString()
    session = open_session(data, 1)
    largest = 0.0
    for size in CHECK_SIZES:
        evidence = example_evidence(*size, 1)
        with torch.no_grad():
            wanted = WithErrors(network)(evidence)
        found = session.run(list(OUTPUTS), {"evidence": evidence.numpy()})
        largest = max(largest, *(float(np.abs(a - b.numpy()).max()) for a, b in zip(found, wanted, strict=True)))
    if not largest <= TOLERANCE:
        raise InputError(f"{run} gives corrections that differ by {largest:.1e} in onnxruntime; train it further")
    with whole_file(out) as temporary:
        temporary.write_bytes(data)
    return {"error": largest, "megabytes": len(data) / 2**20}


def example_evidence(height: int, width: int, seed: int) -> Tensor:
    """Random numbers of about the size that evidence has."""
    return 0.3 * torch.randn(1, CHANNELS, height, width, generator=torch.Generator().manual_seed(seed))


@command_line("export_correction")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="export_correction", description="Write a trained correction of depth as one ONNX file."
    )
    parser.add_argument("run", type=Path, help="run's folder, or its checkpoint")
    parser.add_argument("out", type=Path, help=".onnx file to write")
    given = parser.parse_args(arguments)
    made = export_correction(given.run, given.out)
    print(f"{given.out}: {made['megabytes']:.1f} MB, at most {made['error']:.1e} from torch")


if __name__ == "__main__":
    sys.exit(main())
