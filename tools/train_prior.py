"""Trains the network for depth and normals on rendered rooms.

    python -m room2dgs.tools.train_prior DATA OUT --size 256x192 --steps 20000

DATA is a folder of shards (`python -m room2dgs.tools.make_prior_data`). OUT gets checkpoint.safetensors, every few
minutes and at the end, and tensorboard/. The same command on the same OUT goes on where it stopped. With --from,
a new OUT starts from another run's weights, on other data or another size, or from an exported network's.

On a GPU, where batches are the bottleneck:

    python -m room2dgs.tools.train_prior DATA OUT --device cuda --precision bf16 --batch 64 --workers 16 --minutes 10
"""

from __future__ import annotations

import argparse
import functools
import sys
from dataclasses import fields
from pathlib import Path

import cv2
import torch

from room2dgs.tools.command_line import command_line
from room2dgs.tools.prior_network.memory import keep_freed_memory
from room2dgs.tools.prior_network.options import TrainOptions
from room2dgs.tools.prior_network.training import train

HELP = {
    "size": "of the training images, multiples of 32",
    "steps": "steps of the optimiser",
    "minutes": "end after so many minutes, if that comes first; 0: never",
    "batch": "samples a step",
    "lr": "learning rate",
    "encoder_lr": "the encoder's learning rate as a factor of it",
    "warmup": "steps until the full learning rate",
    "decay": "share of the run at its end in which the learning rate falls to 0",
    "weight_decay": "of AdamW",
    "average": "decay of the weights' running mean, which is validated and exported",
    "held_out": "shards kept for validation, the first by name",
    "validate_every": "steps",
    "validation_samples": "at most so many",
    "save_minutes": "between checkpoints",
    "seed": "decides order and augmentation",
    "device": "cpu, cuda, or auto: a GPU where there is one",
    "precision": "float32 or bf16",
    "workers": "processes that make batches; 0: a thread, enough for a CPU",
}


def image_size(text: str) -> tuple[int, int]:
    """Such as "256x192" -> (256, 192)."""
    width, _, height = text.partition("x")
    return int(width), int(height)


@command_line("train_prior")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="train_prior",
        description="Train the network for depth and normals on rendered rooms.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("data", type=Path, help="folder of shards")
    parser.add_argument("out", type=Path, help="folder of the run")
    for option in fields(TrainOptions):
        flag, help_text = "--" + option.name.replace("_", "-"), HELP[option.name]
        if option.name == "size":
            parser.add_argument(flag, type=image_size, default="256x192", help=help_text)
        else:
            parser.add_argument(flag, type=type(option.default), default=option.default, help=help_text)
    parser.add_argument("--from", dest="start_from", type=Path, help="checkpoint, run's folder or .onnx to start from")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads(), help="cores to use")
    given = vars(parser.parse_args(arguments))
    data, out, start_from, threads = (given.pop(name) for name in ("data", "out", "start_from", "threads"))
    keep_freed_memory()
    cv2.setNumThreads(1)
    torch.set_num_threads(max(1, threads // 2))
    # weights that fade to denormal numbers would slow the CPU manifold
    torch.set_flush_denormal(True)
    try:
        train(data, out, TrainOptions(**given), start_from, threads, functools.partial(print, flush=True))
    finally:
        torch.set_flush_denormal(False)  # it holds for the whole process


if __name__ == "__main__":
    sys.exit(main())
