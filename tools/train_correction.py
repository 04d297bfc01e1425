"""Trains the network that corrects completed depth.

    python -m room2dgs.tools.train_correction DATA OUT --minutes 60

DATA holds the rooms that `make_correction_data` has made. OUT gets checkpoint.safetensors, every two minutes and at the
end. With --from, training starts from another run's weights. It ends by the clock, so it gives other bits each time.
"""

from __future__ import annotations

import argparse
import functools
import sys
from pathlib import Path

import torch

from room2dgs.commands.flags import add_flags
from room2dgs.tools.command_line import command_line
from room2dgs.tools.correction_network.samples import read_rooms
from room2dgs.tools.correction_network.training import Options, load, train
from room2dgs.tools.prior_network.memory import keep_freed_memory

HELP = {
    "minutes": "of training",
    "steps": "of training instead; 0: the minutes end it",
    "batch": "views a step",
    "lr": "learning rate",
    "weight_decay": "of AdamW",
    "seed": "decides order and variation",
}


@command_line("train_correction")
def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="train_correction",
        description="Train the network that corrects completed depth.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("data", type=Path, help="folder of rooms")
    parser.add_argument("out", type=Path, help="folder of the run")
    add_flags(parser, Options, HELP)
    parser.add_argument("--held-out", type=Path, help="folder of rooms to validate on")
    parser.add_argument("--from", dest="start_from", type=Path, help="run, or its checkpoint, to start from")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads(), help="cores to use")
    given = vars(parser.parse_args(arguments))
    data, out, held_out, start_from, threads = (
        given.pop(name) for name in ("data", "out", "held_out", "start_from", "threads")
    )
    keep_freed_memory()
    torch.set_num_threads(threads)
    start = load(start_from) if start_from else None
    others = read_rooms(held_out) if held_out else {}
    train(read_rooms(data), others, out, Options(**given), start, functools.partial(print, flush=True))


if __name__ == "__main__":
    sys.exit(main())
